"""What saving would write: in words, then line by line; and what keeps it from being saved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.editor.model.draft import StudyDraft, count
from rise_tui.rendering.modal import SingleDismissModal, TitledBox
from rise_tui.rendering.text import ListRow, TextRole, clean, crop, wrap
from rise_tui.widgets.row_list import RowList, RowView


class SaveDialog(SingleDismissModal[bool]):
    """The result is whether it is to be saved."""

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
        keys = "esc back to the draft" if self._errors else "enter saves · esc goes on editing · ↑↓ read"
        with TitledBox(title, keys):
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.list)

    @on(RowView.Resized)
    def _draw(self) -> None:
        width = max(20, self.list.row_width)
        self.list.show(save_rows(self._draft, self._diff, self._errors, width))

    def action_save(self) -> None:
        """Only without errors."""
        self.dismiss(not self._errors)

    def action_leave(self) -> None:
        self.dismiss(False)


def save_rows(draft: StudyDraft, diff: str, errors: Sequence[Diagnostic], width: int) -> list[ListRow]:
    """Errors, then what was changed in words, then the lines of the files."""
    rows: list[ListRow] = []

    def add(text: str, role: TextRole = "plain", indent: str = " ") -> None:
        for number, piece in enumerate(wrap(text, max(20, width - len(indent) - 2))):
            rows.append(ListRow("", ((f"{indent}{'  ' if number else ''}{piece}", role),), selectable=False))

    if errors:
        add(f"{count(len(errors), 'error')}: nothing is written until it is gone. Your changes stay in the draft.")
        for each in errors:
            add(f"✗ {each.location.file}:{each.location.line} {clean(each.message)}", "fault")
        rows.append(ListRow("", (), selectable=False))
    add(f"{count(len(draft.changes), 'change')} in {count(len(draft.changed_files), 'file')}", "accent")
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
