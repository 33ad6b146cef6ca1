"""The base of all dialogs: a question before a permanent change, also about several items; and a form."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, runtime_checkable

from textual import events, on
from textual.app import App, ComposeResult
from textual.await_complete import AwaitComplete
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen, Screen, ScreenResultType
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Button, Label, Static

from rise_tui.model.control import HELD_KEY_SECONDS
from rise_tui.model.resumption import (
    ACTS,
    BACK,
    GO_ON,
    KEEP,
    OPTIONS,
    STOP,
    BackStep,
    InterruptedRule,
    resumption_lines,
    step_behavior,
    step_lines,
)

MIN_HEIGHT = 12
"""Rows that an overlay gets, even if rows that should stay in view are covered."""


@runtime_checkable
class KeepsRows(Protocol):
    """A screen whose first rows stay in view above overlays."""

    @property
    def kept_rows(self) -> int: ...


class SingleDismissModal(ModalScreen[ScreenResultType], Generic[ScreenResultType]):
    """A modal screen below the rows of a console that always stay in view: alarms, the robot's speech and what is next.

    A second `dismiss` has no effect. Textual's own removes the top screen. A second key before the screen has gone
    would remove the console below.
    """

    DEFAULT_CSS = "SingleDismissModal { background: transparent; }"
    COVERS: ClassVar[bool] = True
    """Whether it covers the screen below, with a box below these rows. False: it shows something on that screen."""

    def on_mount(self) -> None:
        self.place_box()

    def on_resize(self) -> None:
        self.place_box()

    def place_box(self) -> None:
        """Put the box below the kept rows."""
        kept = self._kept_rows()
        for box in self.query("#box") if self.COVERS else ():
            box.styles.margin = (kept, 0, 0, 0)
            box.styles.max_height = self.app.size.height - kept

    def _kept_rows(self) -> int:
        """The rows that stay in view, while there is room for this screen below them."""
        below = next((each for each in reversed(self.app.screen_stack) if not isinstance(each, ModalScreen)), None)
        kept = below.kept_rows if isinstance(below, KeepsRows) else 0
        return min(kept, max(0, self.app.size.height - MIN_HEIGHT))

    def dismiss(self, result: ScreenResultType | None = None) -> AwaitComplete:
        return super().dismiss(result) if self.is_active else AwaitComplete.nothing()  # type: ignore[no-untyped-call]


def shows_screen_below(screen: Screen[Any]) -> bool:
    """Whether a screen shows something on the one below, such as the tour."""
    return isinstance(screen, SingleDismissModal) and not screen.COVERS


def place_overlays(app: App[Any]) -> None:
    """Put the boxes of all overlays below the kept rows, which have changed."""
    for screen in app.screen_stack:
        if isinstance(screen, SingleDismissModal):
            screen.place_box()


class TitledBox(Vertical):
    """Contains the widgets composed inside it. Its dialog sets its size (`#box`)."""

    DEFAULT_CSS = """
    TitledBox {
        height: auto; max-width: 96%; padding: 0 1; background: $panel;
        border: round $primary; border-title-style: bold;
    }
    """

    def __init__(self, title: str, keys: str = "") -> None:
        """`keys`: the effects of the keys, in a few words; empty: buttons show them."""
        super().__init__(id="box")
        self.border_title = f" {title} "
        self.border_subtitle = f" {keys} " if keys else None


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
        """Show the missing parts, below the fields."""
        self.query_one("#answer", Static).update(sentence)


class Dialog(SingleDismissModal[str]):
    """Asks a question. The result is the key of the chosen answer, empty for none."""

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
        """`default`: the key of the answer for Enter; without it, Enter chooses none.

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
        """Take the first answer. Later keys have no effect."""
        if not self._withdrawn:
            self.dismiss(key)

    def withdraw(self) -> bool:
        """Close without an answer, at the latest when nothing covers it. False: this was already requested."""
        if self._withdrawn:
            return False
        self._withdrawn = True
        self.on_screen_resume()
        return True

    def on_screen_resume(self) -> None:
        if self._withdrawn:
            self.dismiss("")  # works only when it is on top

    @on(Button.Pressed)
    def _pressed(self, event: Button.Pressed) -> None:
        event.stop()
        self.action_answer(event.button.name or "")


def _id(key: str) -> str:
    return f"answer-{key.replace('+', '-')}"


LINES_AROUND = 12
"""Rows of the terminal for the dialog besides its lines and choices."""


class Choice(NamedTuple):
    """One item to choose for."""

    name: str
    options: Sequence[str]
    """The possible choices; the first is the default."""


