"""A field of a form with a few words to choose from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.content import Content
from textual.message import Message
from textual.widgets import Button

from rise_tui.rendering.text import cell_width, clean, shorten

CHOICE_ROOM = 62
"""Cells for the choices in the narrowest terminal."""


class ChoiceField(Horizontal, can_focus=True):
    """One of a few words, and one stop for the Tab key. Left and right choose, and so does a click; Enter chooses
    nothing.

    If not all words fit side by side, only the chosen one is shown, with its number and the total.
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
    """A choice with nothing chosen first. The first key chooses the first word."""

    def on_key(self, event: events.Key) -> None:
        if self.value not in self._words and event.key in ("left", "right"):
            event.stop()
            event.prevent_default()  # else the base class would move to the next word
            self._choose(self._words[0])
