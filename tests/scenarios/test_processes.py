"""The scenarios of this repository as a user runs them: `rise-engine` as a process of its own."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from tests.scenarios.conftest import Play
from tests.scenarios.played import SCENARIOS, Played, command, process

pytestmark = pytest.mark.slow

NAMES = ("greeting", "lab_opening", "lablinking")
every_scenario = pytest.mark.parametrize("name", NAMES)


@every_scenario
def test_check_finds_nothing(name: str) -> None:
    result = process(["check", str(SCENARIOS / name), "--json"])
    assert result.returncode == 0
    assert json.loads(result.stdout)["findings"] == []


@every_scenario
def test_a_process_gives_the_same_session_whatever_its_hash_seed(name: str, play: Play) -> None:
    """Same scenario, same seed, same inputs: the same outputs, byte for byte (semantics.md 0)."""
    other = process(command(name, "--strict"), PYTHONHASHSEED="2", TZ="Asia/Tokyo", LC_ALL="C")
    assert (other.returncode, other.stderr) == (0, b"")
    session = Played(other.stdout)
    session.check_sound()
    assert session.timeless() == play(name).timeless()


@every_scenario
def test_another_seed_changes_words_but_not_the_order_of_the_acts(name: str, play: Play) -> None:
    sessions = [play(name), *(play(name, "--seed", str(seed)) for seed in (2, 3, 4))]
    for session in sessions:
        session.check_sound()
    told = {tuple(session.said()) for session in sessions}
    assert len(told) > 1
    speaking = {
        tuple(act for act in session.acts() if act not in ("R_FollowGaze", "R_Nod", "R_Smile")) for session in sessions
    }
    assert len(speaking) == 1


@every_scenario
def test_the_readable_account_tells_what_was_said(name: str, play: Play) -> None:
    arguments = [argument for argument in command(name) if argument != "--json"]
    result = process(arguments)
    assert result.returncode == 0
    for message in play(name).said():
        assert message[:20].encode() in result.stdout


@every_scenario
def test_every_act_and_rule_has_a_key_or_is_begun_by_a_rule(name: str) -> None:
    scenario = load(SCENARIOS / name).scenario
    assert scenario is not None
    bound = {binding.behavior for binding in scenario.keys.values()}
    assert set(scenario.acts) <= bound
    started_by_rules = {"Gaze", "Listening"}
    assert set(scenario.rules) - started_by_rules <= bound


@every_scenario
def test_the_readme_names_every_key(name: str) -> None:
    text = (SCENARIOS / name / "README.md").read_text(encoding="utf-8")
    with Path(SCENARIOS / name / "scenario.toml").open("rb") as file:
        keys = tomllib.load(file)["keys"]
    words = {word.strip("*|,:()") or word.strip("*|") for word in text.split()}
    assert [key for key in keys if key not in words] == []


@every_scenario
def test_stop_all_in_the_middle_stops_everything_and_nothing_starts_after_it(name: str, tmp_path: Path) -> None:
    script = tmp_path / "stopped.jsonl"
    lines = (SCENARIOS / name / "session.jsonl").read_text(encoding="utf-8").splitlines()
    tasks = sorted([*map(json.loads, lines), {"function_type": "stopAll", "at": 10}], key=lambda task: task["at"])
    script.write_text("\n".join(map(json.dumps, tasks)), encoding="utf-8")
    session = Played(process(command(name, script=script)).stdout)
    stopped = session.time_of("stop", status="latched")
    assert 10 <= stopped < 12
    assert [record for record in session.of("action", status="started") if record["t"] > stopped] == []
    assert session.of("rule", status="stopped") != []
    late = [record for record in session.of("task") if record["t"] > stopped and record["function"].startswith("start")]
    assert {record["status"] for record in late} <= {"REJECTED"}
