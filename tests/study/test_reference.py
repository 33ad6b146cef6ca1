"""docs/reference/study.md is true: its examples are run, and it has every code, key and kind."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import rise_engine.study
from rise_engine.study.balance import prove_balance
from rise_engine.study.chance import Chance
from rise_engine.study.checks import _KEYS as CHECK_KEYS
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.participants import load_participants
from rise_engine.study.plan import make_plan
from rise_engine.study.plan_file import plan_text
from rise_engine.study.study_log import EntryKind
from rise_engine.study.study_scenarios import _FACTOR_KEYS as FACTOR_KEYS
from rise_engine.study.study_toml import _ASSIGNMENT_KEYS as ASSIGNMENT_KEYS
from rise_engine.study.study_toml import BETWEEN, TOP_KEYS, WITHIN, load_study
from tests.scenario.folders import SPEECH, act, folder
from tests.study.designs import SCENARIO

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "study.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
TOML = "\n".join(text for kind, text in BLOCKS if kind == "toml")
(PYTHON,) = [text for kind, text in BLOCKS if kind == "python"]


def test_the_example_is_a_study_and_its_participants_plan_and_proof_are_those_of_the_page(tmp_path: Path) -> None:
    more: dict[str, str | bytes] = {
        name.replace("scenario/", f"{scenario}/"): text
        for scenario in ("scenario", "scenario-babble")
        for name, text in SCENARIO.items()
    }
    more |= {
        f"{name}/{file}": text
        for name in ("scenario", "scenario-babble")
        for file, text in {
            "memory.json": '{"hesitation": false, "distraction": false}',
            "acts/tell.xml": act(SPEECH.replace("Hello", "{hesitation}, {distraction}"), "Tell"),
        }.items()
    }
    (people,) = [text for _, text in BLOCKS if text.startswith("participant,")]
    folder(tmp_path, {**more, "study.toml": TOML.replace('"real"', '"debug"'), "participants.csv": people})
    loaded = load_study(tmp_path)
    assert [str(each) for each in loaded.diagnostics] == []
    assert loaded.study is not None
    read = load_participants(loaded.study)
    assert ([each.participant for each in read.participants], read.diagnostics) == (["P01", "P02"], [])
    plan = make_plan(loaded.study)
    (rows,) = [text for _, text in BLOCKS if text.startswith("slot,")]
    assert plan_text(loaded.study, plan).startswith(rows)
    (proof,) = [text for _, text in BLOCKS if " slots for " in text]
    assert "\n".join(prove_balance(loaded.study, plan).lines) == proof.strip()


def test_the_ten_lines_of_chance_are_ours() -> None:
    printed = subprocess.run([sys.executable, "-c", PYTHON], capture_output=True, text=True, check=True).stdout
    assert printed == f"{Chance(20261122, 'block', 'language=de', 0).shuffle(['yes', 'no'])}\n"
    names: dict[str, object] = {}
    exec(PYTHON.replace("print", "str"), names)
    for number in range(20):
        ours = Chance(number, "a", "b").shuffle(range(7))
        assert names["shuffle"](f"{number}/a/b", range(7)) == ours  # type: ignore[operator]


def test_every_code_is_documented() -> None:
    codes = {"table-form", "unreadable"}
    for path in Path(rise_engine.study.__file__).parent.glob("*.py"):
        text = path.read_text("utf-8")
        codes.update(re.findall(r"\.(?:error|warning|report_[a-z]+)\(\s*\"([a-z]+(?:-[a-z]+)+)\"", text))
        codes.update(re.findall(r"\.report\([^\"()]*\"[a-z]+\", \"([a-z]+(?:-[a-z]+)+)\"", text))
        codes.update(re.findall(r"\.report\([^\"()]*\"([a-z]+(?:-[a-z]+)+)\"", text))
    rows = re.findall(r"^- ((?:`[a-z-]+`(?:,\s+)?)+): ", PAGE.partition("## Diagnostics")[2], re.MULTILINE)
    documented = {code for row in rows for code in re.findall(r"[a-z-]+", row)}
    assert codes | {"no-program"} == documented


def test_every_key_and_kind_is_documented() -> None:
    words = [
        *TOP_KEYS,
        *ASSIGNMENT_KEYS,
        *CHECK_KEYS,
        *FACTOR_KEYS,
        *BETWEEN,
        *WITHIN,
        *AUTOMATIC,
        *get_args(EntryKind),
    ]
    assert [word for word in words if f"`{word}" not in PAGE and f"[{word}" not in PAGE] == []
