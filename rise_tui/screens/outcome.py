"""The end of a session: a word to type before it ends permanently, and its outcome in a study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple, cast

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Input, Static

from rise_engine.study.model import OutcomeStatus
from rise_tui.model.status import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.rendering.modal import TitledBox
from rise_tui.screens.dialog import FormDialog
from rise_tui.widgets.choice_field import ChoiceField, OpenChoice
from rise_tui.widgets.prompt_bar import TextField

CONFIRMING_WORD = "end"
"""The word to type before Enter. No key of a study can end a session by accident."""
TYPE_WORD = f"Type {CONFIRMING_WORD} and press enter:"
NOT_THE_WORD = f"that is not the word {CONFIRMING_WORD}: the session goes on"


class EndSessionDialog(FormDialog[bool]):
    """The result: whether to end the session. Esc leaves it and does nothing."""

    AUTO_FOCUS = "#word"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(False)", show=False)]

    def __init__(self, title: str, lines: Sequence[str]) -> None:
        super().__init__()
        self._title, self._lines = title, lines

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, "esc cancel") as box:
            box.add_class("-ends")
            yield Static("\n".join(self._lines), id="lines", markup=False)
            yield from self.row(TYPE_WORD, TextField(id="word", select_on_focus=False), id="typing")
            yield Static("", id="answer", markup=False)

    @on(Input.Submitted)
    def _check_word(self, event: Input.Submitted) -> None:
        event.stop()
        if event.value.strip().casefold() == CONFIRMING_WORD:
            self.dismiss(True)
        else:
            self.say(NOT_THE_WORD)


def end_session_dialog(store: Store, then: str = "") -> EndSessionDialog:
    """The question before the session ends permanently. `then`: what comes after it; empty: nothing."""
    participant = participant_text(store)
    lines = [session_title(store), *running_lines(store), ""]
    lines += ["What runs is stopped, and the session ends permanently.", "It cannot be continued."]
    lines += [then] * bool(then)
    return EndSessionDialog(f"End the session of {participant}?" if participant else "End the session?", lines)


OUTCOMES: tuple[OutcomeStatus, ...] = ("complete", "aborted", "excluded")
MEANINGS: dict[str, str] = {
    "": "← → choose the outcome.",
    "complete": "The run counts.",
    "aborted": "Does not count; the participant keeps the slot and may repeat.",
    "excluded": "The participant does not count; the slot goes to the next one.",
}
CHOOSE = "choose the outcome: complete, aborted or excluded (← →)"
NEEDS_REASON: tuple[OutcomeStatus, ...] = ("aborted", "excluded")


class Outcome(NamedTuple):
    """The answer."""

    status: OutcomeStatus
    reason: str


class OutcomeDialog(FormDialog[Outcome | None]):
    """Asks for the outcome. Nothing is chosen first. Esc leaves, and nothing has happened."""

    AUTO_FOCUS = "#outcome"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss(None)", show=False),
        Binding("up", "app.focus_previous", show=False),
        Binding("down,tab", "app.focus_next", show=False),
    ]

    DEFAULT_CSS = """
    OutcomeDialog {
        #box { width: 78; }
        #typing { margin: 1 0 0 0; }
    }
    """

    def __init__(self, title: str, lines: Sequence[str], *, ends: bool, corrects: bool = False) -> None:
        """`ends`: whether this ends a session, which always needs the typed word. `corrects`: whether there is an
        earlier outcome, so that each choice needs a reason."""
        super().__init__()
        self._title, self._lines, self._ends = title, lines, ends
        self._need_reason = OUTCOMES if corrects else NEEDS_REASON
        self.choice = OpenChoice(OUTCOMES, "", id="outcome")
        hint = "why it changes" if corrects else "required if aborted or excluded"
        self.reason = TextField(id="reason", placeholder=hint, select_on_focus=False)
        self.word = TextField(id="word", select_on_focus=False)

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, "← → choose · ↑ ↓ enter: next field · esc cancel") as box:
            box.set_class(self._ends, "-ends")
            yield Static("\n".join(self._lines), id="lines", markup=False)
            yield from self.row("outcome", self.choice)
            yield Static(MEANINGS[""], id="meaning", markup=False)
            yield from self.row("reason", self.reason)
            if self._ends:
                yield from self.row(TYPE_WORD, self.word, id="typing")
            yield Static("", id="answer", markup=False)

    @on(ChoiceField.Changed)
    def _show_meaning(self) -> None:
        self.query_one("#meaning", Static).update(MEANINGS[self.choice.value])
        self.say("")

    def on_key(self, event: events.Key) -> None:
        if event.key == "enter" and self.choice.has_focus:
            event.stop()
            event.prevent_default()
            if self.choice.value:
                self.set_focus(self.reason)
            else:
                self.say(CHOOSE)

    @on(Input.Submitted, "#reason")
    def _reason_given(self, event: Input.Submitted) -> None:
        event.stop()
        if problem := self._problem():
            self.say(problem)
        elif self._ends:
            self.set_focus(self.word)
        else:
            self._finish()

    @on(Input.Submitted, "#word")
    def _check_word(self, event: Input.Submitted) -> None:
        event.stop()
        if problem := self._problem():
            self.say(problem)
        elif event.value.strip().casefold() == CONFIRMING_WORD:
            self._finish()
        else:
            self.say(NOT_THE_WORD)

    def _problem(self) -> str:
        """What is still missing; the cursor goes there."""
        if not self.choice.value:
            self.set_focus(self.choice)
            return CHOOSE
        if self.choice.value in self._need_reason and not self.reason.value.strip():
            self.set_focus(self.reason)
            return f"{self.choice.value} needs a reason, for the record"
        return ""

    def _finish(self) -> None:
        self.dismiss(Outcome(cast(OutcomeStatus, self.choice.value), self.reason.value.strip()))
