"""The editor's dialogs: a draft, two versions of a file, saving, what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import ClassVar

from textual import on
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType

from rise_engine.author.edit.drafts import Draft
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.explored import ExploredPlace, explored_rows, find_explored
from rise_tui.editor.model.fields import NOTE_MARKS, FieldChoice
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.page import EditFrame
from rise_tui.editor.pick_list import Picked, PickList
from rise_tui.rendering.modal import SingleDismissModal, TitledBox
from rise_tui.rendering.text import ListRow, TextRole, clean, crop, shorten, wrap
from rise_tui.screens.detail import DetailScreen
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.widgets.row_list import RowList, RowView

_SHOWN = 8
"""The largest number of changes that a dialog lists."""


def ask_about_clash(app: App[object], files: Sequence[str], take: Callable[[], None]) -> None:
    """Ask which version of files stays, if they have unsaved changes here and were changed on the disk.

    :param take: takes the versions on the disk.
    """
    named = ", ".join(map(clean, files))
    lines = [
        f"Somebody has changed {named} on the disk. You have unsaved changes in the same place.",
        "Keep yours: saving then overwrites the other version, and shows you first which lines.",
        "Take the other's: undo (ctrl+u) brings yours back.",
    ]
    question = Dialog(
        "Changed here and on the disk",
        lines,
        DialogChoice("o", "Take the other's"),
        no="Keep yours",
    )
    app.push_screen(question, lambda key: take() if key == "o" else None)


def _local_time(kept: str) -> str:
    """A time in the local time zone; unchanged if it cannot be read."""
    try:
        return datetime.fromisoformat(kept).astimezone().strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return clean(kept)


def draft_dialog(draft: Draft) -> Dialog:
    """What an earlier editor has not saved: restore or discard it. Esc leaves the editor and keeps it."""
    says = [clean(sentence) for sentence in draft.says]
    lines = [
        f"An editor ended without saving ({_local_time(draft.kept)}):",
        *(f"· {each}" for each in says[:_SHOWN]),
    ]
    lines += [f"· and {len(says) - _SHOWN} more"] if len(says) > _SHOWN else []
    return Dialog("Unsaved changes", lines, DialogChoice("d", "Discard it"), DialogChoice("t", "Restore it"),
                  no="Leave the editor", default="t")  # fmt: skip


class SaveDialog(SingleDismissModal[bool]):
    """The result: whether to save."""

    DEFAULT_CSS = """
    SaveDialog {
        align: center middle; background: transparent;
        #box { width: 96; height: 90%; }
        RowList { background: $panel; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter,ctrl+o", "save", show=False),
        Binding("escape", "leave", show=False),
    ]

    def __init__(self, draft: StudyDraft, diff: str) -> None:
        super().__init__()
        self._draft, self._diff = draft, diff
        self._errors = draft.checked.errors
        self.list = RowList()

    def compose(self) -> ComposeResult:
        title = "Not saved: there is an error" if self._errors else f"Save {self._draft.title}?"
        keys = "esc keeps editing" if self._errors else "enter saves · esc keeps editing · ↑↓ read"
        with TitledBox(title, keys):
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.list)

    @on(RowView.Resized)
    def _draw(self) -> None:
        width = max(20, self.list.row_width)
        self.list.show(save_rows(self._draft, self._diff, self._errors, width))

    def action_save(self) -> None:
        """Save, if there are no errors."""
        self.dismiss(not self._errors)

    def action_leave(self) -> None:
        self.dismiss(False)


