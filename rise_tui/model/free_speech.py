"""Free speech while it is typed: what was said before, how it may go on, and what will be said. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.kernel.view import SessionView
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import MissingValueError, TemplateError, parse_template
from rise_tui.model.notice import act_label

KEPT = 200
"""Sentences that the history keeps."""


def scenario_sentences(scenario: Scenario) -> tuple[str, ...]:
    """Everything that the scenario's acts say, as written but for markup, in file order, each once."""
    sentences = {
        plain_words(call.parameters["message"].text.strip()): None
        for act in scenario.acts.values()
        for action in act.actions
        for call in action.calls
        if call.type == "Speech" and "message" in call.parameters
    }
    return tuple(text for text in sentences if text)


class SpeechHistory:
    """What was said, newest last, and where in it the wizard is."""

    def __init__(self, said: Iterable[str] = ()) -> None:
        self.said: list[str] = []
        self._at = 0
        self._draft = ""
        for text in said:
            self.add(text)

    def add(self, text: str) -> None:
        """Something was said; the walk through the history ends."""
        if text in self.said:
            self.said.remove(text)
        self.said = [*self.said, text][-KEPT:]
        self._at = len(self.said)

    def earlier(self, shown: str) -> str:
        """The sentence before the one that is shown; what was typed is kept at the end."""
        if self._at == len(self.said):
            self._draft = shown
        self._at = max(0, self._at - 1)
        return self.said[self._at] if self.said else shown

    def later(self, shown: str) -> str:
        """The one after it; at the end what was typed."""
        if self._at == len(self.said):
            return shown
        self._at += 1
        return self.said[self._at] if self._at < len(self.said) else self._draft


def complete_speech(typed: str, said: Sequence[str], scenario: Sequence[str], keys: Iterable[str]) -> str:
    """How what is typed may go on, from its beginning; empty when nothing fits.

    `said` goes before the scenario's sentences, the newest first; after a `{` it is a memory key.
    """
    opened = typed.rfind("{")
    if opened > typed.rfind("}"):
        begun = opened + 1
        if typed[begun : begun + 1] == '"':  # a separator, and the key behind it
            begun = typed.find('"', begun + 1) + 1
        key = next((key for key in sorted(keys) if key.startswith(typed[begun:])), "") if begun else ""
        return f"{typed[:begun]}{key}}}" if key else ""
    if not typed.strip():
        return ""
    wanted = typed.casefold()
    for sentence in (*reversed(said), *scenario):
        if len(sentence) > len(typed) and sentence.casefold().startswith(wanted):
            return typed + sentence[len(typed) :]
    return ""


class FilledSpeech(NamedTuple):
    """What will be said, or why it cannot be."""

    text: str = ""
    problem: str = ""


def fill_speech(typed: str, memory: Mapping[str, Any]) -> FilledSpeech:
    """The text with the memory's present values."""
    try:
        return FilledSpeech(parse_template(typed.strip()).fill(memory).strip())
    except MissingValueError as missing:
        return FilledSpeech(
            problem=f"{missing.key} has no value in the memory; write {{{missing.key}|something}} or set it"
        )
    except TemplateError as error:
        return FilledSpeech(problem=str(error))


class SpeechEffect(NamedTuple):
    """What becomes of a sentence that is said now; both are empty when it is simply said."""

    queued: str = ""
    """In its turn: `waits for R_Welcome`, or the filler that gives way to it."""
    at_once: str = ""
    """Without waiting: `interrupts R_Welcome`."""


def speech_effect(scenario: Scenario, view: SessionView) -> SpeechEffect:
    """By the scheduler's rules (semantics.md 3.1)."""
    speech = scenario.robot.actions.get("Speech")
    channels = frozenset(speech.channels) if speech is not None else frozenset()
    in_turn, beside = [], []
    for task in (view.tasks[id] for id in view.running):
        act = scenario.acts.get(task.behavior) if task.function != "say" else None
        if task.calling_type != "None":
            in_turn.append(act_label(task.function, task.behavior))
        elif act is not None and act.channels & channels:
            beside.append(act_label(task.function, task.behavior))
    waiting = (view.tasks[id] for id in view.waiting)
    before = [
        *in_turn,
        *(act_label(task.function, task.behavior) for task in waiting if task.calling_type != "None"),
    ]
    stopped = f"interrupts {_names_text([*in_turn, *beside])}" if in_turn or beside else ""
    return SpeechEffect(f"waits for {_names_text(before)}" if before else stopped, stopped)


def _names_text(names: Sequence[str]) -> str:
    """One name, or the first and how many more."""
    if not names:
        return ""
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
