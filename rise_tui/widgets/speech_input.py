"""The say line, always one row. When it is open, it is a field with the final text above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.message import Message
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.actions import BY_ID
from rise_tui.key_labels import key_name, why_unavailable
from rise_tui.model.speech import (
    SpeechEffect,
    SpeechHistory,
    complete_speech,
    fill_speech,
    scenario_sentences,
    speech_effect,
)
from rise_tui.model.states import SENT, StateLabel, task_state
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, crop, format_seconds, quoted
from rise_tui.widgets.fields import EndingSuggester, TextField
from rise_tui.widgets.lines import StaticLines

DONE_SECONDS = 5.0
"""Seconds for which the line shows that something was spoken."""
PROMPT = " say > "
SPOKEN = StateLabel("✓", "said", "plain")


class SpeechField(TextField):
    """The field for speech. A likely completion is shown after the text in grey; `tab` accepts it."""

    DEFAULT_CSS = """
    SpeechField, SpeechField:focus { height: 1; width: 1fr; border: none; padding: 0 1 0 0; background: $rise-cursor; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "complete", show=False),
        Binding("up", "earlier", show=False),
        Binding("down", "later", show=False),
        Binding("ctrl+j", "interrupt", show=False),
        Binding("escape", "leave", show=False),
    ]

    def __init__(self, line: SpeechInput) -> None:
        super().__init__(select_on_focus=False, suggester=EndingSuggester(line.ending))
        self._line = line

    def action_complete(self) -> None:
        if completion := self._line.suggest(self.value):
            self.replace_text(completion)

    def action_earlier(self) -> None:
        self.replace_text(self._line.history.earlier(self.value))

    def action_later(self) -> None:
        self.replace_text(self._line.history.later(self.value))

    def action_interrupt(self) -> None:
        self._line.submit(at_once=True)

    def action_leave(self) -> None:
        self._line.postpone()

    @on(Input.Submitted)
    def _input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self._line.submit(at_once=False)

    def replace_text(self, text: str) -> None:
        """Show this text, with the cursor at its end."""
        self.value = text
        self.cursor_position = len(text)


class SpeechInput(Vertical):
    """Free speech: typed here, shown in its final form, sent, and followed to its end."""

    DEFAULT_CSS = """
    SpeechInput {
        height: auto;
        #say-preview, #say-typing { display: none; }
        #say-typing { height: 1; }
        #say-prompt { width: 7; }
        &.-open #say-preview, &.-open #say-typing { display: block; }
        &.-open #say-shown { display: none; }
    }
    """

    @dataclass
    class Speak(Message):
        """Speak this: `typed` is the text in the field, `text` has the memory's values filled in."""

        typed: str
        text: str
        at_once: bool

    @dataclass
    class ReturnFocus(Message):
        """Typing has ended. `back` had the focus before."""

        back: Widget | None

    def __init__(self, store: Store) -> None:
        super().__init__(id="say")
        self._store = store
        self._sentences = scenario_sentences(store.scenario)
        self.history = SpeechHistory(task.behavior for task in store.view.tasks.values() if task.function == "say")
        self.preview, self.prompt, self.shown = (
            StaticLines(id="say-preview"),
            StaticLines(id="say-prompt"),
            StaticLines(id="say-shown"),
        )
        self.field = SpeechField(self)
        self._back: Widget | None = None

    def compose(self) -> ComposeResult:
        yield self.preview
        with Horizontal(id="say-typing"):
            yield self.prompt
            yield self.field
        yield self.shown

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    @property
    def effect(self) -> SpeechEffect:
        """The effect of speaking now."""
        return speech_effect(self._store.scenario, self._store.view)

    def suggest(self, typed: str) -> str:
        """A likely completion of the typed text."""
        return complete_speech(typed, self.history.sentences, self._sentences, self._store.view.memory)

    def ending(self, typed: str) -> str:
        """The rest of that completion."""
        return self.suggest(typed)[len(typed) :]

    def open(self) -> None:
        if not self.is_open:
            self._back = self.screen.focused
            self.field.select_all()  # what is typed now replaces the words that were kept
            self.add_class("-open")
        self.screen.set_focus(self.field)
        self.draw()

    def accept(self, typed: str) -> None:
        """Add the sent text to the history and free the field."""
        self.history.add(typed)
        if self.field.value == typed:
            self.field.value = ""
        self.postpone()

    def restore(self, typed: str) -> None:
        """Restore a text that was not accepted, unless something else was begun."""
        if not self.field.value:
            self.field.replace_text(typed)
        self.draw()

    def draw(self) -> None:
        """Draw the text to be spoken, or the state of the last one."""
        width = self.size.width
        if self.is_open:
            self.prompt.show(((PROMPT, "accent"),))
            self.preview.show(crop(self._preview_line(), width))
        else:
            self.shown.show(crop(((PROMPT, "muted"), *self._status_line()), width))

    def _preview_line(self) -> StyledLine:
        if not self.field.value.strip():
            return (("  will say  ", "muted"), ("nothing yet; {key} is filled from the memory", "muted"))
        text, problem = fill_speech(self.field.value, self._store.memory)
        if problem:
            return ((" ✗ cannot be said: ", "wait"), (problem, "wait"))
        return (("  will say  ", "muted"), (quoted(text), "strong"))

    def _status_line(self) -> StyledLine:
        """The line's text: sent, waiting, running or just spoken; otherwise the draft, or how to begin."""
        store = self._store
        sent = next((sent for sent in reversed(store.sent.values()) if sent.function == "say"), None)
        if sent is not None:
            return _state_line(SENT, "", sent.behavior)
        task = store.view.tasks.get(store.newest_speech)
        if task is not None and (task.ended is None or store.now() - task.ended < DONE_SECONDS):
            state = SPOKEN if task.status == "SUCCEEDED" else task_state(task)
            running = task.status == "ACTIVE" and task.started is not None
            return _state_line(
                state, f" {format_seconds(store.now() - (task.started or 0.0))} s" if running else "", task.behavior
            )
        if self.field.value.strip():
            return ((self.field.value, "plain"), (f"   not said; {key_name('say')} shows it again", "muted"))
        why_not = why_unavailable(BY_ID["say"], store)
        return ((why_not or f"{key_name('say')} to type what the robot says", "muted"),)

    def postpone(self) -> None:
        """Close the line and keep its text for later."""
        if self.is_open:
            self.remove_class("-open")
            self.draw()
            self.post_message(self.ReturnFocus(self._back))

    @on(Input.Changed)
    def _input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self.draw()

    def submit(self, *, at_once: bool) -> None:
        """Say the text, in its turn or immediately."""
        text, problem = fill_speech(self.field.value, self._store.memory)
        if text and not problem:
            self.post_message(self.Speak(self.field.value, text, at_once))

    def on_click(self, event: events.Click) -> None:
        if event.widget is self.shown and not why_unavailable(BY_ID["say"], self._store):
            self.open()


def _state_line(state: StateLabel, more: str, text: str) -> StyledLine:
    return ((f"{state.glyph} {state.word}{more}  ", state.role), (quoted(text), "plain"))
