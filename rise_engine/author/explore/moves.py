"""The bounds of exploring, and the possible next moves in a situation: by people, from outside, and spontaneous."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, TypeAlias

from msgspec import Struct, field

from rise_engine.author.explore.act_traits import ActTraits, Pace
from rise_engine.author.explore.influence import parts_of_session_read
from rise_engine.author.explore.situation import PERSON, Situation
from rise_engine.kernel.act_runner import CANCEL_LIMIT
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, StopReport, Submit, TimerElapsed
from rise_engine.scenario.model import CUE_TOPICS, Scenario, normal_topic


class Bounds(Struct, frozen=True):
    """The limits of exploring."""

    keys: Literal["rules", "all"] = "rules"
    """all: also the keys that start acts by hand."""
    line: int = 1
    """Maximum number of waiting acts; one more is not explored."""
    beside: int = 2
    """Maximum number of acts that run beside others at once."""
    asked: int = 1
    """Maximum number of failed acts that wait for an answer at once."""
    kept: int = 1
    """Maximum number of kept events for rules that will wait for them."""
    faults: int = 1
    """Maximum number of faults on one path: an act fails, the robot is lost, everything is stopped."""
    stop: bool = True
    """Whether everything can be stopped at any moment."""
    lost: bool = True
    """Whether the robot can be lost at any moment, and whether it or another program can end acts."""
    pace: Pace | None = (0.5, 3.0)
    """The minimum and maximum duration of acts as multiples of the expected one; None: any time."""
    tries: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    """Values that memory keys may get from outside."""
    situations: int = 1_000_000
    """Maximum number of situations."""
    values: int = 15
    """Maximum number of values followed for each memory key."""
    merges_alike: bool = True
    """Whether only the first of several interchangeable acts that no rule mentions is started."""
    follows_voice: bool = False
    """Whether speech within an act matters, because something reads `session.speaking`."""


MoveKind: TypeAlias = Literal[
    "key",  # name: the key
    "event",  # name: the topic; from outside
    "try",  # name: the memory key; place: which of its values
    "cue",  # how: marked or undone
    "stop",
    "release",  # how: enter or leave, for all rules
    "answer",  # name: the failed act; place: among those asked about; how: goOn, repeatAct or stopRuleOfAct
    "end",  # name: the act; place: among those that run; how: succeeded, failed, aborted, canceled, or accepted
    "timer",  # name: its owner; place: among those that run; how: its purpose
    "stopped",  # the robot confirms that everything has stopped
    "lost",
    "back",
]
BY_PERSON: frozenset[MoveKind] = frozenset({"key", "event", "try", "cue", "release", "answer"})
"""Moves of people or programs outside, which may or may not come."""
MISHAPS: frozenset[MoveKind] = frozenset({"stop", "lost"})
"""Unplanned moves."""


class Move(NamedTuple):
    """One possible next step."""

    kind: MoveKind
    name: str = ""
    place: int = 0
    """Its index, if there are several."""
    how: str = ""
    chance: tuple[int, ...] = ()
    """Its random choices: for each decision, the chosen possibility."""

    @property
    def is_mishap(self) -> bool:
        """Whether it is a stop, a lost robot, or a failed act."""
        return self.kind in MISHAPS or (self.kind == "end" and self.how in ("failed", "aborted"))

    @property
    def is_spontaneous(self) -> bool:
        """Whether it comes without a person's action and without a failure."""
        return self.kind in ("end", "timer", "stopped") and not self.is_mishap


class Possibility(NamedTuple):
    """A move, its input for the kernel, and its possible times."""

    move: Move
    input: AnyInput
    clock: int = 0
    """The clock that limits its time, from 1: those of acts, then those of countdowns; 0: none."""
    least: int = 0
    """The minimum and maximum of the clock then, in ms."""
    most: int = 0
    lengthens_line: bool = False
    """Whether it starts an act that must wait while another one waits."""


