"""Conditions, assignments and computed times mean in ECMAScript what they mean here: value by value, in node."""

from __future__ import annotations

import copy
import json
import shutil
import subprocess
from random import Random
from typing import Any

import msgspec
import pytest
from rise_exchange.scxml.export import HELPERS
from rise_exchange.scxml.expressions import assignment_code, condition_code, delay_code

from rise_engine.expression import Assignment, Environment, EvaluationError, Expression
from rise_engine.kernel.rng import Rng
from rise_engine.kernel.waits import compute_delay
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Delay, Scenario
from tests.exchange.scxml.playing import SEED
from tests.exchange.scxml.random_rules import ASSIGNMENTS, CHANCE, CONDITIONS, KEYS, MEMORY, VALUES
from tests.exchange.scxml.traces import STUDIES

MORE_CONDITIONS = (
    "k1 < name or k2",
    "not (k1 = k2) xor k0",
    "round(k1) = 0",
    "round(k1 * 0.5) = ceil(k1 * 0.5 - 0.5)",
    "1 / ceil(k2 * 0.1) > 0",
    "1 / round(-0.2) > 0",
    "1 ^ (k1 / 0) = 1",
    "(0 - 1) ^ (1 / 0) = 1",
    "0 ^ -1 > 5",
    "min(k1, 0 / 0) = min(k1, 0 / 0)",
    "name < 'Ünï 𝔙'",
    "'𝔘' < 'ｚ'",
    "length(name) > 5",
    "items = name",
    "items contains name",
    "items contains k0",
    "missing contains ''",
    "missing = missing2",
    "missing < 1",
    "missing < ''",
    "person = items[0]",
    "items[0]['text'] = 'a'",
    "items[k1]",
    "person[name]",
    "person.age[0]",
    "defined(items[k1 + name])",
    "defined(items[items[k1].done].text)",
    "range(k1)[0] = 0",
    "length(shuffle(items)) = length(items)",
    "latin(range(5), k1)[2] > 1",
    "latin(range(4), k1)[3] > 1",
    "sample(range(k1), k2)",
    "length(name) = 5",
    "sample(range(6), 4)[3] > 2",
    "sample(range(6), 5)[4] > 2",
    "sample(range(6), 6)[5] > 2",
    "defined(items['length'])",
    "defined(k0[k1])",
    "length(range(2, 5)) = 3",
    "items.0.text = 'a'",
    "pi",
    "e > 2 and r2d > 57",
)
MORE_ASSIGNMENTS = (
    "person.name = k1",
    "near.by.far = k1",
    "items.0.text = k1",
    "items = sample(range(6), 6)",
    "items = latin(range(5), k1 + 5)",
    "items = latin(range(4), k1)",
)
DELAYS = (
    ("k1", None),
    ("k1 / 3", None),
    ("k1", 0.001),
    ("name", None),
    ("name", 1.0),
    ("k1 / 128", None),
    ("items", None),
)
RUN = """
const given = JSON.parse(require('fs').readFileSync(0, 'utf8'));
const make = new Function('code', 'memory', 'seed', 'let countdown = 0; const countdowns = [];'
  + given.helpers + '; try { return [eval(code), seed]; } catch (error) { return ["error", seed]; }');
process.stdout.write(JSON.stringify(given.tries.map(([code, memory]) => make(code, memory, given.seed))));
"""


def in_node(tries: list[tuple[str, dict[str, Any]]]) -> list[Any]:
    if shutil.which("node") is None:
        pytest.skip("node is not here")
    given = {"helpers": "\n".join(HELPERS.values()), "tries": tries, "seed": str(SEED)}
    done = subprocess.run(["node", "-e", RUN], input=json.dumps(given), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


def memories() -> list[dict[str, Any]]:
    random = Random(7)
    found: list[dict[str, Any]] = [MEMORY, {}]
    for _ in range(60):
        memory: dict[str, Any] = copy.deepcopy(MEMORY)
        for key in random.sample(KEYS, 4):
            memory[key] = random.choice([*VALUES, "12s", " 1.5 min", 2.5, -0.5, 1e22, 250, {"2": 1, "3": {}}])
        del memory[random.choice(list(memory))]
        found.append(memory)
    return found


def environment(memory: dict[str, Any]) -> tuple[Environment, Rng]:
    rng = Rng(SEED)
    return Environment(memory, rng.fraction, None, rng.integer_below), rng


def study() -> Scenario:
    """A scenario in which only the keys of these tests are known."""
    scenario = load(STUDIES / "greeting").scenario
    assert scenario is not None
    return msgspec.structs.replace(scenario, known_keys=frozenset(KEYS), tables={})


@pytest.mark.slow
def test_conditions_mean_the_same() -> None:
    tries: list[tuple[str, dict[str, Any]]] = []
    expected: list[tuple[Any, str, str]] = []
    for text in (*CONDITIONS, *CHANCE, *MORE_CONDITIONS):
        expression = Expression.parse(text)
        for memory in memories():
            env, rng = environment(memory)
            try:
                result = expression.compiled_condition(env)
            except EvaluationError:
                result = False
            tries.append((condition_code(expression), memory))
            expected.append((result, str(rng.state), f"{text} with {memory}"))
    for (result, state), (ours, our_state, what) in zip(in_node(tries), expected, strict=True):
        assert (result, state) == (ours, our_state), what


@pytest.mark.slow
def test_assignments_mean_the_same() -> None:
    scenario = study()
    tries: list[tuple[str, dict[str, Any]]] = []
    expected: list[tuple[Any, str, str]] = []
    for text in (*ASSIGNMENTS, *MORE_ASSIGNMENTS):
        assignment = Assignment.parse(text)
        for memory in memories():
            env, rng = environment(memory)
            after: Any
            try:
                key, value = assignment.entry(env, scenario.known_keys)
                after = {**memory, key: value}
            except EvaluationError:
                after = "error"
            tries.append((assignment_code(assignment, scenario), memory))
            expected.append((after, str(rng.state), f"{text} with {memory}"))
    for (result, state), (ours, our_state, what) in zip(in_node(tries), expected, strict=True):
        assert result == ours, what
        assert state == our_state, what


@pytest.mark.slow
def test_computed_times_mean_the_same() -> None:
    tries: list[tuple[str, dict[str, Any]]] = []
    expected: list[tuple[float | None, str]] = []
    for text, unit in DELAYS:
        delay = Delay(f"{{{text}}}", None, Expression.parse(text), unit)
        assert delay.expression is not None
        for memory in memories():
            seconds, _ = compute_delay(delay, environment(memory)[0])
            tries.append((delay_code(delay.expression, unit), memory))
            expected.append((seconds, f"{text} in {unit} with {memory}"))
    for (result, _), (ours, what) in zip(in_node(tries), expected, strict=True):
        assert (None if result == "" else round(float(result.removesuffix("ms")) / 1000, 6)) == ours, what
