"""Who takes part, and in which condition."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Condition, Mode
from rise_engine.scenario.reading.conditions import (
    condition_label,
    condition_memory,
    condition_problem,
    condition_sentence,
    study_conditions,
)
from rise_engine.scenario.reading.scenario_toml import TOP_KEYS
from tests.scenario.folders import SPEECH, act, found, loaded, rule

GREETING = Path(__file__).parents[2] / "scenarios" / "greeting"


@pytest.mark.parametrize(
    ("study", "condition", "problem"),
    [
        ({}, "", ""),
        ({"conditions": ["A", "B"]}, "", ""),
        (
            {},
            "calm",
            "no conditions, and 'calm' alone would change nothing that the robot does; in scenario.toml, write",
        ),
        ({"conditions": "A"}, "A", "write under [conditions.A] what it sets"),
        (
            {"conditions": ["A", "B"]},
            "B",
            "the condition `B` is only a name; in scenario.toml, write under [conditions.B]",
        ),
        ({"conditions": ["hesitation", "no hesitation"]}, "hesitaton", "did you mean `hesitation`?"),
        ({"conditions": ["A", "B"]}, "C", "it has `A`, `B`"),
        ({"conditions": ["A", 2]}, "2", "it has `A`"),
    ],
)
@pytest.mark.parametrize("mode", ["debug", "real"])
def test_no_session_begins_in_a_name(study: dict[str, object], condition: str, problem: str, mode: Mode) -> None:
    """As scenarios of earlier versions have them. Without a condition they run as they did."""
    scenario = load(GREETING).scenario
    assert scenario is not None
    scenario = replace(scenario, study=study, mode=mode)
    found = condition_problem(scenario, condition)
    assert problem in found and bool(problem) == bool(found)
    assert all(isinstance(one, str) for one in study_conditions(scenario))


CONDITIONS = {
    "A": Condition({"x": 1, "form": {"kind": "short"}}, label="blue"),
    "B": Condition({"x": 2, "long": "y" * 50}),
    "light": Condition(label_only=True),
}


@pytest.mark.parametrize(
    ("mode", "condition", "problem"),
    [
        ("debug", "A", ""),
        ("real", "light", ""),
        ("debug", "", ""),
        ("real", "", "a real session is run in a condition of the study: name one of `A`, `B`, `light`"),
        ("real", "a", "this study has no condition 'a'; did you mean `A`?"),
        ("debug", "zzzz", "it has `A`, `B`, `light`"),
    ],
)
def test_a_session_is_run_in_a_condition_of_the_scenario(mode: Mode, condition: str, problem: str) -> None:
    scenario = load(GREETING).scenario
    assert scenario is not None
    scenario = replace(scenario, conditions=CONDITIONS, mode=mode)
    found = condition_problem(scenario, condition)
    assert problem in found and bool(problem) == bool(found)
    assert study_conditions(scenario) == ("A", "B", "light")


def test_what_a_condition_sets_and_how_it_is_called() -> None:
    scenario = load(GREETING).scenario
    assert scenario is not None
    scenario = replace(scenario, conditions=CONDITIONS)
    assert condition_memory(scenario, "A") == {"x": 1, "form": {"kind": "short"}}
    assert (
        condition_memory(scenario, "light") == condition_memory(scenario, "") == condition_memory(scenario, "?") == {}
    )
    assert [condition_label(scenario, name) for name in ("A", "B", "", "?")] == ["blue", "B", "", "?"]
    sentences = [condition_sentence(condition) for condition in CONDITIONS.values()]
    assert sentences[0] == 'sets x = 1, form = {"kind": "short"}'
    assert sentences[1] == f'sets x = 2, long = "{"y" * 38}…'
    assert sentences[2].startswith("sets nothing: the difference lies outside")


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ('participants = 24\nconditions = ["A", "B"]', ["3:15 bare-condition", "3:20 bare-condition"]),
        ('condition = ["A", "B"]', ["2:1 unknown-key"]),
        ("participant = 3", ["2:1 unknown-key"]),
        ('participants = "24"', ["2:16 wrong-type"]),
        ("participants = true", ["2:16 wrong-type"]),
        ("participants = 0", ["2:16 out-of-range"]),
        ('conditions = "A"', ["2:14 wrong-type"]),
        ('conditions = ["A", 2]', ["2:14 wrong-type"]),
        ("conditions = []", ["2:14 missing-value"]),
        ('conditions = ["A", " "]', ["2:14 missing-value"]),
        ('conditions = ["A", "B", "A"]', ["2:14 duplicate-name"]),
    ],
)
def test_what_a_study_says_is_checked(tmp_path: Path, table: str, expected: list[str]) -> None:
    result = loaded(tmp_path, {"scenario.toml": f"[study]\n{table}\n"})
    assert found(result) == [f"scenario.toml:{each}" for each in expected]


# A table of scenario.toml, with `_` for an entry that it does not have, and what is meant by that.
TABLES = {
    "titel = 'T'": "title",
    "[stdy]\nparticipants = 3": "study",
    "[study]\ncondition = ['A']": "conditions",
    "[study]\nparticpants = 3": "participants",
    "[conditions.A]\nlabl = 'a'\nlabel_only = true": "label",
    "[keys]\na = { rul = 'R' }": "rule",
    "[act.A]\nholt = true": "hold",
    "[act.A]\ncallingType = 'None'": "calling_type",
    "[fillers]\noffer = 3": "offer_after",
    "[control]\nmay_releas = ['/supervisor']": "may_release",
    "[check]\nalow = []": "allow",
    "[check]\nallow = [{ code = 'unset-key', key = 'k', reason = 'r', resaon = 'r' }]": "reason",
    "[languages]\nalos = ['de']": "also",
    "[explore]\nfault = 2": "faults",
    "[cue]\nkep = '3s'": "keep",
    "[trials]\nstate = 'S'\ncolumn = ['k']": "columns",
    "[eventually]\nit_ends = { then = 'true', afer = 'true' }": "after",
    "[actions.Drive]\nchanels = ['base']": "channels",
    "[actions.Drive]\nchannels = ['base']\nparameters.place = { type = 'text', requird = true }": "required",
    "[actions.Drive.parameters.place]\ntype = 'number'\nminimun = 3": "minimum",
    "[actions.LookAt.parameters.pointx]\ntype = 'number'\ndefualt = 3": "default",
}


@pytest.mark.parametrize("toml", TABLES)
def test_no_table_takes_an_entry_that_nobody_reads(tmp_path: Path, toml: str) -> None:
    """A slip names the right entry, at its place, and the scenario is refused."""
    files = {"scenario.toml": toml, "acts/a.xml": act(SPEECH), "rules/r.xml": rule('<State id="S"/>')}
    result = loaded(tmp_path, {**files})
    unknown = [each for each in result.diagnostics if each.code == "unknown-key"]
    assert len(unknown) == 1 and result.scenario is None
    wrong = unknown[0].message.split("`")[1]
    assert f"did you mean `{TABLES[toml]}`?" in unknown[0].message
    place = unknown[0].location
    assert toml.split("\n")[place.line - 1][place.column - 1 :].startswith(wrong)


def test_every_table_is_tried() -> None:
    """Who adds a table to scenario.toml adds it above."""
    tried = {found[1] for toml in TABLES if (found := re.match(r"\[(\w+)", toml))}
    assert {*TOP_KEYS} - {
        "title",
        "language",
        "robot",
        "mode",
        "acts",
        "rules",
        "memory",
        "on_failure",
        "private",
        "places",  # the check of the robot's profile warns of what no carrier takes
        "always",  # here and in the next, the entries have names of the author's own
        "reachable",
    } <= tried
