"""Who sits at the console: asked once, before somebody's first session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Input, Label, Static

from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.screens.outcome import OpenChoice
from rise_tui.screens.settings import ChoiceField
from rise_tui.widgets.memory_editor import TextField
from rise_tui.widgets.titled_box import TitledBox


class WizardNameDialog(SingleDismissModal[str]):
    """Answers with the name; empty: it was left."""

    AUTO_FOCUS = "#name"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss('')", show=False),
        Binding("up", "app.focus_previous", show=False),
        Binding("down", "app.focus_next", show=False),
    ]

    DEFAULT_CSS = """
    WizardNameDialog {
        align: center middle; background: transparent;
        #box { width: 70; border-title-color: $foreground; }
        #lines { height: auto; margin: 0 0 1 0; }
        .row { height: 1; }
        Label { width: 12; color: $rise-muted; }
        TextField, TextField:focus { width: 1fr; background: $surface; }
        TextField:focus { background: $rise-cursor; }
        #answer { height: 1; color: $warning; }
    }
    """

    def __init__(self, name: str, offered: Sequence[str] = ()) -> None:
        """`name`: what stands there to begin with. `offered`: the wizards that the study names."""
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
                with Horizontal(classes="row"):
                    yield Label("wizards")
                    yield OpenChoice(self._offered, self.field.value, id="wizards")
            with Horizontal(classes="row"):
                yield Label("your name")
                yield self.field
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
            self.query_one("#answer", Static).update("enter a name: the record must say who acted")
