"""Free speech while it is typed: the history, likely endings, and the text that will be said. Pure."""

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
    """Everything that the scenario's acts say, as written but without markup, in file order, each text once."""
    sentences = {
        plain_words(call.parameters["message"].text.strip()): None
        for act in scenario.acts.values()
        for action in act.actions
        for call in action.calls
        if call.type == "Speech" and "message" in call.parameters
    }
    return tuple(text for text in sentences if text)


class SpeechHistory:
    """The said sentences, newest last, and the wizard's position among them."""

    def __init__(self, said: Iterable[str] = ()) -> None:
        self.said: list[str] = []
        self._at = 0
        self._draft = ""
        for text in said:
            self.add(text)

    def add(self, text: str) -> None:
        """Add a said sentence and leave the history."""
        if text in self.said:
            self.said.remove(text)
        self.said = [*self.said, text][-KEPT:]
        self._at = len(self.said)

    def earlier(self, shown: str) -> str:
        """The sentence before the shown one. What was typed stays at the end."""
        if self._at == len(self.said):
            self._draft = shown
        self._at = max(0, self._at - 1)
        return self.said[self._at] if self.said else shown

    def later(self, shown: str) -> str:
        """The sentence after the shown one; at the end, what was typed."""
        if self._at == len(self.said):
            return shown
        self._at += 1
        return self.said[self._at] if self._at < len(self.said) else self._draft


def complete_speech(typed: str, said: Sequence[str], scenario: Sequence[str], keys: Iterable[str]) -> str:
    """A likely completion of the typed text, from its beginning; empty if nothing fits.

    `said` comes before the scenario's sentences, the newest first. After a `{` the completion is a memory key.
    """
    opened = typed.rfind("{")
    if opened > typed.rfind("}"):
        begun = opened + 1
        if typed[begun : begun + 1] == '"':  # a separator, then the key
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
    """The text that will be said, or why it cannot be."""

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
    """What happens when a sentence is said now; both are empty if it is simply said."""

    queued: str = ""
    """Its wait: `waits for R_Welcome`, or the filler that gives way to it."""
    at_once: str = ""
    """What it does immediately: `interrupts R_Welcome`."""


def speech_effect(scenario: Scenario, view: SessionView) -> SpeechEffect:
    """Apply the scheduler's rules (semantics.md 3.1)."""
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
    """One name, or the first and the number of others."""
    if not names:
        return ""
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