class Moves:
    """The moves of a scenario."""

    def __init__(self, scenario: Scenario, traits: dict[str, ActTraits], bounds: Bounds) -> None:
        self._traits = traits
        self._bounds = bounds
        self.alike = acts_alike(scenario, traits) if bounds.keys == "all" and bounds.merges_alike else {}
        """For each act that a key starts and no rule mentions: the first act that is interchangeable with it."""
        self.keys = {
            name: key
            for name, key in scenario.keys.items()
            if key.function != "startCommunicationRobotAct"
            or (bounds.keys == "all" and self.alike.get(key.behavior, key.behavior) == key.behavior)
        }
        """The keys that are pressed."""
        raised = {normal_topic(key.behavior) for key in self.keys.values() if key.function == "raiseEventTopic"}
        self.external = sorted(external_topics(scenario) - raised)
        """Events that only other programs can raise."""
        self._always = [
            *(
                Possibility(
                    Move("key", name),
                    _submit(key.function, key.task_behavior),
                    lengthens_line=key.function == "startCommunicationRobotAct"
                    and scenario.settings_of(key.behavior).calling_type == "Blocking",
                )
                for name, key in self.keys.items()
            ),
            *(Possibility(Move("event", topic), _submit("raiseEventTopic", topic)) for topic in self.external),
            *(
                Possibility(Move("try", key, index), _submit("assignValue", json.dumps({key: value})))
                for key, values in bounds.tries.items()
                for index, value in enumerate(values)
            ),
        ]
        self._has_cue = cue_matters(scenario)
        policies = {name: scenario.failure_policy(name).kind for name in scenario.acts} if bounds.lost else {}
        self._repeated = {name for name, policy in policies.items() if policy == "repeat"}
        """The acts for which it matters who has ended them."""

    def possible(self, situation: Situation) -> Iterator[Possibility]:
        """Yield the possible next moves, people's first. The clocks decide which of them time allows."""
        yield from self._always
        if self._has_cue:
            yield _CUE
            if situation.cue_open:
                yield _CUE_UNDONE
        for index, act in enumerate(situation.asked):
            if act.phase == "pausing":
                continue  # no answer is needed, because it is repeated automatically
            for answer in ("goOn", "repeatAct", "stopRuleOfAct"):
                if answer != "stopRuleOfAct" or act.is_own:
                    yield Possibility(
                        Move("answer", act.name, index, answer), _submit(answer, _asked_id(situation, index))
                    )
        yield from self._act_moves(situation)
        yield from self._countdown_moves(situation)
        yield from self._mishap_moves(situation)

    def limits(self, situation: Situation) -> list[int]:
        """Return the maximum of each clock, in ms."""
        acts = [
            self._traits[act.name].most if act.phase in ("running", "doomed") else _CANCEL_LIMIT
            for act in situation.running
        ]
        return acts + [countdown.length for countdown in situation.countdowns]

    def _act_moves(self, situation: Situation) -> Iterator[Possibility]:
        foreign, own = (
            1,
            1 + len(situation.waiting) + len(situation.running) + len(situation.asked) + len(situation.rules),
        )
        for act in situation.waiting:
            own, foreign = (own + 1, foreign) if act.is_own else (own, foreign + 1)
        for index, act in enumerate(situation.running):
            task = own if act.is_own else foreign
            own, foreign = (own + 1, foreign) if act.is_own else (own, foreign + 1)
            clock, traits = index + 1, self._traits[act.name]
            if act.phase in ("running", "doomed"):
                yield _end(task, act.name, index, "succeeded", clock, traits.least, traits.most)
                may_fail = act.phase == "doomed" or situation.robot_lost
                if traits.can_fail and (may_fail or situation.faults_left):
                    yield _end(task, act.name, index, "failed", clock, 0, traits.most)
                may_abort = situation.faults_left and not situation.robot_lost
                if traits.can_fail and may_abort and act.name in self._repeated:
                    yield _end(task, act.name, index, "aborted", clock, 0, traits.most)
            else:
                yield _end(task, act.name, index, "canceled", clock, 0, _CANCEL_LIMIT)
            if (
                self._bounds.follows_voice
                and traits.changes_voice
                and (act.phase in ("running", "doomed") or act.speaking)
            ):
                yield _end(task, act.name, index, "accepted", clock, 0, _FOREVER)

    def _countdown_moves(self, situation: Situation) -> Iterator[Possibility]:
        first = 1 + len(situation.running)
        for index, countdown in enumerate(situation.countdowns):
            if self._bounds.pace is None and any(
                before.length <= countdown.length for before in situation.countdowns[:index]
            ):
                continue  # that one elapses first: it was set no later and is no longer
            length = countdown.length
            move = Move("timer", countdown.owner, index, countdown.purpose)
            yield Possibility(move, TimerElapsed(t=1.0, timer=index + 1), first + index, length, length)

    def _mishap_moves(self, situation: Situation) -> Iterator[Possibility]:
        bounds = self._bounds
        if situation.stop == "requested":
            yield _STOPPED
        elif situation.stop == "latched":
            yield _LEAVE
            if situation.stopped_rules:
                chosen = {rule[0]: "enter" for rule in situation.stopped_rules}
                yield Possibility(Move("release", how="enter"), _submit("releaseStop", json.dumps(chosen)))
        elif bounds.stop and situation.faults_left:
            yield _STOP
        if situation.robot_lost:
            yield _BACK
        elif bounds.lost and situation.faults_left:
            yield _LOST


