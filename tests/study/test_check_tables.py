"""`[[check]]` of study.toml: what a check can say beside what it looks at."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.study.study_toml import load_study
from tests.checks.samples import DESIGN, script


def findings(path: Path, *lines: str) -> list[str]:
    """What is found in a study with one check, without its file and line."""
    (path / "study.toml").write_text(DESIGN + '[[check]]\nid = "a"\n' + "\n".join(lines))
    loaded = load_study(path, check_scenarios=False)
    return [f"{each.severity} {each.code}: {each.message}" for each in loaded.diagnostics]


@pytest.mark.parametrize(("text", "seconds"), [("30 s", 30.0), ("2 min", 120.0), ("1h", 3600.0)])
def test_a_limit(tmp_path: Path, text: str, seconds: float) -> None:
    assert findings(tmp_path, 'auto = "robot"', f'limit = "{text}"') == []
    study = load_study(tmp_path, check_scenarios=False).study
    assert study is not None and study.checks[0].limit == seconds


@pytest.mark.parametrize("text", ["0 s", "61 min", "long", "30"])
def test_a_limit_that_is_none(tmp_path: Path, text: str) -> None:
    assert findings(tmp_path, 'auto = "robot"', f'limit = "{text}"') == [
        f"error wrong-value: `{text}` is not a limit of a check; write 30 s or 2 min, up to 1 h"
    ]


def test_what_goes_with_what(tmp_path: Path) -> None:
    assert findings(tmp_path, 'ask = "The lamp is on"', 'limit = "30 s"') == [
        "error check-form: `limit` goes with auto and run: a person may take their time"
    ]
    assert findings(tmp_path, 'auto = "consent"', 'every = "30 d"') == [
        'error check-form: `every` does not go with auto = "consent": that one participant passed says nothing about '
        "the next"
    ]


def test_a_program_that_cannot_be_started_is_a_warning_where_it_stands(tmp_path: Path) -> None:
    script(tmp_path, "check.sh")
    assert findings(tmp_path, 'run = ["./check.sh"]') == []
    assert findings(tmp_path, 'run = ["./chek.sh"]') == [
        "warning no-program: there is no program ./chek.sh in the study's folder; did you mean `check.sh`?"
    ]
    (found,) = load_study(tmp_path, check_scenarios=False).diagnostics
    assert str(found).startswith(f"study.toml:{DESIGN.count(chr(10)) + 3}:7: ")
