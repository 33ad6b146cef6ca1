"""The question before a session ends for good: it names whose it is and what runs, and wants a word, not a key."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Input, Label, Static

from rise_tui.model.session_summary import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.widgets.memory_editor import TextField
from rise_tui.widgets.titled_box import TitledBox

CONFIRMING_WORD = "end"
"""No key of any study ends a session, however it was meant: this is typed, and then Enter is pressed."""


class EndSessionDialog(SingleDismissModal[bool]):
    """Answers whether the session is to end; Esc leaves it and does nothing."""

    AUTO_FOCUS = "#word"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(False)", show=False)]

    DEFAULT_CSS = """
    EndSessionDialog {
        align: center middle; background: transparent;
        #box { width: 68; max-height: 90%; border: round $error; border-title-color: $foreground; }
        #lines { height: auto; margin: 0 0 1 0; }
        #typing { height: 1; }
        #typing Label { width: auto; padding: 0 1 0 0; }
        TextField, TextField:focus { width: 1fr; background: $rise-cursor; }
        #answer { height: 1; color: $warning; }
    }
    """

    def __init__(self, title: str, lines: Sequence[str]) -> None:
        super().__init__()
        self._title, self._lines = title, lines

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, "esc cancel"):
            yield Static("\n".join(self._lines), id="lines", markup=False)
            with Horizontal(id="typing"):
                yield Label(f"Type {CONFIRMING_WORD} and press enter:")
                yield TextField(id="word", select_on_focus=False)
            yield Static("", id="answer", markup=False)

    @on(Input.Submitted)
    def _check_word(self, event: Input.Submitted) -> None:
        event.stop()
        if event.value.strip().casefold() == CONFIRMING_WORD:
            self.dismiss(True)
        else:
            self.query_one("#answer", Static).update(f"that is not the word {CONFIRMING_WORD}: the session goes on")


def end_session_dialog(store: Store, then: str = "") -> EndSessionDialog:
    """Before the session ends for good. `then`: what comes after it, if not nothing."""
    participant = participant_text(store)
    lines = [session_title(store), *running_lines(store), ""]
    lines += ["The robot stops, and the session ends permanently.", "It cannot be continued."]
    lines += [then] * bool(then)
    return EndSessionDialog(f"End the session of {participant}?" if participant else "End the session?", lines)