class ChoicesDialog(Dialog):
    """A dialog in which up and down select an item, left and right choose for it, and other keys choose for all."""

    DEFAULT_CSS = """
    ChoicesDialog {
        #box { max-height: 95%; }
        #lines { margin: 0; }
        #choices { height: auto; margin: 1 0; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "select(-1)", show=False),
        Binding("down", "select(1)", show=False),
        Binding("left", "change(-1)", show=False),
        Binding("right", "change(1)", show=False),
    ]

    def __init__(
        self,
        title: str,
        lines: Sequence[str],
        choices: Sequence[Choice],
        all_keys: Mapping[str, str],
        *answers: DialogChoice,
        hint: str,
        no: str,
        repeat_keys: Sequence[str] = (),
    ) -> None:
        """`all_keys`: for each key, the option that it chooses for every item that has this option."""
        super().__init__(title, lines, *answers, no=no, repeat_keys=repeat_keys)
        self._choices, self._all_keys, self._hint = choices, all_keys, hint
        self.selected = 0
        self.chosen = {choice.name: choice.options[0] for choice in choices}

    @abstractmethod
    def choice_lines(self, width: int, rows: int) -> list[str]:
        """The items with their chosen options, in at most `rows` rows of `width` cells."""

    def compose(self) -> ComposeResult:
        with TitledBox(self._title):
            yield Static("\n".join(self._lines), id="lines", markup=False)
            yield Static("", id="choices", markup=False)
            with Horizontal(id="buttons"):
                yield from self.buttons()

    def on_mount(self) -> None:
        super().on_mount()
        self.call_after_refresh(self._show_choices)

    def on_resize(self) -> None:
        self.call_after_refresh(self._show_choices)

    def on_key(self, event: events.Key) -> None:
        if (option := self._all_keys.get(event.key)) is not None:
            event.stop()
            for choice in self._choices:
                if option in choice.options:
                    self.chosen[choice.name] = option
            self._show_choices()  # other keys: Textual calls `Dialog.on_key`, too

    def action_select(self, step: int) -> None:
        self.selected = min(max(self.selected + step, 0), len(self._choices) - 1)
        self._show_choices()

    def action_change(self, step: int) -> None:
        if self._choices:
            choice = self._choices[self.selected]
            now = choice.options.index(self.chosen[choice.name])
            self.chosen[choice.name] = choice.options[(now + step) % len(choice.options)]
            self._show_choices()

    def _show_choices(self) -> None:
        shown = self.query_one("#choices", Static)
        rows = max(2, self.app.size.height - LINES_AROUND - len(self._lines))
        shown.update("\n".join([*self.choice_lines(max(20, shown.size.width), rows), self._hint]))


def first_shown(selected: int, count: int, most: int) -> int:
    """The first of `count` items to show, so that the selected one is in the middle of `most`."""
    return max(0, min(selected - most // 2, count - most))


ALL_KEYS = {"e": "enter", "w": "wait", "l": "leave"}
RELEASE_HINT = "all: e re-enter, w wait there, l leave   one: ↑ ↓, ← →"


class ReleaseDialog(ChoicesDialog):
    """Asks once for all rules. Each stays stopped unless the wizard chooses otherwise."""

    def __init__(self, lines: Sequence[str], rules: Sequence[InterruptedRule], repeat_keys: Sequence[str]) -> None:
        super().__init__(
            "Release the stop?",
            lines,
            [Choice(rule.name, OPTIONS) for rule in rules],
            ALL_KEYS,
            DialogChoice("r", "Release"),
            hint=RELEASE_HINT,
            no="Stay stopped",
            repeat_keys=repeat_keys,
        )
        self._rules = rules

    def choice_lines(self, width: int, rows: int) -> list[str]:
        return resumption_lines(self._rules, self.chosen, self.selected, width, rows)


STEP_HINT = "all keys: t take back, k keep   one: ↑ ↓, ← →"
NOTHING = "no memory key has changed since"


class StepBackDialog(ChoicesDialog):
    """Asks about a step back. By default memory keys are taken back, and acts continue."""

    def __init__(self, lines: Sequence[str], step: BackStep) -> None:
        choices = [Choice(key, (BACK, KEEP)) for key in step.keys]
        choices += [Choice(ACTS, (GO_ON, STOP))] if step.acts else []
        super().__init__(
            "One step back?",
            lines,
            choices,
            {"t": BACK, "k": KEEP},
            DialogChoice("b", "Back"),
            DialogChoice("w", "Back, waiting"),
            hint=STEP_HINT if choices else NOTHING,
            no="Stay",
        )
        self._step = step

    def behavior(self, answer: str) -> str:
        """The behaviour of the task that makes the step, with the present choices."""
        return step_behavior(self._step, self.chosen, enter=answer == "b")

    def choice_lines(self, width: int, rows: int) -> list[str]:
        first = first_shown(self.selected, len(self.chosen), rows)
        return step_lines(self._step, self.chosen, self.selected, first, width, rows)
