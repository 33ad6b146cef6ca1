"""The robot's speech, word for word: the present text, its remainder, and unspoken texts. Pure.

It uses only the engine's records. A sent sentence is not yet spoken. If the robot did not confirm its end, the sentence
may or may not have been spoken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from rise_engine.kernel.records import ENDINGS, ActionRecord
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Action, ActionCall, Scenario
from rise_engine.scenario.parameters import MESSAGE, SPEECH_CHANNEL
from rise_engine.scenario.speech.ssml import BEGINNING, begins_as_ssml, plain_words
from rise_engine.scenario.speech.template import (
    MemorySlot,
    MissingValueError,
    Template,
    TemplateError,
    parse_template,
    spoken_text,
)
from rise_tui.model.notice import act_label


def message_name(scenario: Scenario, action: str) -> str:
    """The parameter of a robot's action with the text: `message`, else the first text; empty: none."""
    spec = scenario.robot.actions.get(action)
    if spec is None or SPEECH_CHANNEL not in spec.channels:
        return ""
    texts = [name for name, parameter in spec.parameters.items() if parameter.type == "text"]
    return MESSAGE if MESSAGE in texts else next(iter(texts), "")


def message_of(scenario: Scenario, call: ActionCall) -> Template | None:
    """The text of a call, as written; None: no speech."""
    return call.parameters.get(message_name(scenario, call.type))


def words_of(scenario: Scenario, action: ActionView) -> str | None:
    """The text of an action: as sent, or as written if the action was skipped; None: no speech."""
    name = message_name(scenario, action.type)
    return plain_words(spoken_text(action.parameters[name]).strip()) if name and name in action.parameters else None


def estimate_action_seconds(scenario: Scenario, action: ActionView) -> float | None:
    """Estimated seconds with the sent parameters; None: the robot does not have the action."""
    spec = scenario.robot.actions.get(action.type)
    return expected_seconds(spec, action.parameters) if spec is not None else None


MAX_SEARCHED_TASKS = 2_000
"""Number of tasks that are searched for the latest sentence when a console attaches."""
UNKNOWN = frozenset({"timed-out", "lost"})
"""Endings after which the robot's actions are unknown."""

Kind = Literal["nothing", "sent", "says", "said", "unsaid", "unknown"]
"""`unsaid`: not spoken, or not to its end. `unknown`: the robot has not confirmed how it ended."""


class CurrentSentence(NamedTuple):
    """The sentence that matters now."""

    kind: Kind
    text: str = ""
    seconds: float | None = None
    """`says`: seconds left, negative if it is overdue, None: unknown. `said`: seconds since its end. `unsaid`: seconds
    until it was interrupted."""
    share: float = 0.0
    """`says`: the share that is probably over, 0 to 1."""
    replaced_by: str = ""
    """The robot's substitute for speaking, if it cannot speak."""
    others: int = 0
    """`unsaid`: other unspoken sentences of the same act. `says`: others at the same time."""


class SentenceTracker:
    """Follows the robot's sentences. A sentence is an action of a task with speech."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._ended_last: tuple[int, str] | None = None
        """Task and action of the sentence that ended last, in any way."""
        self._durations: dict[str, tuple[float, int]] = {}
        """By sentence: this robot's mean seconds for it, and how many times it was spoken."""
        self._expected = self._measured = 0.0
        """Total seconds of all finished sentences: as estimated, and as measured."""

    def rebuild(self, view: SessionView) -> None:
        """Restart from a session's speech so far."""
        self._ended_last = None
        self._durations.clear()
        self._expected = self._measured = 0.0
        latest = float("-inf")
        for task in list(view.tasks.values())[-MAX_SEARCHED_TASKS:]:
            for action in self._sentences_of(task):
                if action.ended is None:
                    continue
                if action.status == "succeeded":
                    self._measure(action)
                if action.ended > latest or (action.ended == latest and action.status == "succeeded"):
                    latest, self._ended_last = action.ended, (task.id, action.action)

    def record_action(self, record: ActionRecord, view: SessionView) -> None:
        """Process a record of an action, after the view has."""
        task = view.tasks.get(record.task)
        action = task.actions.get(record.action) if task is not None else None
        if record.status not in ENDINGS or action is None or words_of(self._scenario, action) is None:
            return
        self._ended_last = record.task, record.action
        if record.status == "succeeded":
            self._measure(action)

    def current(self, view: SessionView, at: float) -> CurrentSentence:
        """The sentence to show at this session time."""
        running = [
            action for id in view.running for action in self._sentences_of(view.tasks[id]) if action.ended is None
        ]
        if running:
            action = max(running, key=lambda each: (each.status == "accepted", each.since))
            elapsed, usual = max(0.0, at - _spoken_since(action)), self.usual_seconds(action)
            left = None if usual is None else usual - elapsed
            share = min(1.0, elapsed / usual) if usual else 0.0
            kind: Kind = "says" if action.status == "accepted" else "sent"
            return CurrentSentence(kind, self._words_of(action), left, share, action.sent_as or "", len(running) - 1)
        task = view.tasks.get(self._ended_last[0]) if self._ended_last is not None else None
        if task is None or self._ended_last is None:
            return CurrentSentence("nothing")
        ended = task.actions[self._ended_last[1]]
        if ended.status == "succeeded":
            return CurrentSentence("said", self._words_of(ended), at - (ended.ended if ended.ended is not None else at))
        unsaid = [action for action in self._sentences_of(task) if action.status != "succeeded"]
        first = unsaid[0]
        after = first.ended - _spoken_since(first) if first.status != "skipped" and first.ended is not None else None
        ending: Kind = "unknown" if first.status in UNKNOWN else "unsaid"
        return CurrentSentence(ending, self._words_of(first), after, others=len(unsaid) - 1)

    def usual_seconds(self, action: ActionView) -> float | None:
        """Seconds that a sentence takes: as before, or the estimate at this robot's pace; None: unknown."""
        if (known := self._durations.get(self._words_of(action))) is not None:
            return known[0]
        estimate = estimate_action_seconds(self._scenario, action)
        pace = self._measured / self._expected if self._expected > 0 else 1.0
        return estimate * pace if estimate is not None else None

    def _sentences_of(self, task: TaskView) -> Iterator[ActionView]:
        """The sentences of a task that have begun, ended, or been skipped, in that order."""
        return (action for action in task.actions.values() if words_of(self._scenario, action) is not None)

    def _words_of(self, action: ActionView) -> str:
        return words_of(self._scenario, action) or ""

    def _measure(self, action: ActionView) -> None:
        if action.ended is None:
            return
        took = action.ended - _spoken_since(action)
        mean, times = self._durations.get(self._words_of(action), (0.0, 0))
        self._durations[self._words_of(action)] = mean + (took - mean) / (times + 1), times + 1
        if (estimate := estimate_action_seconds(self._scenario, action)) is not None:
            self._expected += estimate
            self._measured += took


