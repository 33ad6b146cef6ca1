"""Random studies that use everything, each from one number."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import (
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
    OneOf,
    Parameter,
    RobotProfile,
    Rule,
    Scenario,
    State,
    Statement,
    Table,
    Transition,
)
from rise_engine.scenario.speech.template import parse_template

ACTS = ("A0", "A1", "A2", "A3", "A4")
RULES = ("R0", "R1", "R2", "R3")
STATES = ("s0", "s1", "s2", "s3")
OWN = ("e0", "e1", "e2")
"""Topics that rules and wizards raise."""
ENGINE = (
    *(f"{act}_{how}" for act in ACTS for how in ("succeeded", "failed", "stopped", "end")),
    *(f"{rule}_end" for rule in RULES),
    *(f"{rule}_{state}" for rule in RULES for state in STATES),
    "cue",
    "cue_undone",
    "say_end",
    "say_succeeded",
)
TOPICS = (*OWN, *ENGINE)
CONDITIONS = (
    "k0",
    "not k0",
    "k1 > 2",
    "k1 < 3",
    "k0 and k1 < 5",
    "missing",
    "missing2 or k0",
    "k0 or missing3",
    "name > 3",
    "rand(1) > 0.5",
    "person.near",
    "person.far and k0",
    "person.near.by > 1",
    "defined(person)",
    "length(name) > k1",
    "k1 = 1",
    "true",
    "k1 / k2 > 1",
)
ASSIGNMENTS = (
    "k0 = true",
    "k0 = false",
    "k0 = not k0",
    "k1 = k1 + 1",
    "k1 = 0",
    "k1 = 4",
    "k1 = name + 1",
    "k1 = missing + 1",
    "k1 = missing4",
    "k2 = floor(rand(0, 4))",
    "k2 = k1 / k2",
    "k2 = 1",
    "name = Bert",
    "name = 'Cleo'",
    '{"person": {"near": true}}',
    '{"person": {"near": {"by": 2}}}',
    '{"person.near": 1}',
    "person.near = k0",
    "person.far = true",
    "name.first = 3",
)
WORDS = (
    "hi",
    "{name}",
    "Hello {name}, {k1}",
    "{missing}",
    "{missing|x}",
    'Thanks{", "nickname}!',
    "{person.near|unsure}",
    "a longer sentence that takes a while to be said",
)
COMPUTED = (
    ("{k1}", None),
    ("{k2 + 1}", None),
    ("{0 - 1}", None),
    ("{name}", None),
    ("{pause}", None),
    ("{k0}", None),
    ("{missing5}", None),
    ("{missing6 + 1}", None),
    ("{k1}ms", 0.001),
    ("{pause}s", 1.0),
    ("{100000}", None),
    ("{name + 1}", None),
    ("{rand(2)}", None),
)
SESSION = (
    "session.speaking",
    "not session.speaking and not session.cue",
    "session.cue",
    "session.stopped",
    "session.participant = 'P1'",
    "session.factors.voice = 'low'",
    "defined(session)",
    "session.speaking or k0",
)
PARTS = (
    "items[k1].done",
    "items[k1].text = 'b'",
    "k1 < length(items) and items[k1].done",
    "defined(items[k1].text)",
    "list[order[0]] > 1",
    "length(list) > k1",
    "defined(words)",
    "length(words) > k1",
    "words[k1].text = 'one'",
    "list[k2] = list[0]",
)
SETTING = (
    "items[k1].done = true",
    "items[k1].done = k0",
    "items[k2].text = 'c'",
    "list[k2] = k1",
    "list = shuffle(range(k2 + 2))",
    "order = sample(list, 1)",
    "list = latin(list, k1)",
    "order = shuffle(order)",
    "k1 = words[k2].number",
    "words[0].text = 'x'",
    "words = 1",
    "k1 = list[missing7]",
)
PARTS_IN_WORDS = (
    "{items[k1].text}",
    "{items[k2].text|none}",
    "{words[k1].text}",
    "{list[k1 + 'a']|x}",
    '{list[0]", "}so',
)
PARTS_AT_FIRST = {"items": [{"text": "a", "done": False}, {"text": "b"}], "list": [3, 1, 2], "order": [2, 0, 5]}
HELD = ("k0", "not k0", "session.speaking", "not session.speaking and not session.cue", "session.cue", "k1 < 3")
"""What turns false again now and then."""
POLICIES = ("go_on", "ask", "repeat:1", "repeat:2")
TIMES = ("0", "0", "100", "2000", "1000", "{k1}", "{k2}", "{name}", "{missing}", "0.0001", "0.3")

DELAYS = tuple(Delay(words, seconds) for words, seconds in (("100ms", 0.1), ("1s", 1.0), ("2 s", 2.0), ("1.5s", 1.5)))

WORD_TABLE = Table("words", ("text", "number"), [["one", 1], ["two", None], ["three", 3]])

text = Parameter("message", "text", required=True)
milliseconds = Parameter("duration", "number", unit="ms", minimum=0)
count = Parameter("repetitions", "integer", default=1, minimum=1)
value = Parameter("value", "name", required=True, codes={"happy": 1, "sad": 2})
rate = Parameter("rate", "number", minimum=0.1, maximum=10)
point = Parameter("pointx", "number", unit="m")
hand = Parameter("hand", "name", names=("left", "right"))


def robot(random: Random) -> RobotProfile:
    """A robot; some are mute, and some have other limits."""
    actions = {
        "LookAt": ActionSpec("LookAt", {"pointx": point, "duration": milliseconds}, ("gaze",), seconds=1.0),
        "Emotion": ActionSpec("Emotion", {"value": value, "duration": milliseconds}, ("face",), limit=4.0),
        "Nod": ActionSpec(
            "Nod", {"repetitions": count, "duration": milliseconds}, ("body", "gaze"), seconds=random.choice([0.5, 2.0])
        ),
        "PointAt": ActionSpec(
            "PointAt", {"pointx": point, "hand": hand, "duration": milliseconds}, ("gaze",), substitute="LookAt"
        ),
        "Wait": ActionSpec("Wait", {"duration": milliseconds}, (), engine=True),
    }
    if random.random() < 0.9:
        actions["Speech"] = ActionSpec("Speech", {"message": text, "rate": rate}, ("speech",))
    else:
        actions["Speech"] = ActionSpec("Speech", {"message": text, "rate": rate}, ("speech",), supported=False)
    return RobotProfile("test", "Test", "none", actions)


class Author:
    """Writes a study."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.robot = robot(random)
        self.topics = random.sample(TOPICS, random.randint(3, 10)) + list(OWN)
        self.going_on = random.random() < 0.5
        """Whether it has what is in section 12."""
        self.parts = random.random() < 0.5
        """Whether it has tables, and sets and reads parts of values."""
        self.turns = random.random() < 0.5
        """Whether rules look at how the session stands, wait for what has held, and keep events."""
        self.busy = random.choice([0.5, 1.0, 2.0])
        """How much stands in its blocks."""

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def some(self, make: Callable[[], Any], most: int) -> tuple[Any, ...]:
        return tuple(make() for _ in range(self.random.randint(0, most)))

    def study(self) -> Scenario:
        acts = {name: self.act(name) for name in ACTS}
        rules = {name: self.rule(name) for name in RULES}
        awaited = {
            way.event
            for rule in rules.values()
            for state in rule.states.values()
            for way in state.transitions
            if way.event is not None
        }
        settings = {
            name: ActSettings(
                filler=self.chance(0.4),
                answers=self.chance(0.8),
                calling_type="None" if self.chance(0.4) else "Blocking",
                on_failure=self.random.choice(["", *POLICIES]) if self.going_on else "",
            )
            for name in ACTS
            if self.chance(0.5)
        }
        return Scenario(
            "random",
            "/",
            "debug",
            self.robot,
            acts,
            rules,
            {
                **(PARTS_AT_FIRST if self.parts else {}),
                "k0": False,
                "k1": 0,
                "k2": 1,
                "name": "Ada",
                "pause": self.random.choice(["2s", "500 ms", "0.1ms", "2", None]),
            },
            act_settings=settings,
            fillers=FillerSettings(auto_after=self.random.choice([None, 1.0, 3.0])),
            cue_keep=self.random.choice([None, 1.5]) if self.turns else None,
            known_keys=frozenset({"k0", "k1", "k2", "name", "pause", "person", "missing4", *PARTS_AT_FIRST}),
            on_failure=self.random.choice(POLICIES) if self.going_on else "go_on",
            reads_session=self.turns,
            tables={"words": WORD_TABLE} if self.parts else {},
            language=self.random.choice(["", "de-DE"]),
            topics=frozenset(awaited),
        )

    # --- acts ---

    def act(self, name: str) -> Act:
        actions: list[Action] = []
        for n in range(self.random.choice([1, 1, 2, 2, 3, 4, 5])):
            waits = self.random.sample([a.id for a in actions], self.random.randint(0, min(2, n)))
            kind = self.kind()
            calls = tuple(self.call(kind) for _ in range(self.random.choice([1, 1, 1, 2, 3])))
            actions.append(Action(str(n), calls, tuple(waits), self.chance(0.3)))
        if self.chance(0.4):
            self.random.shuffle(actions)
        used = {c for a in actions for call in a.calls for c in self.channels(call.type)}
        return Act(name, tuple(actions), frozenset(used))

    def channels(self, kind: str) -> tuple[str, ...]:
        spec = self.robot.actions[kind]
        return self.robot.actions[spec.substitute].channels if spec.substitute else spec.channels

    def kind(self) -> str:
        kinds = ["LookAt", "Emotion", "Nod", "PointAt", "Wait", "Wait", "Wait"]
        if self.robot.actions["Speech"].supported:
            kinds += ["Speech"] * 4
        return self.random.choice(kinds)

    def call(self, kind: str) -> ActionCall:
        pick = self.random.choice
        written: dict[str, str] = {}
        match kind:
            case "Wait":
                written["duration"] = pick(TIMES)
            case "Speech":
                written["message"] = pick([*WORDS, *(PARTS_IN_WORDS if self.parts else ())])
                if self.chance(0.2):
                    written["rate"] = pick(["2", "0.5", "{k1}"])
            case "Emotion":
                written["value"] = pick(["1", "sad", "{name}", "{k1}", "{mood|happy}"])
            case "Nod":
                if self.chance(0.5):
                    written["repetitions"] = pick(["2", "3", "{k2}"])
            case _:
                written["pointx"] = pick(["1", "0.5", "{k1}", "{missing|2}"])
                if kind == "PointAt" and self.chance(0.5):
                    written["hand"] = pick(["left", "{name}"])
        if kind not in ("Wait", "Speech") and self.chance(0.3):
            written["duration"] = pick(TIMES)
        return ActionCall(kind, {name: parse_template(words) for name, words in written.items()})

    # --- rules ---

    def function(self) -> Function:
        pick = self.random.choice
        match self.random.choice([0, 0, 0, 1, 2, 2, 3, 4, 4, 5, 5, 5]):
            case 0:
                return Function("startCommunicationRobotAct", pick(ACTS))
            case 1:
                return Function("stopCommunicationRobotAct", pick(ACTS))
            case 2:
                if self.going_on and self.chance(0.4):
                    return Function(
                        "startInteractionRule", pick(RULES), state=pick([*STATES, None]), enter=self.chance(0.5)
                    )
                return Function("startInteractionRule", pick(RULES))
            case 3:
                return Function("stopInteractionRule", pick(RULES))
            case 4:
                keep = pick([1.0, 0.5, 30.0]) if self.turns and self.chance(0.4) else None
                return Function("raiseEventTopic", pick(["/", ""]) + pick([*self.topics, *OWN]), keep=keep)
            case _:
                words = pick([*ASSIGNMENTS, *(SETTING if self.parts else ())])
                return Function("assignValue", words, Assignment.parse(words))

    def condition(self) -> Expression:
        conditions = [*CONDITIONS, *(SESSION if self.turns else ()), *(PARTS if self.parts else ())]
        return Expression.parse(self.random.choice(conditions))

    def statement(self, deep: int = 0) -> Statement:
        again = lambda: self.statement(deep + 1)  # noqa: E731
        match self.random.randrange(6) if deep < 3 else 5:
            case 0:
                branches = [Branch(self.condition(), self.some(again, 2)) for _ in range(self.random.choice([1, 1, 2]))]
                if self.chance(0.6):
                    branches.append(Branch(None, self.some(again, 2)))
                return If(tuple(branches))
            case 1:
                return OneOf(tuple(again() for _ in range(self.random.randint(1, 3))))
            case _:
                return self.function()

    def block(self, most: int) -> tuple[Statement, ...]:
        return self.some(self.statement, round(most * self.busy))

    def transition(self) -> Transition:
        pick = self.random.choice
        guard = self.condition() if self.chance(0.35) else None
        target = pick([*STATES, "s0", "s1", "s2", None, None])
        block = self.block(1)
        match self.random.randrange(6):
            case 0:
                return Transition(None, self.condition(), None, target, block)
            case 1:
                delay = pick(DELAYS)
                if self.turns and self.chance(0.5):
                    words, unit = pick(COMPUTED)
                    written = words[: words.index("}") + 1]
                    delay = Delay(words, None, Expression.parse(written[1:-1]), unit)
                held = None
                if self.turns and self.chance(0.5):
                    held = Expression.parse(pick(HELD)) if self.chance(0.7) else self.condition()
                return Transition(None, guard, delay, target, block, held=held)
            case 2:
                outcomes: tuple[ActOutcome, ...] = pick([(), ("succeeded",), ("failed", "stopped")])
                return Transition(None, guard, None, target, block, ended=pick(ACTS), outcomes=outcomes)
            case _:
                return Transition(pick([pick(OWN), pick(self.topics)]), guard, None, target, block)

    def rule(self, name: str) -> Rule:
        states = {}
        for state in STATES:
            ends = state == "s3" or self.chance(0.1)
            ways = () if ends else (self.transition(), *self.some(self.transition, 3))
            states[state] = State(state, self.block(2), self.block(1) if self.chance(0.4) else (), ways)
        return Rule(name, self.random.choice(["s0", "s0", "s1"]), states, self.random.choice([0, 1, 2, 0.5]))
