"""The forms about a session: a word before it ends, its outcome, the choice of a rehearsal, and the wizard's name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple, cast

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Input, Static

from rise_engine.study.model import OutcomeStatus, Purpose
from rise_tui.config.launch import SessionRequest
from rise_tui.model.status import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.model.study_rows import Conditions
from rise_tui.rendering.text import ListRow, clean
from rise_tui.screens.dialog import FormDialog, TitledBox
from rise_tui.widgets.fields import ChoiceField, OpenChoice, TextField
from rise_tui.widgets.lines import RowList

CONFIRMING_WORD = "end"
"""The word to type before Enter. No key of a study can end a session by accident."""
TYPE_WORD = f"Type {CONFIRMING_WORD} and press enter:"
WRONG_WORD = f"that is not the word {CONFIRMING_WORD}: the session goes on"


class EndSessionDialog(FormDialog[bool]):
    """The result: whether to end the session. Esc leaves without effect."""

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
            self.say(WRONG_WORD)


def end_session_dialog(store: Store, then: str = "") -> EndSessionDialog:
    """The question before the session ends permanently. `then`: the next step; empty: none."""
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
    """Asks for the outcome. Nothing is chosen at first. Esc leaves without effect."""

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
            self.say(WRONG_WORD)

    def _problem(self) -> str:
        """The missing part, to which the cursor goes."""
        if not self.choice.value:
            self.set_focus(self.choice)
            return CHOOSE
        if self.choice.value in self._need_reason and not self.reason.value.strip():
            self.set_focus(self.reason)
            return f"{self.choice.value} needs a reason, for the record"
        return ""

    def _finish(self) -> None:
        self.dismiss(Outcome(cast(OutcomeStatus, self.choice.value), self.reason.value.strip()))


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