def _spoken_since(action: ActionView) -> float:
    """Since when a sentence has been spoken: since the robot's confirmation, if that came before the end."""
    confirmed = action.confirmed
    return action.since if confirmed is None or confirmed == action.ended else confirmed


def remaining_sentences(scenario: Scenario, view: SessionView, memory: Mapping[str, Any]) -> list[str]:
    """The sentences that the running acts have not begun, with present values, in the order of the file."""
    tasks = [view.tasks[id] for id in view.running]
    return [
        text
        for task in tasks
        if task.function != "say" and task.behavior in scenario.acts
        for action in scenario.acts[task.behavior].actions
        if action.id not in task.actions and (text := " / ".join(action_texts(scenario, action, memory)))
    ]


def longest_sentence(scenario: Scenario, memory: Mapping[str, Any]) -> str:
    """The longest sentence of all acts, with these values."""
    texts = (text for name in scenario.acts for text in act_texts(scenario, name, memory))
    return max(texts, key=len, default="")


def act_texts(scenario: Scenario, name: str, memory: Mapping[str, Any]) -> list[str]:
    """Everything that an act may say, in the order of its actions, with the memory's present values."""
    return [text for action in scenario.acts[name].actions for text in action_texts(scenario, action, memory)]


def action_texts(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> list[str]:
    """The wordings of a sentence, of which chance picks one, with the memory's present values.

    A slot without a value stays as written. No wordings: the action has no speech.
    """
    messages = (message_of(scenario, call) for call in action.calls)
    return [_fill_known(message, memory) for message in messages if message is not None]


def _fill_known(template: Template, memory: Mapping[str, Any]) -> str:
    lead = BEGINNING + ">" if begins_as_ssml(template.text) else ""

    def fill(part: str | MemorySlot) -> str:
        try:
            return Template("", (lead, part)).fill(memory).removeprefix(lead)
        except (MissingValueError, OverflowError, RecursionError):
            return f"{{{part.key}}}" if isinstance(part, MemorySlot) else part

    return plain_words("".join(map(fill, template.parts)).strip())


KEPT = 200
"""Maximum number of sentences in the history."""


def scenario_sentences(scenario: Scenario) -> tuple[str, ...]:
    """All texts of the scenario's acts, as written but without markup, in file order, each once."""
    sentences = {
        plain_words(call.parameters["message"].text.strip()): None
        for act in scenario.acts.values()
        for action in act.actions
        for call in action.calls
        if call.type == "Speech" and "message" in call.parameters
    }
    return tuple(text for text in sentences if text)


class SpeechHistory:
    """The spoken sentences, newest last, and the wizard's position among them."""

    def __init__(self, sentences: Iterable[str] = ()) -> None:
        self.sentences: list[str] = []
        self._at = 0
        self._draft = ""
        for text in sentences:
            self.add(text)

    def add(self, text: str) -> None:
        """Add a spoken sentence and leave the history."""
        if text in self.sentences:
            self.sentences.remove(text)
        self.sentences = [*self.sentences, text][-KEPT:]
        self._at = len(self.sentences)

    def earlier(self, shown: str) -> str:
        """The sentence before the shown one. The typed text stays at the end."""
        if self._at == len(self.sentences):
            self._draft = shown
        self._at = max(0, self._at - 1)
        return self.sentences[self._at] if self.sentences else shown

    def later(self, shown: str) -> str:
        """The sentence after the shown one; at the end, the typed text."""
        if self._at == len(self.sentences):
            return shown
        self._at += 1
        return self.sentences[self._at] if self._at < len(self.sentences) else self._draft


def complete_speech(typed: str, history: Sequence[str], scenario: Sequence[str], keys: Iterable[str]) -> str:
    """Return a likely completion of the typed text, from its beginning; empty: nothing fits.

    `history` comes before the scenario's sentences, the newest first. After a `{` the completion is a memory key.
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
    for sentence in (*reversed(history), *scenario):
        if len(sentence) > len(typed) and sentence.casefold().startswith(wanted):
            return typed + sentence[len(typed) :]
    return ""


class FilledSpeech(NamedTuple):
    """The text to be spoken, or why it cannot be."""

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
    """The effect of speaking a sentence now; both are empty if it is simply spoken."""

    queued: str = ""
    """Its wait: `waits for R_Welcome`, or the filler that gives way to it."""
    at_once: str = ""
    """Its immediate effect: `interrupts R_Welcome`."""


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
