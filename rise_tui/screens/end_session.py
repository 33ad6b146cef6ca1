"""The question before a session ends for good: it names whose it is and what runs, and wants a word, not a key."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Label, Static

from rise_tui.model.session_summary import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.widgets.memory_editor import TextField

CONFIRMING_WORD = "end"
"""No key of any study ends a session, however it was meant: this is typed, and then Enter is pressed."""


class EndSessionDialog(SingleDismissModal[bool]):
    """Answers whether the session is to end; Esc leaves it and does nothing."""

    AUTO_FOCUS = "#word"

    DEFAULT_CSS = """
    EndSessionDialog {
        align: center middle; background: transparent;
        #box { width: 68; max-width: 96%; height: auto; max-height: 90%; padding: 0 1; background: $panel;
               border: round $error; border-title-color: $foreground; border-title-style: bold; }
        #said { height: auto; margin: 0 0 1 0; }
        #typing { height: 1; }
        #typing Label { width: auto; padding: 0 1 0 0; }
        TextField, TextField:focus { width: 1fr; background: $rise-cursor; }
        #answer { height: 1; color: $warning; }
    }
    """

    def __init__(self, title: str, said: Sequence[str]) -> None:
        super().__init__()
        self._title, self._said = title, said

    def compose(self) -> ComposeResult:
        box = Vertical(id="box")
        box.border_title = f" {self._title} "
        box.border_subtitle = " esc leaves, and nothing changes "
        with box:
            yield Static("\n".join(self._said), id="said", markup=False)
            with Horizontal(id="typing"):
                yield Label(f"Type {CONFIRMING_WORD} and press enter:")
                yield TextField(id="word", select_on_focus=False)
            yield Static("", id="answer", markup=False)

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        event.stop()
        if event.value.strip().casefold() == CONFIRMING_WORD:
            self.dismiss(True)
        else:
            self.query_one("#answer", Static).update(f"that is not the word {CONFIRMING_WORD}: nothing has ended")

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            self.dismiss(False)


def end_session_dialog(store: Store, then: str = "") -> EndSessionDialog:
    """Before the session ends for good. `then`: what comes after it, if not nothing."""
    of = participant_text(store)
    said = [session_title(store), *running_lines(store), ""]
    said += ["The robot is stopped, and the session ends for good:", "it cannot be continued."]
    said += [then] * bool(then)
    return EndSessionDialog(f"End the session of {of}?" if of else "End the session?", said)
