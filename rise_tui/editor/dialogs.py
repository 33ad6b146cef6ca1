"""The editor's dialogs: a list to choose from, a line to type in, a draft, two versions of a file, saving, errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import ClassVar, NamedTuple

from textual import events, on
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Input

from rise_engine.author.edit.drafts import Draft
from rise_engine.author.edit.remedies import remedies
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.fields import NOTE_MARKS, FieldChoice
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.page import EditFrame
from rise_tui.editor.study import ExploredPlace, explored_rows, find_explored
from rise_tui.rendering.text import ListRow, StyledSpan, TextRole, cell_width, clean, crop, fixed_span, shorten, wrap
from rise_tui.screens.dialog import Dialog, DialogChoice, SingleDismissModal, TitledBox
from rise_tui.screens.palette import SearchDialog
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.fields import TextField
from rise_tui.widgets.lines import RowList, RowView, StaticLines

NEW = "\0new"
"""The id of the row that creates the typed name."""
MAX_HELP_LINES = 3
"""Lines for the full help of a choice."""
ONLY_IN_HELP = 2


def _distance(choice: FieldChoice, typed: str) -> int:
    """0: the choice's name begins with the text; 1: the name contains it; ONLY_IN_HELP: only the help contains it."""
    title, wanted = choice.title.casefold(), typed.casefold()
    return 0 if title.startswith(wanted) else 1 if wanted in title else ONLY_IN_HELP


class Picked(NamedTuple):
    """The author's choice."""

    value: str
    """The value under the cursor."""
    ticked: tuple[str, ...] = ()
    """All ticked values, in the order of the list."""
    is_tab: bool = False
    """Whether the author pressed Tab instead of Enter."""


class OneWordField(TextField):
    """A field that leaves the space key to the dialog around it."""

    def on_key(self, event: events.Key) -> None:
        if event.key == "space":
            event.prevent_default()


