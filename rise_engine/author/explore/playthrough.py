"""Plays a scenario on the engine in virtual time: a simulated person presses the keys that the rules wait for.

It proves nothing: of several possibilities, it takes the one taken least so far. But its results have really happened,
down to the actions: a missing value makes the robot fail as in a session.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from msgspec import Struct

from rise_engine.author.explore.moves import external_topics
from rise_engine.author.trial.trial import SOURCE, Trial
from rise_engine.author.trial.trial_state import key_choices, running_rules
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.records import ActionRecord, TaskRecord
from rise_engine.scenario.model import CUE_TOPICS, Scenario, SourceLocation

MAX_SESSIONS = 12
"""Maximum number of plays from the start; each has another seed and takes the transitions least taken so far."""
MAX_UNPRODUCTIVE = 3
"""Number of consecutive sessions without a new act after which it stops."""
MAX_STEPS = 300
"""Maximum number of steps in a session: actions of a person, and waits for an event."""


class PlayedFailure(Struct, frozen=True):
    """An action, or an assignment of a rule, that failed although the simulated robot injected no faults."""

    what: str
    """The beginning of a sentence: `R_Ask failed at action 1`."""
    reason: str
    location: SourceLocation
    by_hand: bool = False
    """Whether the act was started by its own key, which no person needs to press at that moment."""

    @property
    def sentence(self) -> str:
        return f"{self.what} when it was played: {self.reason}"


class PlayedThrough(Struct, frozen=True):
    """The results of a playthrough."""

    acts: frozenset[str]
    """The acts that have begun."""
    failures: tuple[PlayedFailure, ...]
    """Each failure once."""
    ended: bool
    """Whether the rule that ends the study ended in one of the sessions."""
    is_complete: bool
    """Whether it was played until nothing new happened, or the maximum number of times."""


def play_through(
    scenario: Scenario, started: SessionStarted, end: str, go_on: Callable[[], bool] = lambda: True
) -> PlayedThrough:
    """Play a scenario until nothing new happens.

    :param scenario: a checked scenario; the simulated robot plays it in any mode.
    :param started: the beginning of each session.
    :param end: the rule that ends the study; empty: there is none.
    :param go_on: is called before each step; if it returns false, the results so far are returned.
    """
    player = _Player(scenario, started, end, go_on)
    in_vain, is_complete = 0, True
    for seed in range(1, MAX_SESSIONS + 1):
        known = len(player.acts)
        player.play(seed)
        in_vain = 0 if len(player.acts) > known else in_vain + 1
        is_complete = go_on()
        if not is_complete or in_vain >= MAX_UNPRODUCTIVE:
            break
    return PlayedThrough(frozenset(player.acts), tuple(player.failures.values()), player.ended, is_complete)


class _Player:
    def __init__(self, scenario: Scenario, started: SessionStarted, end: str, go_on: Callable[[], bool]) -> None:
        self._scenario = scenario
        self._started = started
        self._end = end
        self._go_on = go_on
        self._outside = set(external_topics(scenario))
        self._done: Counter[tuple[object, ...]] = Counter()
        """How often each action was taken in each combination of states."""
        self._pressed: set[str] = set()
        """The pressed keys: a key that starts an act is pressed once."""
        self.acts: set[str] = set()
        self.failures: dict[tuple[str, ...], PlayedFailure] = {}
        self.ended = False

    def play(self, seed: int) -> None:
        """Play one session from its start to the study's end, or until nothing moves."""
        trial = Trial(self._scenario, seed=seed, started=self._started)
        self._begin(trial)
        was_running = False
        for _ in range(MAX_STEPS):
            rules = trial.view.running_rules()
            if was_running and self._end not in rules:
                self.ended = True
                break
            was_running = was_running or self._end in rules
            if not self._go_on() or not self._do_next(trial):
                break
        self._note(trial)

    def _begin(self, trial: Trial) -> None:
        starts = [key for key in self._scenario.keys.values() if key.function == "startInteractionRule"]
        if starts:
            trial.press(starts[0])
        elif self._end:
            trial.start_rule(self._end)

    def _do_next(self, trial: Trial) -> bool:
        """Take the action taken least in the present states; return whether there was any."""
        view = trial.view
        states = tuple((name, view.rules[name].state) for name in view.running_rules())
        choices = dict(self._choices(trial))
        if not choices:
            return False
        name = min(choices, key=lambda choice: self._done[states, choice])
        self._done[states, name] += 1
        choices[name]()
        self._pressed.add(name.removeprefix("key "))
        return not trial.problem

    def _choices(self, trial: Trial) -> Iterator[tuple[str, Callable[[], object]]]:
        for choice in key_choices(trial):
            key = choice.key
            is_by_hand = key.function == "startCommunicationRobotAct" and key.key not in self._pressed
            if choice.is_awaited or (is_by_hand and not trial.is_busy):
                yield f"key {key.key}", lambda key=key: trial.press(key)  # type: ignore[misc]
        topics = {transition.event for rule in running_rules(trial) for transition in rule.transitions}
        if CUE_TOPICS[0] in topics:
            yield "cue", trial.mark_cue
        for topic in sorted(topics & self._outside):
            yield f"event {topic}", lambda topic=topic: trial.raise_event(topic)  # type: ignore[misc]
        for task in trial.view.questions:
            yield f"answer {task}", lambda task=task: trial.submit(_go_on_without(task))  # type: ignore[misc]
        if trial.next_at is not None:
            yield "time", trial.go_on

    def _note(self, trial: Trial) -> None:
        by_hand: set[int] = set()
        for record in trial.records:
            if isinstance(record, TaskRecord):
                self._note_assignment(record)
                if record.function == "startCommunicationRobotAct" and record.status == "ACTIVE":
                    self.acts.add(record.behavior)
                    by_hand |= {record.id} if record.source == SOURCE else set()
            elif isinstance(record, ActionRecord) and record.status == "failed" and record.act in self._scenario.acts:
                key = (record.act, record.action, record.reason)
                actions = self._scenario.acts[record.act].actions
                place = next(action.location for action in actions if action.id == record.action)
                what = f"{record.act} failed at action {record.action}"
                failure = PlayedFailure(what, record.reason, place, record.task in by_hand)
                self.failures.setdefault(key, failure)

    def _note_assignment(self, record: TaskRecord) -> None:
        """Note an assignment of a rule that failed, after which the rule's later functions did not run."""
        kind, _, name = record.source.partition(":")
        if kind != "rule" or record.function != "assignValue" or record.status != "ABORTED":
            return
        same = (each for each in self._scenario.rules[name].functions if each.behavior == record.behavior)
        place = next((each.location for each in same), self._scenario.rules[name].location)
        failure = PlayedFailure(f"the assignment `{record.behavior}` of {name} failed", record.reason, place)
        self.failures.setdefault((name, record.behavior), failure)


def _go_on_without(task: int) -> Submit:
    return Submit(function="goOn", behavior=str(task), source=SOURCE)
