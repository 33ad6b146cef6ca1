"""Settings of one act, and of several at once (docs/reference/scenario.md)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.scenario.model import ActSettings
from rise_engine.scenario.reading.act_settings import MAX_PATTERNS
from tests.commands import typed

from .folders import SPEECH, act, loaded

NAMES = ("R_Task1_Step1", "R_Task1_Step2", "R_Task2_Step1", "R_Nod", "R_[odd]")
ACTS = "".join(f'<Dialog name="{name}">{SPEECH}</Dialog>' for name in NAMES)


def settings(folder: Path, toml: str) -> dict[str, ActSettings]:
    scenario, findings = loaded(folder, {"scenario.toml": toml, "acts/a.xml": f"<Dialogs>{ACTS}</Dialogs>"})
    assert scenario is not None, findings
    return scenario.act_settings


KNOWN = ", ".join(f"`{name}`" for name in NAMES)
HOLD, SLOW = ActSettings(hold=True), ActSettings(debounce=2.0)


@pytest.mark.parametrize(
    ("toml", "expected"),
    {
        "one act": ("[act.R_Nod]\nhold = true", {"R_Nod": HOLD}),
        "all": ('[act."*"]\nhold = true', dict.fromkeys(NAMES, HOLD)),
        "any text": ('[act."R_Task*"]\nhold = true', dict.fromkeys(NAMES[:3], HOLD)),
        "any character": ('[act."R_Task?_Step1"]\nhold = true', {NAMES[0]: HOLD, NAMES[2]: HOLD}),
        "one of these": ('[act."R_Task[13]_*"]\nhold = true', {NAMES[0]: HOLD, NAMES[1]: HOLD}),
        "case matters, as in every name": ('[act."R_*"]\n[act."*_Nod"]\nhold = true', {"R_Nod": HOLD}),
        "a name is a name, whatever is in it": ('[act."R_[odd]"]\nhold = true', {"R_[odd]": HOLD}),
        "the act's own table counts first": (
            '[act.R_Nod]\ndebounce = 2.0\n[act."R_No*"]\nhold = true\ndebounce = 9.0',
            {"R_Nod": ActSettings(hold=True, debounce=2.0)},
        ),
        "then what names more": (
            '[act."R_Task1_*"]\ndebounce = 2.0\n[act."R_Task*"]\ndebounce = 9.0',
            {NAMES[0]: SLOW, NAMES[1]: SLOW, NAMES[2]: ActSettings(debounce=9.0)},
        ),
        "then what comes later": ('[act."R_N*"]\ndebounce = 9.0\n[act."*Nod"]\ndebounce = 2.0', {"R_Nod": SLOW}),
        "setting by setting": (
            '[act."R_N*"]\nhold = true\n[act."*_Nod"]\ncalling_type = "none"',
            {"R_Nod": ActSettings(hold=True, calling_type="None")},
        ),
    }.values(),
)
def test_what_holds(tmp_path: Path, toml: str, expected: dict[str, ActSettings]) -> None:
    assert settings(tmp_path, toml) == expected


@pytest.mark.parametrize(
    ("toml", "expected"),
    [
        ('[act."R_Tusk*"]\nhold = true', [f"1:6 unknown-act: no act has a name like `R_Tusk*`; known: {KNOWN}"]),
        ("[act.R_Nodd]\nhold = true", ["1:6 unknown-act: there is no act `R_Nodd`; did you mean `R_Nod`?"]),
        ('[act."R_*"]\nholt = true', ["2:1 unknown-key: unknown key `holt`; did you mean `hold`?"]),
        ('[act."R_*"]\ndebounce = 99', ["2:12 out-of-range: `debounce` is from 0 to 60 seconds"]),
        (
            "\n".join(f'[act."R_N{"?" * n}*"]' for n in range(MAX_PATTERNS + 1)),
            [f"1:6 out-of-range: at most {MAX_PATTERNS} tables are for several acts at once; there are 101"],
        ),
    ],
)
def test_what_is_wrong(tmp_path: Path, toml: str, expected: list[str]) -> None:
    files = {"scenario.toml": toml, "acts/a.xml": f"<Dialogs>{ACTS}</Dialogs>"}
    scenario, findings = loaded(tmp_path, files)
    assert scenario is None
    assert [f"{each.location.line}:{each.location.column} {each.code}: {each.message}" for each in findings] == expected


def test_a_folder_whose_acts_cannot_be_read_says_nothing_about_patterns(tmp_path: Path) -> None:
    _, findings = loaded(tmp_path, {"scenario.toml": '[act."X*"]\nhold = true', "acts/a.xml": act(SPEECH)[:-5]})
    assert "unknown-act" not in {each.code for each in findings}


def test_a_filler_by_pattern_is_one(tmp_path: Path) -> None:
    toml = '[act."R_N*"]\nfiller = true\n[fillers]\nauto_after = 2'
    scenario, findings = loaded(tmp_path, {"scenario.toml": toml, "acts/a.xml": f"<Dialogs>{ACTS}</Dialogs>"})
    assert scenario is not None and findings == []


def test_check_explains_an_act(tmp_path: Path) -> None:
    settings(tmp_path, '[act."R_Task*"]\nhold = true\n[act."R_Task1_*"]\nhold = false')
    shown = typed("check", tmp_path, "--explain", "R_Task1_Step2")
    assert shown.exit_code == 0
    assert shown.output.splitlines()[:3] == [
        "R_Task1_Step2",
        '  hold          false       [act."R_Task1_*"] (scenario.toml:3)',
        "  debounce      0.5         as usual",
    ]
    as_json = typed("check", tmp_path, "--explain", "R_Task2_Step1", "--json")
    assert json.loads(as_json.output)["settings"][0] == {
        "setting": "hold",
        "value": True,
        "table": "R_Task*",
        "line": 1,
    }
    unknown = typed("check", tmp_path, "--explain", "R_Task2_Stepp1")
    assert unknown.exit_code == 2 and "did you mean `R_Task2_Step1`?" in unknown.output
    (tmp_path / "scenario.toml").write_text('[act."X*"]\n', "utf-8")
    refused = typed("check", tmp_path, "--explain", "R_Nod")
    assert refused.exit_code == 1 and "no act has a name like `X*`" in refused.output
