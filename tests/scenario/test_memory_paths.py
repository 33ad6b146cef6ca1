"""Memory paths in texts, conditions and assignments are followed into the start values, as deep as they go."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.expression import assigned_entry, lookup
from rise_engine.expression.errors import EvaluationError
from rise_engine.scenario.checking.memory_paths import MemoryPaths
from rise_engine.scenario.model import Json
from tests.scenario.folders import act, found, in_state, loaded

MEMORY = """{"WorkingMemory": [
  {"texts": {"negation": ["no", "not", "never"], "greeting": {"warm": "Hello!", "short": "Hi"}, "none": []}},
  {"person": null}, {"count": 3}, {"flat.key": 1}, {"pose": {"x": 1, "inner": null}}
]}"""

# What a text reads, and the message about it; empty: none.
READS = {
    "texts.negation.0": "",
    "texts.negation.2": "",
    "texts.greeting.warm": "",
    "flat.key": "",
    "person.name": "",  # null: it is still to come
    "person.name.first": "",
    "pose.inner.deep.er": "",
    "written.age.deep": "",
    "pose.way.x": "",
    "texts.negation.3": "`texts.negation` is a list with the entries `texts.negation.0` to `texts.negation.2`",
    "texts.negation.9": "`texts.negation` is a list with the entries `texts.negation.0` to `texts.negation.2`",
    "texts.none.0": "`texts.none` is a list without entries",
    "texts.negatoin.1": "did you mean `texts.negation.1`?",
    "texts.negatoin.7": "did you mean `texts.negation`?",
    "texts.greting.warm": "did you mean `texts.greeting.warm`?",
    "texts.greeting.arm": "did you mean `texts.greeting.warm`?",
    "texts.greeting.warm.er": '`texts.greeting.warm` is the text "Hello!", which has nothing inside',
    "count.x": "`count` is the number 3, which has nothing inside",
    "pose.z": "known: `pose.x`, `pose.inner`",
}


@pytest.mark.parametrize("key", READS)
def test_a_text_names_a_path(tmp_path: Path, key: str) -> None:
    result = loaded(
        tmp_path,
        {
            "acts/a.xml": act(f"<Speech><actionID>1</actionID><message>Well: {{{key}}}</message></Speech>"),
            "scenario.toml": '[keys]\na = { set = "written = 1" }\nb = { set = "pose.way.x = 2" }\n',
            "memory.json": MEMORY,
        },
    )
    expected = READS[key]
    assert found(result) == (["acts/a.xml:2:46 unknown-path"] if expected else []), result.diagnostics
    if expected:
        message = result.diagnostics[0].message
        assert message.startswith(f"the memory never has `{key}`")
        assert "nothing in this scenario sets it" in message and expected in message


def test_a_fallback_needs_no_path(tmp_path: Path) -> None:
    text = "<Speech><actionID>1</actionID><message>{texts.negation.9|no} {count.x|}</message></Speech>"
    assert found(loaded(tmp_path, {"acts/a.xml": act(text), "memory.json": MEMORY})) == []


def test_parameters_that_are_bare_keys(tmp_path: Path) -> None:
    wait = "<Wait><actionID>1</actionID><duration>{}</duration></Wait>"
    good = loaded(tmp_path / "good", {"acts/a.xml": act(wait.format("pose.x")), "memory.json": MEMORY})
    assert found(good) == []
    bad = loaded(tmp_path / "bad", {"acts/a.xml": act(wait.format("pose.y")), "memory.json": MEMORY})
    assert found(bad) == ["acts/a.xml:2:39 unknown-path"]


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("<if cond=\"texts.greeting.worm = 'Hi'\"/>", ["3:20 unknown-path"]),
        ('<if cond="length(texts.negation.3) &gt; 1"/>', ["3:20 unknown-path"]),
        ('<if cond="texts.negation.1 = texts.greeting.short"/>', []),
        ('<if cond="defined(pose.y)"/>', ["3:20 unset-key"]),
        ('<if cond="defined(pose.y) and pose.y"/>', ["3:20 unknown-path"]),
        ('<if cond="defined(person.name)"/>', []),
        ('<function assignValue="k = pose.y"/>', ["3:33 unknown-path"]),
        ('<function assignValue="k = pose.y + 1"/>', ["3:33 unknown-path"]),
        ('<function assignValue="k = pose.x + 1"/>', []),
        ('<function assignValue="pose.y = 1"/><function assignValue="k = pose.y"/>', []),
        ('<function assignValue=\'{"pose": {"y": 2}}\'/><function assignValue="k = pose.y"/>', []),
        ('<function assignValue="texts.negation.1 = 1"/>', []),
        ('<function assignValue="texts.negation.3 = 1"/>', ["3:33 unknown-path"]),
        ('<function assignValue="texts.negation.last = 1"/>', ["3:33 unknown-path"]),
        ('<function assignValue="texts.greeting.warm.er = 1"/>', ["3:33 unknown-path"]),
        ('<function assignValue="texts.greeting.new.er = 1"/>', []),
        ('<function assignValue="person.name = 1"/><function assignValue="k = person.name"/>', []),
    ],
)
def test_rules_name_paths(tmp_path: Path, entry: str, expected: list[str]) -> None:
    result = loaded(tmp_path, {"rules/r.xml": in_state(entry), "memory.json": MEMORY})
    assert found(result) == [f"rules/r.xml:{each}" for each in expected], result.diagnostics


def test_a_key_of_the_keyboard_names_a_path(tmp_path: Path) -> None:
    toml = '[keys]\na = { set = "texts.negation.3 = 1" }\nb = { set = "k = pose.z" }\n'
    result = loaded(tmp_path, {"scenario.toml": toml, "memory.json": MEMORY})
    assert [each.rsplit(" ", 1)[1] for each in found(result)] == ["unknown-path", "unknown-path"]


def test_what_could_not_be_read_is_not_judged(tmp_path: Path) -> None:
    text = "<Speech><actionID>1</actionID><message>{texts.negation.9}</message></Speech>"
    result = loaded(tmp_path, {"acts/a.xml": act(text), "memory.json": MEMORY.replace("null", "nul")})
    assert {diagnostic.code for diagnostic in result.diagnostics} == {"json-syntax"}


START: dict[str, Json] = {"a": {"b": {"c": 1}, "l": [{"x": 1}, 2], "n": None}, "s": "text", "f.g": {"h": 1}}
PARTS = ("a", "b", "c", "l", "n", "s", "x", "0", "1", "2", "f.g", "h")
KEYS = [
    first + second + third
    for first in PARTS
    for second in ("", *("." + p for p in PARTS))
    for third in ("", ".x", ".1")
]


@pytest.mark.parametrize("written", [(), ("a.b",), ("s",), ("a.new.way", "z"), ("a.l.0.y",)])
def test_no_path_that_can_be_is_refused(written: tuple[str, ...]) -> None:
    """Whatever the assignments of the scenario store in whatever order, a refused path stays without a value."""
    paths = MemoryPaths(START, written)
    values: list[Json] = [1, {"c": 2, "x": {"x": 1}}, [1, [5, {"x": 0}], 3]]
    memories = [START]
    for _ in range(2):
        for memory in list(memories):
            for key in written:
                for value in values:
                    try:
                        head, new = assigned_entry(memory, key, value)
                    except EvaluationError:
                        continue
                    memories.append({**memory, head: new})
    for key in KEYS:
        if paths.is_known(key) and paths.reading_problem(key):
            assert not any(lookup(memory, key)[0] for memory in memories), key
        if paths.writing_problem(key):
            with pytest.raises(EvaluationError):
                assigned_entry(START, key, 1)