class PickList(SearchDialog[Picked]):
    """Lets the author choose one or any number. It can offer to create a name that is not in the list."""

    DEFAULT_CSS = """
    PickList #box { max-width: 92; height: auto; }
    PickList FoundList { height: auto; max-height: 14; min-height: 4; }
    PickList StaticLines { height: 3; background: $panel; margin: 1 0 0 0; }
    """

    def __init__(
        self,
        title: str,
        choices: Sequence[FieldChoice],
        *,
        now: str = "",
        new: str = "",
        ticked: Sequence[str] | None = None,
        enter: str = "takes it",
        tab: Mapping[str, str] | None = None,
    ) -> None:
        """
        :param now: the first value of the cursor.
        :param new: the use of a name that is not in the list; empty: none.
        :param ticked: the values that are ticked first; None: a list to choose one value, without ticks.
        :param enter: what Enter does. :param tab: what Tab does, for each value that has an entry.
        """
        super().__init__(title, "", "type to filter")
        if ticked is not None:
            self.search = OneWordField(placeholder="type to filter", select_on_focus=False)
        self._choices, self._now, self._new = choices, now, new
        self._ticked = None if ticked is None else set(ticked)
        self._enter, self._tab = enter, tab or {}
        self._whole = StaticLines()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, self._keys_line()):
            yield self.search
            yield self.list
            yield self._whole

    def draw(self) -> None:
        typed = self.search.value.strip()
        self._draw_rows()
        self.list.move_cursor(0 if self.list.count and self.list.row_at(0).selectable else -1, by_wizard=False)
        if not typed:
            self.list.select(self._now)
        self._show_whole()

    def _draw_rows(self) -> None:
        typed, wanted, width = self.search.value.strip(), self.typed_filter(), self.list.row_width
        found = [each for each in self._choices if self.is_found(wanted, f"{each.title} {each.help}")]
        if typed:  # the beginning of a name beats a name that contains it, and help that does
            found.sort(key=lambda each: _distance(each, typed))
        rows = [ListRow(each.value, self._line(each, width)) for each in found]
        if self._new and typed and all(each.value != typed for each in self._choices):
            by_title = sum(_distance(each, typed) < ONLY_IN_HELP for each in found)
            rows.insert(by_title, ListRow(NEW, ((f" make “{typed}”, {self._new}", "accent"),)))
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])

    @on(RowView.CursorMoved)
    def _show_whole(self) -> None:
        """Show the keys of the row under the cursor, and its full help if the list has no room for it."""
        self.query_one("#box").border_subtitle = f" {self._keys_line()} "
        width = self.list.row_width
        room = width - self._title_width(width) - 4
        self._whole.display = any(cell_width(each.help) > room for each in self._choices)
        chosen = next((each.help for each in self._choices if each.value == self.list.current_id), "")
        lines = wrap(chosen, max(20, width - 4))[:MAX_HELP_LINES] if cell_width(chosen) > room else []
        self._whole.show(*(((f"   {line}", "plain"),) for line in [*lines, *[""] * (MAX_HELP_LINES - len(lines))]))

    def _keys_line(self) -> str:
        if self._ticked is not None:
            return "space: yes or no · enter done · esc as it was"
        tab = self._tab.get(self.list.current_id, "")
        arrows = "↑↓ · " if not self._tab else ""
        return f"type to filter · {arrows}enter {self._enter}{f' · tab {tab}' if tab else ''} · esc closes"

    def _line(self, choice: FieldChoice, width: int) -> tuple[StyledSpan, ...]:
        mark: StyledSpan = (" • " if choice.value == self._now else "   ", "accent")
        if self._ticked is not None:
            mark = (" [x] " if choice.value in self._ticked else " [ ] ", "accent")
        return crop((mark, fixed_span(choice.title, self._title_width(width)), (f" {choice.help}", "muted")), width)

    def _title_width(self, width: int) -> int:
        if not any(each.help for each in self._choices):
            return max(10, width - 5)
        longest = max((cell_width(each.title) for each in self._choices), default=0)
        return max(10, min(longest + 1, 36, width // 2))

    def carry_out_key(self, key: str) -> bool:
        current = self.list.current_id
        if key == "enter" or (key == "tab" and self._tab.get(current)):
            self._dismiss_with(current, is_tab=key == "tab")
        elif key == "space" and self._ticked is not None:
            if current:
                self._ticked ^= {current}
                self._draw_rows()
        else:
            return super().carry_out_key(key) or key == "tab"
        return True

    def _dismiss_with(self, current: str, *, is_tab: bool) -> None:
        if self._ticked is not None:
            ticked = tuple(each.value for each in self._choices if each.value in self._ticked)
            self.dismiss(Picked(current, ticked))
        elif self.list.cursor >= 0:
            self.dismiss(Picked(self.search.value.strip() if current == NEW else current, is_tab=is_tab))


class AskText(SingleDismissModal[str]):
    """A line to type in. The result is the text without blanks around it."""

    DEFAULT_CSS = """
    AskText {
        align: center middle; background: transparent;
        #box { width: 70; }
        StaticLines { background: $panel; }
        TextField, TextField:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, title: str, text: str, hint: str = "") -> None:
        super().__init__()
        self._title, self._hint = title, hint
        self._field = TextField(text, select_on_focus=False)
        self._line = StaticLines()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, "enter takes it · esc closes"):
            yield self._field
            yield self._line

    def on_mount(self) -> None:
        self.set_focus(self._field)
        self._line.show(((self._hint, "muted"),))

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.dismiss(event.value.strip())

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            self.dismiss("")


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
    """Ask what to do with an earlier editor's unsaved changes: restore or discard them. Esc leaves the editor and keeps
    them."""
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
    """List all diagnostics and findings. The page of the chosen one opens, or its remedies.

    :param now: the first entry of the cursor.
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
    title = " · ".join(filter(None, ("What is wrong", explored.extent_text(draft))))
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
    """Show the steps of a session that lead to a finding, then the list again, at the same place."""
    title = f"{frame.explored.word(frame.study.draft)}: {finding.file}:{finding.line}"
    steps = DetailScreen(title, lambda width: explored_rows(finding, width))
    app.push_screen(steps, lambda _: choose_finding(frame, app, now=now))


def _show_remedies(frame: EditFrame, finding: Diagnostic) -> None:
    found = remedies(finding, frame.study.workspace.state)
    text = clean(finding.message)
    if not found:
        frame.say(f"only you can decide what is right here: {text}", "wait")
        return
    choices = [FieldChoice(str(number), clean(each.title)) for number, each in enumerate(found)]
    frame.choose(shorten(text, _TITLE_WIDTH), choices, lambda number: frame.make(found[int(number)].edit))
