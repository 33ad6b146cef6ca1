"""The questions before a session of a study: what to rehearse, and who sits at the console."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, cast

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Input, Static

from rise_engine.study.model import Purpose
from rise_tui.config.study_source import SessionRequest
from rise_tui.model.study_rows import Conditions
from rise_tui.rendering.modal import TitledBox
from rise_tui.rendering.text import ListRow, clean
from rise_tui.screens.dialog import FormDialog
from rise_tui.widgets.choice_field import ChoiceField, OpenChoice
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.row_list import RowList

PURPOSES: dict[str, str] = {
    "debug": "with the simulated robot; marked as not data",
    "training": "for the wizard, on the robot",
    "pilot": "with a person, on the robot, as if it counted",
}
THEIRS = "theirs"
"""The row for the participant's own condition."""


class RehearsalDialog(FormDialog[SessionRequest | None]):
    """Asks for a rehearsal. Left and right choose its purpose, up and down its condition; Enter goes on."""

    AUTO_FOCUS = "#conditions"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", show=False)]

    DEFAULT_CSS = """
    RehearsalDialog {
        RowList { margin: 1 0 0 0; background: $panel; }
    }
    """

    def __init__(self, participant: str, purposes: Sequence[Purpose], names: Sequence[str], shown: Conditions) -> None:
        """`names`: every condition of the design. A hidden study does not offer the participant's own condition,
        because the wizard would know it before the session."""
        super().__init__()
        self._participant, self._names, self._shown = participant, names, shown
        self.purpose = ChoiceField(tuple(purposes), purposes[0], id="purpose")
        self.purpose.can_focus = False
        self.list = RowList(id="conditions")

    def compose(self) -> ComposeResult:
        with TitledBox(
            f"A rehearsal with {clean(self._participant)}", "← → purpose · ↑ ↓ condition · enter continue · esc cancel"
        ):
            yield from self.row("purpose", self.purpose)
            yield Static(PURPOSES[self.purpose.value], id="meaning", markup=False)
            yield self.list

    def on_mount(self) -> None:
        rows = [ListRow(name, ((f" {self._shown.described(name)}", "plain"),)) for name in self._names]
        if not self._shown.hidden or not rows:
            text = " their own condition" if rows else " this study has no conditions"
            rows.insert(0, ListRow(THEIRS, ((text, "plain"),)))
        self.list.styles.height = min(len(rows), max(3, self.app.size.height - 10))
        self.list.show(rows)
        self.list.move_cursor(0, by_wizard=False)

    def on_key(self, event: events.Key) -> None:
        if event.key in ("left", "right"):
            self.purpose.on_key(event)
            self.query_one("#meaning", Static).update(PURPOSES[self.purpose.value])
        elif event.key == "enter":
            event.stop()
            chosen = self.list.current_id
            condition = "" if chosen == THEIRS else chosen
            self.dismiss(SessionRequest(self._participant, cast(Purpose, self.purpose.value), condition))


class WizardNameDialog(FormDialog[str]):
    """The result: the name; empty: the wizard left."""

    AUTO_FOCUS = "#name"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss('')", show=False),
        Binding("up", "app.focus_previous", show=False),
        Binding("down", "app.focus_next", show=False),
    ]

    def __init__(self, name: str, offered: Sequence[str] = ()) -> None:
        """`name`: the first text of the field. `offered`: the wizards that the study names."""
        super().__init__()
        self._offered = tuple(offered)
        self.field = TextField(name, id="name", placeholder="a short name, such as anna", select_on_focus=False)

    def compose(self) -> ComposeResult:
        lines = ["Every record of the sessions that you begin shows it."]
        if self._offered:
            lines.append("The study lists these wizards; exports use their aliases.")
        with TitledBox("Who are you?", "enter accept · esc cancel"):
            yield Static("\n".join(lines), id="lines", markup=False)
            if self._offered:
                yield from self.row("wizards", OpenChoice(self._offered, self.field.value, id="wizards"))
            yield from self.row("your name", self.field)
            yield Static("", id="answer", markup=False)

    @on(ChoiceField.Changed)
    def _take_offered(self) -> None:
        self.field.value = self.query_one(ChoiceField).value
        self.field.cursor_position = len(self.field.value)

    def on_key(self, event: events.Key) -> None:
        if event.key == "enter" and not self.field.has_focus:
            event.stop()
            event.prevent_default()
            self.set_focus(self.field)

    @on(Input.Submitted)
    def _take(self, event: Input.Submitted) -> None:
        event.stop()
        name = event.value.strip()
        if name:
            self.dismiss(name)
        else:
            self.say("enter a name: the record must say who acted")
