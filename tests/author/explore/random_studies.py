"""Random studies that are small enough to be explored action by action, each from one number."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import (
    CUE_TOPICS,
    SESSION,
    Act,
    Action,
    ActionCall,
    ActionSpec,
    ActOutcome,
    ActSettings,
    Branch,
    Delay,
    FillerSettings,
    Function,
    If,
    KeyBinding,
    OneOf,
    Parameter,
    RobotProfile,
    Rule,
    Scenario,
    State,
    Statement,
    Transition,
)
from rise_engine.scenario.speech.template import parse_template

OWN = ("e0", "e1", "e2")
"""Topics that rules and keys raise, and that nodes raise where these do not."""
FROM_ACTS = ("end", "end", "succeeded", "failed", "stopped")
CONDITIONS = (
    "k0",
    "not k0",
    "k0",
    "not k0",
    "k1 = 0",
    "k1 = 2",
    "k1 > 0",
    "k0 and k1 < 2",
    "who = 'Ada'",
    "true",
    "missing",
)
BY_CHANCE = ("rand(1) > 0.6", "k0 or rand(2) > 1")
ON_SESSION = ("session.cue", "session.stopped", "not session.cue and k0")
ON_SPEAKING = ("session.speaking", "not session.speaking", "session.speaking and k0")
HELD = ("k0", "not k0", "k1 > 0")
ASSIGNMENTS = ("k0 = true", "k0 = false", "k0 = not k0", "k1 = 0", "k1 = 1", "k1 = 2", "k1 = min(k1 + 1, 2)", "k2 = k1")
ON_WHO = ("who = 'Ada'", "who = null")
WORDS = ("Hello", "A longer sentence that takes a while to be said", "{k1} of two", "{who|you}")
NEEDS_WHO = ("Hello {who}",)
POLICIES = ("go_on", "go_on", "ask", "repeat:1")
TIMES = (1.0, 2.0, 3.0)

_message = Parameter("message", "text", required=True)
_milliseconds = Parameter("duration", "number", unit="ms", minimum=0)
_value = Parameter("value", "name", required=True, codes={"happy": 1, "sad": 2})
ROBOT = RobotProfile(
    "test",
    "Test",
    "none",
    {
        "Speech": ActionSpec("Speech", {"message": _message}, ("speech",)),
        "LookAt": ActionSpec("LookAt", {"duration": _milliseconds}, ("gaze",), seconds=1.0),
        "Emotion": ActionSpec("Emotion", {"value": _value}, ("face",), seconds=2.0, limit=4.0),
        "Nod": ActionSpec("Nod", {}, ("body", "gaze"), seconds=0.5),
        "PointAt": ActionSpec("PointAt", {}, ("arms",), substitute="LookAt"),
        "Dance": ActionSpec("Dance", {}, ("body", "arms"), supported=False),
        "Wait": ActionSpec("Wait", {"duration": _milliseconds}, (), engine=True),
    },
)


class RandomStudy(NamedTuple):
    scenario: Scenario
    keys: tuple[str, ...]
    """The memory keys that something reads or writes."""
    has_cue: bool
    """Whether the participant's cue makes a difference."""


def random_study(seed: int, *, speaking: bool = False) -> RandomStudy:
    """A study. `speaking`: now and then its rules look at `session.speaking`, for which acts are no one thing."""
    return _Author(Random(seed), speaking).study()


