"""What makes a condition, and which memory values are private: read, and compared with what else there is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.scenario.model import Condition, Scenario
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from tests.scenario.folders import SPEECH, act, found, loaded, rule

MEMORY = {"hesitation": True, "pause": 600, "form": {"kind": "short"}, "list": [1], "name": None, "unread": 1}
READ = ("hesitation = true", "pause = 1", "form.kind = 1", "list.0 = 1", "name = 'x'")
RULES = rule(f'<State id="S">{"".join(f"""<transition cond="{each}" target="S"/>""" for each in READ)}</State>')
TABLE = "word,number\na,1\n"


def files(toml: str) -> dict[str, str | bytes]:
    return {
        "scenario.toml": toml,
        "memory.json": json.dumps(MEMORY),
        "rules/r.xml": RULES,
        "tables/items.csv": TABLE,
        "acts/a.xml": act(SPEECH.replace("Hello", "{items[0].word}")),
    }


def scenario_of(path: Path, toml: str) -> Scenario:
    result = loaded(path, files(toml))
    assert found(result) == [] and result.scenario is not None
    return result.scenario


def test_a_table_says_what_a_condition_sets(tmp_path: Path) -> None:
    scenario = scenario_of(
        tmp_path,
        '[study]\nconditions = ["no hesitation", "hesitation"]\n'
        '[conditions.hesitation]\nmemory = { hesitation = true, form = { kind = "long" } }\nlabel = "  A  group "\n'
        '[conditions."no hesitation".memory]\nhesitation = false\npause = 0.5\nname = "Anna"\nlist = [2, 3]\n',
    )
    assert list(scenario.conditions) == ["no hesitation", "hesitation"], "in the order of the study"
    one, two = scenario.conditions.values()
    assert one.memory == {"hesitation": False, "pause": 0.5, "name": "Anna", "list": [2, 3]}
    assert two.memory == {"hesitation": True, "form": {"kind": "long"}} and two.label == "A group"
    assert not two.label_only and two.location.line == 3
    assert decode_scenario(encode_scenario(scenario)).conditions == scenario.conditions


def test_without_a_list_the_order_is_that_of_the_file(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path, "[conditions]\nb = { label_only = true }\na.memory.hesitation = false\n")
    assert [(name, each.memory, each.label_only) for name, each in scenario.conditions.items()] == [
        ("b", {}, True),
        ("a", {"hesitation": False}, False),
    ]


def test_a_scenario_of_before_still_loads(tmp_path: Path) -> None:
    result = loaded(tmp_path, files('[study]\nconditions = ["A", "no B"]\n'))
    assert found(result) == ["scenario.toml:2:15 bare-condition", "scenario.toml:2:20 bare-condition"]
    assert result.scenario is not None and result.scenario.conditions == {}
    assert result.scenario.study == {"conditions": ["A", "no B"]}
    assert 'under [conditions."no B"] what it sets' in result.diagnostics[1].message


# What stands in scenario.toml, and what is found: place, code, and a piece of the sentence.
FINDINGS: dict[str, tuple[str, list[tuple[str, str]]]] = {
    "misspelt entry": (
        "[conditions.A]\nmemori = { hesitation = true }",
        [("1:13 missing-value", "sets nothing"), ("2:1 unknown-key", "did you mean `memory`?")],
    ),
    "no table": ("[conditions]\nA = true", [("2:1 wrong-type", "[conditions.A]")]),
    "conditions that are none": ("conditions = 3", [("1:1 wrong-type", "[conditions]")]),
    "memory that is none": ("[conditions.A]\nmemory = 3", [("2:1 wrong-type", "memory = { KEY = VALUE }")]),
    "nothing": ("[conditions.A]", [("1:13 missing-value", "`label_only = true` if it sets nothing")]),
    "empty": ("[conditions.A]\nmemory = {}", [("2:1 missing-value", "the condition `A` sets nothing")]),
    "both": (
        "[conditions.A]\nlabel_only = true\nmemory = { hesitation = true }",
        [("2:1 wrong-value", "so it is not `label_only`")],
    ),
    "label_only that is none": (
        "[conditions.A]\nlabel_only = 1",
        [("1:13 missing-value", "sets nothing"), ("2:14 wrong-type", "true or false")],
    ),
    "empty label": ('[conditions.A]\nlabel_only = true\nlabel = " "', [("3:9 missing-value", "leave it out")]),
    "long label": (
        f'[conditions.A]\nlabel_only = true\nlabel = "{"x" * 25}"',
        [("3:9 out-of-range", "there is room for 24")],
    ),
    "label that is none": ("[conditions.A]\nlabel_only = true\nlabel = 3", [("3:9 wrong-type", "a text")]),
    "label that cannot be shown": (
        '[conditions.A]\nlabel_only = true\nlabel = "a\\u202e"',
        [("3:9 wrong-value", "cannot be shown")],
    ),
    "two that look the same": (
        '[conditions.A]\nlabel_only = true\nlabel = "blue"\n[conditions.B]\nlabel_only = true\nlabel = "blue"\n'
        "[conditions.blue]\nlabel_only = true",
        [
            ("4:13 duplicate-name", "the conditions `A` and `B` as the same, `blue`"),
            ("7:13 duplicate-name", "the conditions `A` and `blue` as the same"),
        ],
    ),
    "two in which the robot does the same": (
        "[conditions.A]\nmemory = { pause = 1, hesitation = true }\n[conditions.B]\n"
        "memory = { hesitation = true, pause = 1 }\n[conditions.C]\nmemory = { hesitation = true }",
        [("3:13 same-condition", "the robot does the same in `A` and `B`")],
    ),
    "names that are none": (
        '[conditions." A"]\nlabel_only = true\n[conditions.""]\nlabel_only = true\n[conditions."\\u0007"]\n'
        "label_only = true",
        [("1:13 bad-name", "no blanks"), ("3:13 bad-name", "no blanks"), ("5:13 bad-name", "can be shown")],
    ),
    "listed without a table": (
        '[study]\nconditions = ["calm", "livly"]\n[conditions.calm]\nlabel_only = true\n'
        "[conditions.lively]\nlabel_only = true",
        [("2:23 unknown-name", "did you mean `lively`?"), ("5:13 unknown-name", "did you mean `livly`?")],
    ),
    "a key that there is not": (
        "[conditions.A]\nmemory = { hesitaton = true }",
        [("2:12 unknown-memory-key", "did you mean `hesitation`?")],
    ),
    "a key that there is not, and none like it": (
        "[conditions.A]\nmemory = { zzz = true }",
        [("2:12 unknown-memory-key", "give it a start value")],
    ),
    "a part of a key": (
        '[conditions.A]\nmemory = { "form.kind" = "long" }',
        [("2:12 unknown-memory-key", "whole memory keys: `form`, not `form.kind`")],
    ),
    "a table as a key": ("[conditions.A]\nmemory = { items = 3 }", [("2:12 read-only", "`items` is a table")]),
    "other types": (
        '[conditions.A]\nmemory = { hesitation = "yes", pause = "x", form = [], list = {}, name = 3 }',
        [
            ("2:12 memory-type", "the start value of `hesitation` is true or false; this is a text"),
            ("2:32 memory-type", "is a number; this is a text"),
            ("2:45 memory-type", "is an object; this is a list"),
            ("2:56 memory-type", "is a list; this is an object"),
        ],
    ),
    "a key that nothing reads": (
        "[conditions.A]\nmemory = { unread = 2 }",
        [("2:12 condition-unread", "changes nothing that the robot does")],
    ),
    "a key of the keyboard changes it": (
        '[conditions.A]\nmemory = { hesitation = true, form = { kind = "x" } }\n'
        '[keys]\nv = { set = "hesitation = false" }\nb = { set = "form.kind = 3" }\nc = { set = "list[0] = 3" }',
        [
            ("4:13 condition-changed", "changes `hesitation`, which the condition `A` sets"),
            ("5:13 condition-changed", "changes `form`"),
        ],
    ),
    "private keys": (
        'private = ["name", "nane", "form.kind", "name"]\n[keys]\nv = { set = "voice = 1" }',
        [
            ("1:20 unknown-memory-key", "did you mean `name`?"),
            ("1:28 unknown-memory-key", "`private` names whole memory keys: `form`, not `form.kind`"),
            ("1:41 duplicate-name", "`name` is listed twice"),
        ],
    ),
    "private that is none": ('private = "name"', [("1:11 wrong-type", 'private = ["person_name"]')]),
    "private with blanks": ('private = ["name", " "]', [("1:11 wrong-type", "a list of memory keys")]),
}


@pytest.mark.parametrize("name", FINDINGS)
def test_what_is_wrong_is_said_at_its_place(tmp_path: Path, name: str) -> None:
    toml, expected = FINDINGS[name]
    result = loaded(tmp_path, files(toml))
    assert found(result) == [f"scenario.toml:{place}" for place, _ in expected]
    for diagnostic, (_, piece) in zip(result.diagnostics, expected, strict=True):
        assert piece in diagnostic.message


def test_everything_is_found_at_once(tmp_path: Path) -> None:
    toml = "".join(
        part if part.startswith("[conditions.") else ""
        for part in (
            "[conditions.A]\nmemory = { hesitaton = true }\n",
            "[conditions.B]\nmemory = { pause = 'x' }\n",
            "[conditions.C]\n",
        )
    )
    codes = [diagnostic.code for diagnostic in loaded(tmp_path, files(toml)).diagnostics]
    assert codes == ["unknown-memory-key", "memory-type", "missing-value"]


def test_a_rule_that_changes_it_is_warned_of(tmp_path: Path) -> None:
    body = '<State id="S"><onEntry><function assignValue="hesitation = not hesitation"/></onEntry></State>'
    toml = "[conditions.A]\nmemory = { hesitation = true }\n"
    result = loaded(tmp_path, {**files(toml), "rules/s.xml": rule(body, name="T")})
    assert [f"{each.location.file} {each.code}" for each in result.diagnostics] == ["rules/s.xml condition-changed"]


def test_what_a_condition_sets_is_known_without_a_start_value(tmp_path: Path) -> None:
    """Neither is it said that nothing sets it, nor are paths into it followed into the start values alone."""
    body = rule('<State id="S"><transition cond="voice = form.kind.of" target="S"/></State>', name="T")
    toml = "[conditions.A]\nmemory = { voice = 'low', form = { kind = { of = 1 } } }\n"
    result = loaded(tmp_path, {**files(toml), "rules/s.xml": body})
    assert found(result) == [] and result.scenario is not None and "voice" in result.scenario.known_keys


def test_nothing_is_missing_in_files_that_cannot_be_read(tmp_path: Path) -> None:
    toml = 'private = ["nobody"]\n[conditions.A]\nmemory = { nothing = true }\n'
    result = loaded(tmp_path, {**files(toml), "rules/s.xml": "<InteractionRule"})
    assert {diagnostic.code for diagnostic in result.diagnostics} == {"not-well-formed"}


def test_private_keys_are_whole_and_known(tmp_path: Path) -> None:
    toml = 'private = ["name", "form", "voice"]\n[keys]\nv = { set = "voice = 1" }\n'
    scenario = scenario_of(tmp_path, toml)
    assert scenario.private == {"name", "form", "voice"}
    assert decode_scenario(encode_scenario(scenario)).private == scenario.private
    assert scenario_of(tmp_path, "").private == frozenset()


def test_the_usual_condition_sets_nothing() -> None:
    assert Condition().memory == {} and not Condition().label_only


def test_the_factors_of_a_study_that_a_scenario_reads_are_known(tmp_path: Path) -> None:
    """Their names the study knows, not the scenario: none is reported. What has a fallback is not missed."""
    body = "".join(
        f'<transition cond="{condition}" target="S"/>'
        for condition in ("session.factors.pace = 'slow'", "session.factors.gaze = session.factors.voice")
    )
    texts = SPEECH.replace("Hello", "{items[0].word} {session.factors.form} {session.factors.place|here}")
    result = loaded(
        tmp_path,
        {**files(""), "rules/s.xml": rule(f'<State id="S">{body}</State>', name="T"), "acts/a.xml": act(texts)},
    )
    assert found(result) == [] and result.scenario is not None
    assert result.scenario.factors_read == {"pace", "gaze", "voice", "form"}
    assert scenario_of(tmp_path / "other", "").factors_read == frozenset()