def save_rows(draft: StudyDraft, diff: str, errors: Sequence[Diagnostic], width: int) -> list[ListRow]:
    """Errors, then the changes in words, then the changed lines of the files."""
    rows: list[ListRow] = []

    def add(text: str, role: TextRole = "plain", indent: str = " ") -> None:
        for number, piece in enumerate(wrap(text, max(20, width - len(indent) - 2))):
            rows.append(ListRow("", ((f"{indent}{'  ' if number else ''}{piece}", role),), selectable=False))

    if errors:
        add(f"{pluralize(len(errors), 'error')}: fix this first. Your changes stay in the draft.")
        for each in errors:
            add(f"✗ {each.location.file}:{each.location.line} {clean(each.message)}", "fault")
        rows.append(ListRow("", (), selectable=False))
    add(f"{pluralize(len(draft.changes), 'change')} in {pluralize(len(draft.changed_files), 'file')}", "accent")
    for change in draft.changes:
        for sentence in change.says:
            add(f"· {clean(sentence)}")
        for sentence in change.noticed:
            add(f"▲ {clean(sentence)}", "wait")
    rows.append(ListRow("", (), selectable=False))
    roles: dict[str, TextRole] = {"+": "strong", "-": "muted", "@": "accent"}
    for line in diff.splitlines():
        role = roles.get(line[:1], "plain")
        rows.append(ListRow("", crop(((f" {line.expandtabs(4)}", role),), width), selectable=False))
    return rows


_TITLE_WIDTH = 70
"""Characters of a diagnostic in the title of its remedies, at 80 columns."""


def choose_finding(frame: EditFrame, app: App[object], *, now: str = "") -> None:
    """List everything that is wrong. The page of the chosen one opens, or its remedies.

    :param now: the number of the entry where the cursor begins.
    """
    draft, explored = frame.study.draft, frame.explored
    findings = draft.findings
    if not findings and not explored.findings:
        frame.say("nothing is wrong: no errors and no warnings")
        return

    def take(picked: Picked | None) -> None:
        if picked is None:
            return
        number = int(picked.value)
        if number >= len(findings):
            finding = explored.findings[number - len(findings)]
            if picked.is_tab:
                _show_steps(frame, app, finding, picked.value)
            else:
                _go_to(frame, find_explored(draft, finding), finding.text)
        elif picked.is_tab:
            _show_remedies(frame, findings[number])
        else:
            where = findings[number].location
            _go_to(frame, find_at(draft, where.file, where.line), str(findings[number]))

    word = explored.word(draft)
    choices = [_choice(number, each) for number, each in enumerate(findings)]
    choices += [_explored_choice(number, each, word) for number, each in enumerate(explored.findings, len(findings))]
    tab = ["what can be done"] * len(findings)
    tab += ["step by step" if each.way else "" for each in explored.findings]
    title = " · ".join(filter(None, ("What is wrong", explored.seen(draft))))
    keys = {choice.value: word for choice, word in zip(choices, tab, strict=True)}
    app.push_screen(PickList(title, choices, now=now, enter="goes there", tab=keys), take)


def _choice(number: int, finding: Diagnostic) -> FieldChoice:
    where = f"{NOTE_MARKS[finding.severity][0]}{finding.location.file}:{finding.location.line}"
    return FieldChoice(str(number), where, clean(finding.message))


def _explored_choice(number: int, finding: ExploredPlace, word: str) -> FieldChoice:
    mark, _ = NOTE_MARKS[finding.severity]
    where = f"{mark}{finding.file}:{finding.line}" if finding.file else mark
    return FieldChoice(str(number), where, f"{word}: {clean(finding.text)}")


def _go_to(frame: EditFrame, page: tuple[str, str] | None, text: str) -> None:
    """Open the page of a diagnostic; without one, show its text."""
    if page is None:
        frame.say(clean(text), "wait")
    else:
        frame.open_page(*page)


def _show_steps(frame: EditFrame, app: App[object], finding: ExploredPlace, now: str) -> None:
    """Show the steps of a session that lead to a finding; then the list again, at the same place."""
    title = f"{frame.explored.word(frame.study.draft)}: {finding.file}:{finding.line}"
    steps = DetailScreen(title, lambda width: explored_rows(finding, width))
    app.push_screen(steps, lambda _: choose_finding(frame, app, now=now))


def _show_remedies(frame: EditFrame, finding: Diagnostic) -> None:
    found = frame.study.remedies(finding)
    text = clean(finding.message)
    if not found:
        frame.say(f"only you can decide what is right here: {text}", "wait")
        return
    choices = [FieldChoice(str(number), clean(each.title)) for number, each in enumerate(found)]
    frame.choose(shorten(text, _TITLE_WIDTH), choices, lambda number: frame.make(found[int(number)].edit))