class _Author:
    """Writes a study."""

    def __init__(self, random: Random, speaking: bool) -> None:
        self.random = random
        self.acts = tuple(f"A{n}" for n in range(random.randint(2, 4)))
        self.rules = tuple(f"R{n}" for n in range(random.randint(2, 3) if random.random() < 0.8 else 4))
        self.states = {rule: tuple(f"s{n}" for n in range(random.randint(2, 4))) for rule in self.rules}
        self.uses_session = random.random() < 0.2
        self.uses_who = random.random() < 0.25
        self.uses_chance = random.random() < 0.3
        conditions = [*CONDITIONS]
        if self.uses_chance:
            conditions += BY_CHANCE
        if self.uses_session:
            conditions += ON_SESSION
            if speaking:
                conditions += [*ON_SPEAKING, *ON_SPEAKING]
        self.conditions = conditions
        self.reads_cue = False
        self.rule = self.rules[0]
        """The one that is being written."""

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def pick(self, some: Any) -> Any:
        return self.random.choice(some)

    def some(self, make: Callable[[], Any], most: int) -> tuple[Any, ...]:
        return tuple(make() for _ in range(self.random.randint(0, most)))

    def study(self) -> RandomStudy:
        acts = {name: self.act(name) for name in self.acts}
        rules = {name: self.write_rule(name) for name in self.rules}
        ways = [way for rule in rules.values() for state in rule.states.values() for way in state.transitions]
        topics = {way.event for way in ways if way.event is not None}
        scenario = Scenario(
            "random",
            "/",
            "debug",
            ROBOT,
            acts,
            rules,
            {"k0": False, "k1": 0, "k2": 0, "who": self.pick(["Ada", None])},
            keys={key.key: key for key in self.keys()},
            act_settings={name: self.settings() for name in self.acts if self.chance(0.7)},
            fillers=FillerSettings(auto_after=1.5 if self.uses_session and self.chance(0.5) else None),
            on_failure=self.pick(POLICIES),
            known_keys=frozenset({"k0", "k1", "k2", "who"}),
            reads_session=self.uses_session,
            topics=frozenset(topics),
        )
        has_cue = bool(topics.intersection(CUE_TOPICS)) or scenario.fillers.auto_after is not None or self.reads_cue
        return RandomStudy(scenario, ("k0", "k1", "k2", "who", *([SESSION] if self.uses_session else [])), has_cue)

    def settings(self) -> ActSettings:
        return ActSettings(
            filler=self.chance(0.3),
            calling_type="None" if self.chance(0.5) else "Blocking",
            on_failure=self.pick(["", "", *POLICIES]),
        )

    # --- keys ---

    def keys(self) -> list[KeyBinding]:
        """Each study begins with the first; some topics are left to nodes."""
        found = [KeyBinding("a", "a", "startInteractionRule", self.rules[0])]
        for label in "bcdefg"[: self.random.randint(2, 5)]:
            found.append(self.key(label))
        return found

    def key(self, label: str) -> KeyBinding:
        match self.random.randrange(10):
            case 0:
                return KeyBinding(label, label, "startCommunicationRobotAct", self.pick(self.acts))
            case 1:
                rule = self.pick(self.rules)
                state = self.pick([None, self.pick(self.states[rule])])
                return KeyBinding(label, label, "startInteractionRule", rule, state=state, enter=self.chance(0.7))
            case 2:
                return KeyBinding(label, label, "stopInteractionRule", self.pick(self.rules))
            case 3:
                return KeyBinding(label, label, "stopCommunicationRobotAct", self.pick(self.acts))
            case 4 | 5 | 6:
                words = self.pick([*ASSIGNMENTS, *(ON_WHO if self.uses_who else ())])
                return KeyBinding(label, label, "assignValue", words)
            case _:
                keep = self.pick([None, None, *TIMES])
                return KeyBinding(label, label, "raiseEventTopic", f"/{self.pick(OWN)}", keep=keep)

    # --- acts ---

    def act(self, name: str) -> Act:
        actions: list[Action] = []
        for number in range(self.random.choice([1, 1, 1, 2, 2, 3])):
            before = [action.id for action in actions]
            waits = self.random.sample(before, self.random.randint(0, len(before)))
            kind = self.pick(["Speech", "Speech", "LookAt", "Emotion", "Nod", "PointAt", "Wait", "Wait", "Dance"])
            if kind == "Dance" and self.chance(0.7):
                kind = "Nod"
            calls = tuple(self.call(kind) for _ in range(self.random.choice([1, 1, 1, 1, 2])))
            actions.append(Action(str(number), calls, tuple(waits), self.chance(0.2)))
        used = {channel for action in actions for call in action.calls for channel in _channels(call.type)}
        return Act(name, tuple(actions), frozenset(used))

    def call(self, kind: str) -> ActionCall:
        written: dict[str, str] = {}
        match kind:
            case "Wait":
                written["duration"] = self.pick(["0", "300", "1000", "2000"])
            case "Speech":
                written["message"] = self.pick([*WORDS, *(NEEDS_WHO * 3 if self.uses_who else ())])
            case "Emotion":
                written["value"] = self.pick(["happy", "sad"])
        return ActionCall(kind, {name: parse_template(words) for name, words in written.items()})

    # --- rules ---

    def write_rule(self, name: str) -> Rule:
        self.rule = name
        states = {}
        for state in self.states[name]:
            ends = state == self.states[name][-1] and self.chance(0.6)
            ways = () if ends else (self.transition(), *self.some(self.transition, 2))
            states[state] = State(state, self.block(2), self.block(1) if self.chance(0.2) else (), ways)
        return Rule(name, self.states[name][0], states, self.pick([0, 1, 1, 2]))

    def block(self, most: int) -> tuple[Statement, ...]:
        return self.some(self.statement, most)

    def statement(self, deep: int = 0) -> Statement:
        kind = self.random.randrange(10) if deep < 2 else 9
        if kind == 0:
            otherwise = [Branch(None, (self.function(),))] if self.chance(0.5) else []
            return If((Branch(self.condition(), (self.statement(deep + 1),)), *otherwise))
        if kind == 1 and self.uses_chance:
            return OneOf((self.statement(deep + 1), self.function()))
        return self.function()

    def function(self) -> Function:
        match self.random.randrange(12):
            case 0 | 1 | 2 | 3:
                return Function("startCommunicationRobotAct", self.pick(self.acts))
            case 4:
                return Function("stopCommunicationRobotAct", self.pick(self.acts))
            case 5 | 6:
                return self.start_of_rule()
            case 7:
                return Function("stopInteractionRule", self.pick(self.rules))
            case 8:
                keep = self.pick(TIMES) if self.chance(0.5) else None
                return Function("raiseEventTopic", self.pick(["/", ""]) + self.pick(OWN), keep=keep)
            case _:
                words = self.pick([*ASSIGNMENTS, *(ON_WHO if self.uses_who else ())])
                return Function("assignValue", words, Assignment.parse(words))

    def start_of_rule(self) -> Function:
        rule = self.pick(self.rules)
        if self.chance(0.2):
            state = self.pick(self.states[rule])
            return Function("startInteractionRule", rule, state=state, enter=self.chance(0.5))
        return Function("startInteractionRule", rule)

    def condition(self) -> Expression:
        words = self.pick(self.conditions)
        self.reads_cue = self.reads_cue or "session.cue" in words
        return Expression.parse(words)

    def transition(self) -> Transition:
        guard = self.condition() if self.chance(0.25) else None
        target = self.pick([*self.states[self.rule], None])
        block = self.block(1)
        match self.random.randrange(9):
            case 0:
                return Transition(None, self.condition(), None, target, block)
            case 1 | 2:
                return Transition(None, guard, self.delay(), target, block)
            case 3:
                return Transition(None, guard, self.delay(), target, block, held=Expression.parse(self.pick(HELD)))
            case 4 | 5:
                outcomes: tuple[ActOutcome, ...] = self.pick([(), ("succeeded",), ("failed", "stopped")])
                return Transition(None, guard, None, target, block, ended=self.pick(self.acts), outcomes=outcomes)
            case _:
                return Transition(self.topic(), guard, None, target, block)

    def delay(self) -> Delay:
        if self.chance(0.15):
            return Delay("{k1 + 1}", None, Expression.parse("k1 + 1"), None)
        seconds = self.pick(TIMES)
        return Delay(f"{seconds:g}s", seconds)

    def topic(self) -> str:
        match self.random.randrange(8):
            case 0 | 1 | 2:
                return f"{self.pick(self.acts)}_{self.pick(FROM_ACTS)}"
            case 3:
                rule = self.pick(self.rules)
                return f"{rule}_{self.pick(['end', self.states[rule][-1]])}"
            case 4 if self.uses_session:
                return str(self.pick(["cue", "cue_undone"]))
            case _:
                return str(self.pick(OWN))


def _channels(kind: str) -> tuple[str, ...]:
    spec = ROBOT.actions[kind]
    return ROBOT.actions[spec.substitute].channels if spec.substitute is not None else spec.channels
