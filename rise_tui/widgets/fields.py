"""Fields to type in (a line, a bar below a pane, a remark) and to choose from (the kind of mistake, words)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, cast

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.content import Content
from textual.message import Message
from textual.suggester import Suggester
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Button, Input

from rise_tui.model.failures import markable_name, mistake_marks
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, cell_width, clean, crop, fit, line_width, shorten
from rise_tui.requests import ConsoleHost
from rise_tui.widgets.lines import StaticLines, StoreLines


class TextField(Input):
    """A text field of one bare row."""

    DEFAULT_CSS = "TextField, TextField:focus { height: 1; border: none; padding: 0; background: $panel; }"
    BINDINGS: ClassVar[list[BindingType]] = [Binding("tab", "app.focus_next", show=False)]
    """Tab goes to the next field; elsewhere on the console it goes to the next pane."""

    def validate_value(self, value: str) -> str:
        """Remove control characters, which would reach the terminal unchanged."""
        return clean(value)


class EndingSuggester(Suggester):
    """Shows a likely ending in grey after the typed text."""

    def __init__(self, ending: Callable[[str], str]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._ending = ending

    async def get_suggestion(self, value: str) -> str | None:
        ending = self._ending(value)
        return value + ending if ending else None


class PromptBar(Horizontal):
    """A bar, hidden and empty until it is opened. Every pane has one. Messages report Esc and Enter to its opener."""

    DEFAULT_CSS = """
    PromptBar {
        height: 1; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
        StaticLines { background: $panel; }
    }
    """

    @dataclass
    class PromptMessage(Message):
        """An event in a bar."""

        bar: PromptBar

    class Edited(PromptMessage):
        """The text has changed."""

    class Accepted(PromptMessage):
        """The wizard pressed Enter."""

    class Cancelled(PromptMessage):
        """The wizard pressed Esc."""

    def __init__(self, label: str, placeholder: str) -> None:
        super().__init__()
        self._label = StaticLines()
        self._label.styles.width = len(label)
        self._label.show(((label, "key"),))
        self.field = TextField(placeholder=placeholder, select_on_focus=False)

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    @property
    def text(self) -> str:
        return self.field.value

    def open(self, text: str = "") -> None:
        if not self.field.is_attached:
            self.mount(self._label, self.field)
        self.add_class("-open")
        with self.prevent(Input.Changed):
            self.field.value = text
        self.field.cursor_position = len(text)
        self.screen.set_focus(self.field)

    def close(self) -> None:
        self.remove_class("-open")

    @on(Input.Changed)
    def _input_changed(self, event: Input.Changed) -> None:
        event.stop()
        if self.is_open:
            self.post_message(self.Edited(self))

    @on(Input.Submitted)
    def _input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.post_message(self.Accepted(self))

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self.post_message(self.Cancelled(self))


class NoteLine(TextField):
    """Replaces the notice while it is open. A text that was not accepted returns the next time."""

    DEFAULT_CSS = """
    NoteLine, NoteLine:focus {
        height: 1; border: none; padding: 0 1; background: $rise-cursor; display: none;
        &.-open { display: block; }
    }
    """

    @dataclass
    class SaveNote(Message):
        """The line was closed. `text` is empty if there is nothing to note."""

        text: str
        back: Widget | None
        """The widget that had the focus before."""

    def __init__(self) -> None:
        super().__init__(placeholder="note for the record; enter adds it, esc cancels", select_on_focus=False)
        self._back: Widget | None = None

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def open(self, text: str) -> None:
        """Open the line with the text that was not accepted last time."""
        if not self.is_open:
            self._back = self.screen.focused
            self.value = text
            self.select_all()
            self.add_class("-open")
        self.screen.set_focus(self)

    @on(Input.Submitted)
    def _input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self._close(self.value.strip())

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self._close("")

    def _close(self, text: str) -> None:
        self.remove_class("-open")
        self.post_message(self.SaveNote(text, self._back))


CHOICE_ROOM = 62
"""Cells for the choices in the narrowest terminal."""


class ChoiceField(Horizontal, can_focus=True):
    """One of a few words, and one stop for the Tab key. Left and right choose, and so does a click; Enter chooses
    nothing.

    If the words do not fit side by side, only the chosen one is shown, with its number and the total.
    """

    DEFAULT_CSS = """
    ChoiceField {
        height: 1; width: 1fr;
        Button { min-width: 5; margin: 0 1 0 0; background: $surface; color: $rise-muted; }
        Button.-chosen { background: $rise-cursor; color: $foreground; text-style: bold; }
        &:focus Button.-chosen { text-style: bold reverse; }
    }
    """

    class Changed(Message):
        """The wizard chose another word."""

    def __init__(self, words: Sequence[str], chosen: str, *, id: str, labels: Mapping[str, str] | None = None) -> None:
        """
        :param words: the choices.
        :param chosen: one of them.
        :param id: the widget's.
        :param labels: by word, the shown text if it differs from the word.
        """
        super().__init__(id=id)
        self._words = tuple(words)
        self._labels = dict(labels or {})
        self.value = chosen

    def compose(self) -> ComposeResult:
        for word in [self.value] if self._is_long else self._words:
            chosen = "-chosen" if word == self.value else ""
            button = Button(Content(self._label(word)), compact=True, classes=chosen, name=word)
            button.can_focus = False
            yield button

    @property
    def _is_long(self) -> bool:
        return sum(cell_width(self._text(word)) + 5 for word in self._words) > CHOICE_ROOM

    def _text(self, word: str) -> str:
        return clean(self._labels.get(word, word))

    def _label(self, word: str) -> str:
        if self._is_long:
            at = self._words.index(word) + 1 if word in self._words else 0
            return f"‹ {shorten(self._text(word), CHOICE_ROOM - 16)} ›  {at} of {len(self._words)}"
        return f"{'●' if word == self.value else '○'} {self._text(word)}"

    def set_words(self, words: Sequence[str], chosen: str, labels: Mapping[str, str] | None = None) -> None:
        """Replace the words."""
        if (tuple(words), chosen, dict(labels or {})) != (self._words, self.value, self._labels):
            self._words, self.value, self._labels = tuple(words), chosen, dict(labels or {})
            self.refresh(recompose=True)
            self.post_message(self.Changed())

    @on(Button.Pressed)
    def _pressed(self, event: Button.Pressed) -> None:
        event.stop()
        self.focus()
        if self._is_long:  # the first follows the last: a mouse has no other way back
            at = self._words.index(self.value) + 1 if self.value in self._words else 0
            self._choose(self._words[at % len(self._words)])
        else:
            self._choose(event.button.name or "")

    def on_key(self, event: events.Key) -> None:
        if event.key not in ("left", "right"):
            return
        event.stop()
        at = self._words.index(self.value) if self.value in self._words else 0
        at += 1 if event.key == "right" else -1
        if 0 <= at < len(self._words):
            self._choose(self._words[at])

    def _choose(self, word: str) -> None:
        self.value = word
        for button in self.query(Button):
            shown = word if self._is_long else button.name or ""
            button.label = Content(self._label(shown))
            button.set_class(shown == word, "-chosen")
        self.post_message(self.Changed())


class OpenChoice(ChoiceField):
    """A choice with nothing chosen at first. The first key chooses the first word."""

    def on_key(self, event: events.Key) -> None:
        if self.value not in self._words and event.key in ("left", "right"):
            event.stop()
            event.prevent_default()  # otherwise the base class would move to the next word
            self._choose(self._words[0])


WIDE = 100
"""Cells from which the choices have space between them. Below this the name of the action needs the room."""
OPEN_SECONDS = 4.0
"""Seconds that the line waits for a letter."""


class MistakeLine(StoreLines, can_focus=True):
    """Replaces the notice. A foreign key closes it and has its usual effect."""

    DEFAULT_CSS = """
    MistakeLine { background: $rise-cursor; display: none; }
    MistakeLine.-open { display: block; }
    """

    @dataclass
    class EndMarking(Message):
        """The line was closed. The focus returns to its former place."""

        back: Widget | None
        """The widget that had the focus before."""

    def __init__(self, store: Store) -> None:
        super().__init__(store, id="mistake")
        self._marks = mistake_marks(store.scenario)
        self.marked = 0
        """The task in question."""
        self._back: Widget | None = None
        self._timer: Timer | None = None

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def takes(self, key: str) -> bool:
        """Whether the open line takes this key."""
        return self.is_open and (key == "escape" or any(choice.key == key for choice in self._marks))

    def open(self, task: int) -> None:
        """Ask about this task, which is being marked as wrong."""
        if not self.is_open:
            self._back = self.screen.focused
            self.add_class("-open")
        self.marked = task
        self.screen.set_focus(self)
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.set_timer(OPEN_SECONDS, self.close)

    def close(self) -> None:
        """Close the line and return the focus."""
        if self._timer is not None:
            self._timer.stop()
            self._timer = None
        if self.is_open:
            self.remove_class("-open")
            self.post_message(self.EndMarking(self._back))

    def draw(self) -> None:
        store = self.store
        task = store.view.tasks.get(self.marked)
        if task is None or not self.is_open:
            return
        width = self.size.width
        sent = store.is_sent(("markMistake",), f"{task.id} wrong")
        what = f"↑ sent: {task.mark or 'wrong'}" if sent else f"! marked {task.mark}" if task.mark else "· not marked"
        choices: list[StyledSpan] = []
        gap = "  " if width >= WIDE else " "
        for choice in self._marks:
            choices += [(f"{gap}{choice.key}", "key"), (f" {choice.word}", "plain")]
        choices += [(f"{gap}esc", "key"), (" ", "plain")]
        head: StyledLine = ((f" {what} ", "wait"),)
        room = width - line_width(head) - line_width(choices)
        name = clean(markable_name(task, store.key_of(task.function, task.behavior)))
        self.show(crop((*head, (fit(name, min(len(name), max(6, room))), "strong"), *choices), width))

    def on_key(self, event: events.Key) -> None:
        """Handle the line's own letters before anything else can."""
        choice = next((choice for choice in self._marks if choice.key == event.key), None)
        if choice is None and event.key != "escape":
            return
        event.stop()
        event.prevent_default()
        if choice is not None and choice.mark != "wrong":  # it is already marked as wrong
            cast(ConsoleHost, self.screen).send("markMistake", f"{self.marked} {choice.mark}")
        self.close()

    def on_blur(self) -> None:
        self.close()
