"""Random rules that use everything a document can say, and random inputs for them, each from one number."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any
from xml.sax.saxutils import quoteattr

from rise_exchange.scxml.limits import RuleAnalysis

from rise_engine.scenario.model import Rule, Scenario
from tests.exchange.scxml.playing import Script
from tests.kernel.harness import dialog, gaze, read, speech, write

ACTS = ("A0", "A 1", "A.2")
TOPICS = (
    "e0",
    "e1",
    "two words",
    "dotted.e",
    "memory",
    "A0_stopped",
    "A0_succeeded",
    "A0_end",
    "A 1_succeeded",
    "A 1_end",
    "A.2_failed",
    "Other_end",
)
KEYS = ("k0", "k1", "k2", "name", "items", "person", "person.name", "near.by", "pi")
MEMORY: dict[str, Any] = {
    "k0": True,
    "k1": 2,
    "k2": -1,
    "name": "Ada",
    "items": [{"text": "a", "done": False}, {"text": "b", "done": True}, 3],
    "person": {"near": {"by": 2}, "age": 4.5},
}
VALUES: tuple[Any, ...] = (
    True,
    False,
    0,
    1,
    3,
    -2,
    0.5,
    "",
    "Ada",
    "2s",
    "Ünï 𝔘",
    None,
    [],
    [1, 2, 3],
    {"near": False},
    {"text": "b"},
)
CONDITIONS = (
    "k0",
    "not k0",
    "k1 > 2",
    "k1",
    "k2",
    "not k2",
    "k0 and k1 < 3",
    "k0 or k1 >= 4",
    "k0 xor k1 xor k2",
    "name = 'Ada'",
    "name != missing",
    "missing = 0",
    "missing",
    "name > 'B'",
    "name > 3",
    "k1 = true",
    "k1 = '3'",
    "name = 0",
    "person.near",
    "person.near.by > 1",
    "defined(person.age) and person.age > 4",
    "near.by",
    "items[k1].done",
    "items[0].text = 'a'",
    "defined(items[k1].text)",
    "not defined(items[name].text)",
    "length(items) > k1",
    "length(name) = 3",
    "items contains 3",
    "name contains 'd'",
    "person contains 'near'",
    "lower(name) starts with 'a'",
    "name ends with 'a'",
    "k1 * 2 - 3 > k2 / 4",
    "k1 / k2 < 0",
    "-k1 < -1",
    "round(k1 + 0.5) = 2",
    "floor(-k1 / 2) = -1",
    "min(k1, k2, 1) + max(k1, 0) = 1",
    "clamp(k1, 0, 2) = 2",
    "clamp01(k1) = lerp(0, 1, 1)",
    "abs(k2) + sqrt(4) > 2",
    "pi > 3",
    "2 ^ k1 = 4",
    "0.1 + 0.2 = 0.3",
    "person = name",
    "items = items",
)
CHANCE = ("rand(1) > 0.5", "rand(k1, 9) > 4")
ASSIGNMENTS = (
    "k0 = not k0",
    "k0 = true",
    "k0 = false",
    "k1 = k1 + 1",
    "k1 = 0",
    "k2 = k1 * k2 - 1",
    "k2 = k1 / k2",
    "k1 = name + 1",
    "name = Bert",
    "name = k1",
    'name = "It\'s"',
    "k1 = missing",
    "k1 = length(items)",
    "name = lower(name)",
    'person = {"near": true, "by": 2}',
    "person.near = k0",
    "person.name.first = 'A'",
    "name.first = 1",
    "near.by = k1",
    "items[k1].done = k0",
    "items[0].text = name",
    "items[9] = 1",
    "items = shuffle(range(k1 + 2))",
    "items = sample(items, 1)",
    "items = latin(items, k1)",
    "k2 = floor(rand(0, 4))",
    "k1 = items[k2].done",
    "pi = k1",
    "k2 = round(k1 / 2)",
)
HELD = ("k0", "not k0", "k1 > 2", "name = 'Ada'", "person.near")
DELAYS = ("500ms", "1s", "1.5s", "2s", "{k1}", "{k1 / 3}", "{name}", "{missing}", "{k2}ms", "{k1 * 250}ms", "{rand(2)}")


class Author:
    """Writes one rule."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.states = [f"State {number}" for number in range(self.random.randint(2, 5))]

    def rule(self) -> str:
        states = "".join(self.state(name) for name in self.states)
        more = "".join(f'<State id="Final {number}">{self.block("onEntry", 0.6)}</State>' for number in range(2))
        return f'<InteractionRule name="Under test" initial="State 0">{states}{more}</InteractionRule>'

    def state(self, name: str) -> str:
        transitions = "".join(self.transition() for _ in range(self.random.randint(1, 6)))
        return (
            f'<State id="{name}">{self.block("onEntry", 0.7)}{self.block("onExit", 0.3)}{transitions}'
            f'<transition eventTopic="/e1" target="{self.target()}"/></State>'
        )

    def target(self) -> str:
        return self.random.choice([*self.states * 3, "Final 0", "Final 1"])

    def block(self, tag: str, chance: float) -> str:
        if self.random.random() > chance:
            return ""
        return f"<{tag}>{self.statements(0)}</{tag}>"

    def statements(self, depth: int) -> str:
        return "".join(self.statement(depth) for _ in range(self.random.randint(1, 3)))

    def statement(self, depth: int) -> str:
        kind = self.random.random()
        if depth < 2 and kind < 0.15:
            condition = self.random.choice([*CONDITIONS, *CHANCE])
            more = f"<elseif cond={quoteattr(self.random.choice(CONDITIONS))}>{self.statements(depth + 1)}</elseif>"
            other = f"<else>{self.statements(depth + 1)}</else>"
            tail = self.random.choice(["", more, other, more + other])
            return f"<if cond={quoteattr(condition)}>{self.statements(depth + 1)}{tail}</if>"
        if depth < 2 and kind < 0.25:
            choices = "".join(self.statement(depth + 1) for _ in range(self.random.randint(1, 3)))
            return f"<oneOf>{choices}</oneOf>"
        return self.function()

    def function(self) -> str:
        pick = self.random.choice
        kind = self.random.random()
        if kind < 0.4:
            return f"<function assignValue={quoteattr(pick(ASSIGNMENTS))}/>"
        if kind < 0.55:
            return f'<function raiseEventTopic="/{pick(["e0", "two words", "unheard", "memory"])}"/>'
        if kind < 0.8:
            return f'<function startCommunicationRobotAct="{pick(ACTS)}"/>'
        if kind < 0.9:
            return f'<function stopCommunicationRobotAct="{pick(ACTS)}"/>'
        return pick(
            [
                '<function startInteractionRule="Other"/>',
                '<function startInteractionRule="Other" state="B" enter="no"/>',
                '<function stopInteractionRule="Other"/>',
            ]
        )

    def transition(self) -> str:
        pick, kind = self.random.choice, self.random.random()
        guard = f" cond={quoteattr(pick([*CONDITIONS, *CHANCE]))}" if self.random.random() < 0.4 else ""
        target = f' target="{self.target()}"' if self.random.random() < 0.7 else ""
        inside = self.statements(1) if not target or self.random.random() < 0.4 else ""
        if kind < 0.35:
            trigger = f'eventTopic="/{pick(TOPICS)}"{guard}'
        elif kind < 0.5:
            outcome = pick(["", ' outcome="succeeded"', ' outcome="failed | stopped"'])
            trigger = f'ended="{pick(ACTS)}"{outcome}{guard}'
        elif kind < 0.7:
            trigger = f'after="{pick(DELAYS)}"{guard}'
        elif kind < 0.85:
            trigger = f'while={quoteattr(pick(HELD))} after="{pick(DELAYS)}"{guard}'
        else:
            trigger = f"cond={quoteattr(pick(CONDITIONS))}"
        return f"<transition {trigger}{target}>{inside}</transition>"


