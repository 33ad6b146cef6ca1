"""The study of docs/tutorials/greeting-from-nothing.md, built key by key, does what the shipped study does.

The keys are in `greeting.md` beside this file, in the form of a tutorial. The film is made from
them, too.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests import chance
from tests.tutorials.player import play
from tests.tutorials.shell import shell

pytestmark = [pytest.mark.slow, pytest.mark.pty, *chance.searched]

ROOT = Path(__file__).parents[2]
KEYS = Path(__file__).with_name("greeting.md")
SHIPPED = ROOT / "scenarios" / "greeting"
OTHER = {"scenario_hash", "priority", "expression"}
"""What differs: the files, a priority that all rules share, and the words that count as a greeting."""


def records(folder: Path) -> list[dict[str, Any]]:
    """Of the shipped study's written session, played in this folder."""
    command = [str(Path(sys.executable).parent / "rise-engine"), "run", str(folder),
               "--tasks", str(SHIPPED / "session.jsonl"), "--speed", "max", "--seed", "1", "--json"]  # fmt: skip
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [{key: value for key, value in json.loads(line).items() if key not in OTHER} for line in lines]


def test_the_greeting_from_nothing(tmp_path: Path) -> None:
    with shell(tmp_path, chance.one_of((80, 24), (120, 40))) as terminal:
        play(KEYS.read_text(), terminal, between=0)
    built = tmp_path / "lab" / "greeting"
    found, shipped = records(built), records(SHIPPED)
    assert len(shipped) > 1000 and len(found) == len(shipped)
    different = [(one, other) for one, other in zip(found, shipped, strict=True) if one != other]
    assert different == []
    assert len(list((built / "tests").glob("*.jsonl"))) == 1
