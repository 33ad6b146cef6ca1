"""The base of all dialogs: a question before something that cannot be undone, and a form. Esc leaves both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, Generic, NamedTuple

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.screen import ScreenResultType
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Button, Label, Static

from rise_tui.model.key_action import HELD_KEY_SECONDS
from rise_tui.rendering.modal import SingleDismissModal, TitledBox


class DialogChoice(NamedTuple):
    """A possible answer."""

    key: str
    title: str


class FormDialog(SingleDismissModal[ScreenResultType], Generic[ScreenResultType]):
    """Fields in rows, with lines above them and a sentence below. Each subclass decides the result of Esc."""

    DEFAULT_CSS = """
    FormDialog {
        align: center middle; background: transparent;
        #box { width: 70; max-height: 95%; border-title-color: $foreground; }
        #box.-ends { border: round $error; }
        #lines { height: auto; margin: 0 0 1 0; }
        .row { height: 1; }
        Label { width: 12; color: $rise-muted; }
        #meaning { height: 1; padding: 0 0 0 12; color: $rise-muted; }
        #typing Label { width: auto; padding: 0 1 0 0; color: $foreground; }
        TextField, TextField:focus { width: 1fr; background: $surface; }
        TextField:focus { background: $rise-cursor; }
        #answer { height: 1; color: $warning; }
    }
    """

    def row(self, label: str, field: Widget, id: str | None = None) -> ComposeResult:
        """A field after its label."""
        with Horizontal(classes="row", id=id):
            yield Label(label)
            yield field

    def say(self, sentence: str) -> None:
        """Show what is missing, below the fields."""
        self.query_one("#answer", Static).update(sentence)


class Dialog(SingleDismissModal[str]):
    """Asks a question; the result is the key of the chosen answer, empty for none."""

    DEFAULT_CSS = """
    Dialog {
        align: center middle; background: transparent;
        #box { width: 64; max-height: 80%; border-title-color: $foreground; }
        #lines { height: auto; margin: 0 0 1 0; }
        #buttons { height: 1; align-horizontal: right; }
        Button { margin: 0 0 0 2; min-width: 12; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "answer('')", show=False),
        Binding("left,up", "app.focus_previous", show=False),
        Binding("right,down", "app.focus_next", show=False),
    ]

    def __init__(
        self,
        title: str,
        lines: Sequence[str],
        *answers: DialogChoice,
        no: str = "Cancel",
        default: str = "",
        repeat_keys: Sequence[str] = (),
    ) -> None:
        """`default`: the key of the answer that Enter chooses; without it, Enter chooses none.

        `repeat_keys`: the keys that opened the question. Pressed again, they give the first answer. A held key that
        repeats is not a second press.
        """
        super().__init__()
        self._repeat_keys, self._repeated_at = repeat_keys, float("-inf")
        self._second_press: Timer | None = None
        self._title, self._lines, self._answers, self._no, self._default = title, lines, answers, no, default
        self._withdrawn = False

    def compose(self) -> ComposeResult:
        with TitledBox(self._title):
            yield Static("\n".join(self._lines), id="lines", markup=False)
            with Horizontal(id="buttons"):
                yield from self.buttons()

    def buttons(self) -> Iterator[Button]:
        """One button for no answer, and one for each answer."""
        yield Button(f"{self._no} (esc)", id="no", compact=True)
        for answer in self._answers:
            yield Button(f"{answer.title} ({answer.key})", id=_id(answer.key), name=answer.key, compact=True)

    def on_mount(self) -> None:
        if self._default:
            self.set_focus(self.query_one(f"#{_id(self._default)}"))

    def on_key(self, event: events.Key) -> None:
        if any(event.key == answer.key for answer in self._answers):
            event.stop()
            self.action_answer(event.key)
        elif event.key in self._repeat_keys:
            event.stop()
            self._repeat_pressed(event.time)

    def _repeat_pressed(self, at: float) -> None:
        """Wait as long as a held key needs to repeat, as for acts that need two presses."""
        is_held, self._repeated_at = at - self._repeated_at < HELD_KEY_SECONDS, at
        if self._second_press is not None:
            self._second_press.stop()
        self._second_press = None if is_held else self.set_timer(HELD_KEY_SECONDS, self._choose_first)

    def _choose_first(self) -> None:
        self.action_answer(self._answers[0].key)

    def action_answer(self, key: str) -> None:
        """Take the first answer. Later keys do nothing."""
        if not self._withdrawn:
            self.dismiss(key)

    def withdraw(self) -> bool:
        """Close without an answer, at the latest when nothing covers it. False if this was already requested."""
        if self._withdrawn:
            return False
        self._withdrawn = True
        self.on_screen_resume()
        return True

    def on_screen_resume(self) -> None:
        if self._withdrawn:
            self.dismiss("")  # works only once it is on top

    @on(Button.Pressed)
    def _pressed(self, event: Button.Pressed) -> None:
        event.stop()
        self.action_answer(event.button.name or "")


def _id(key: str) -> str:
    return f"answer-{key.replace('+', '-')}"