_CANCEL_LIMIT = int(1000 * CANCEL_LIMIT)
_FOREVER = 10**9


def cue_matters(scenario: Scenario) -> bool:
    """Return whether the end of the participant's turn makes a difference."""
    waits = bool(scenario.topics.intersection(CUE_TOPICS))
    return waits or scenario.fillers.auto_after is not None or "cue" in parts_of_session_read(scenario)


def acts_alike(scenario: Scenario, traits: dict[str, ActTraits]) -> dict[str, str]:
    """Map acts that no rule starts, stops or waits for to the first act that is interchangeable with them."""
    named = {
        function.argument
        for rule in scenario.rules.values()
        for function in rule.functions
        if function.name in ("startCommunicationRobotAct", "stopCommunicationRobotAct")
    }
    first: dict[tuple[object, ...], str] = {}
    alike = {}
    for name, act in scenario.acts.items():
        ends = {f"{name}_{how}" for how in ("end", "succeeded", "failed", "stopped")}
        if name in named or ends & scenario.topics:
            continue
        own = traits[name]
        settings = scenario.settings_of(name)
        what = (
            act.channels,
            settings.calling_type,
            settings.filler,
            scenario.failure_policy(name),
            *(own.uses_robot, own.can_fail, own.can_go_on, own.waits, own.is_parallel, own.speaks, own.changes_voice),
        )
        alike[name] = first.setdefault(what, name)
    return alike


def external_topics(scenario: Scenario) -> set[str]:
    """Return the events that rules wait for and that neither the engine nor a rule raises."""
    inside = {f"{act}_{how}" for act in scenario.acts for how in ("end", "succeeded", "failed", "stopped")}
    inside |= {f"say_{how}" for how in ("end", "succeeded", "failed", "stopped")}
    inside.update(CUE_TOPICS)
    for rule in scenario.rules.values():
        inside.add(f"{rule.name}_end")
        inside |= {f"{rule.name}_{state.id}" for state in rule.states.values() if not state.transitions}
        inside |= {normal_topic(each.argument) for each in rule.functions if each.name == "raiseEventTopic"}
    return set(scenario.topics) - inside


def _submit(function: str, behavior: str) -> Submit:
    return Submit(t=1.0, function=function, behavior=behavior, source=PERSON)


def _asked_id(situation: Situation, index: int) -> str:
    """Return the number of a failed act's task, as `SituationKernel.put` assigns it."""
    acts = (*situation.waiting, *situation.running, *situation.asked)
    at = len(situation.waiting) + len(situation.running) + index
    before = sum(act.is_own == acts[at].is_own for act in acts[:at])
    return str(1 + before + (len(acts) + len(situation.rules) if acts[at].is_own else 0))


def _end(task: int, name: str, index: int, how: str, clock: int, least: int, most: int) -> Possibility:
    aborted = how == "aborted"
    status: Any = "failed" if aborted else how
    report = ActionReport(t=1.0, action=f"{task}/{name}", status=status, aborted=aborted)
    return Possibility(Move("end", name, index, how), report, clock, least, most)


_CUE = Possibility(Move("cue", how="marked"), _submit("markCue", ""))
_CUE_UNDONE = Possibility(Move("cue", how="undone"), _submit("undoCue", ""))
_STOP = Possibility(Move("stop"), _submit("stopAll", ""))
_STOPPED = Possibility(Move("stopped"), StopReport(t=1.0, confirmed=("robot",)))
_LEAVE = Possibility(Move("release", how="leave"), _submit("releaseStop", ""))
_LOST = Possibility(Move("lost"), RobotChanged(t=1.0, status="lost"))
_BACK = Possibility(Move("back"), RobotChanged(t=1.0, status="connected"))