OTHER = (
    '<InteractionRule name="Other" initial="A"><State id="A">'
    '<transition eventTopic="/never" target="B"/></State><State id="B"/></InteractionRule>'
)


def random_study(folder: Path, seed: int) -> tuple[Scenario, Rule]:
    """A study with a random rule, and the rule."""
    acts = dialog("A0", speech("1")) + dialog("A 1", gaze("1"), speech("2", wait="1")) + dialog("A.2", speech("1"))
    write(folder, acts=acts, rules=Author(seed).rule() + OTHER, memory=MEMORY, toml='title = "By chance"')
    scenario = read(folder)
    return scenario, scenario.rules["Under test"]


def random_script(scenario: Scenario, rule: Rule, seed: int, length: int = 25) -> Script:
    """Inputs for a rule."""
    random = Random(seed)
    analysis = RuleAnalysis(scenario, rule)
    topics = sorted(analysis.topics) or ["e0"]
    keys = sorted(analysis.keys_read - {"session"}) or ["k0"]
    acts = sorted(scenario.acts)
    values = [*VALUES, *(scenario.memory[key] for key in keys if key in scenario.memory)]
    script: Script = []
    for _ in range(length):
        kind = random.random()
        if kind < 0.35:
            script.append(["event", random.choice(topics)])
        elif kind < 0.6 and not keys[0].startswith("session."):
            script.append(["set", random.choice(keys), random.choice(values)])
        elif kind < 0.63:
            script.append(["delete", random.choice(keys)])
        elif kind < 0.8:
            script.append(["end", random.randrange(9), random.choice(["succeeded", "succeeded", "failed"])])
        elif kind < 0.85 and acts:
            script.append(["act", random.choice(acts)])
        else:
            script.append(["wait", random.choice([0.017, 0.333, 0.5, 0.77, 1.0, 1.5, 2.0, 4.01])])
    return script
