"""`rise-engine serve --study` and what goes with it, as a lab uses it: real processes, real signals."""

from __future__ import annotations

import json
import signal
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rise_engine.session.folder import find_unfinished, running_sessions
from tests.cli.processes import engine
from tests.patience import PATIENCE
from tests.study.invariants import check_day, first_input, log_lines
from tests.study.studies import DESIGN, write_study

from .test_serve import Serving, root

__all__ = ["root"]
pytestmark = pytest.mark.slow


@pytest.fixture
def study(root: Path) -> Path:
    write_study(root / "study")
    return root / "study"


class Session(Serving):
    """One that has begun: its first input is on the disk."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)
        assert self.report, self.said
        self.wait_until(lambda: first_input(self.record) is not None)

    def wait_until(self, condition: Callable[[], bool]) -> None:
        """Until its process has got so far."""
        limit = time.monotonic() + PATIENCE
        while not condition():
            assert self.process.poll() is None and time.monotonic() < limit
            time.sleep(0.005)


def serving(study: Path, participant: str, *more: str) -> Session:
    return Session("--study", study, "--participant", participant, *more)


def state_of(study: Path, participant: str) -> tuple[str, int | None, int]:
    """State, next run and attempt, as `study status --json` has them."""
    status = json.loads(engine("study", "status", study, "--json").stdout)
    found: dict[str, Any] = next(each for each in status["participants"] if each["participant"] == participant)
    return found["state"], found["next_run"], found["next_attempt"]


def test_a_session_from_its_command_to_its_outcome(study: Path) -> None:
    it = serving(study, "P01")
    assert it.record.parent == study / "sessions"
    assert it.record.name[18:] == "P01_hesitation_real"
    info = tomllib.loads((it.record / "session.toml").read_text("utf-8"))
    assert (info["study"], info["slot"], info["run"], info["attempt"], info["purpose"]) == (
        "hesitation",
        1,
        1,
        1,
        "counted",
    )
    assert info["factors"].keys() == {"hesitation", "noise"} and info["participant"] == "P01"
    assert state_of(study, "P01")[0] == "running"
    assert it.end(signal.SIGTERM) == 0
    assert state_of(study, "P01")[0] == "to-judge"
    refused = engine("serve", "--study", study, "--participant", "P01")
    assert refused.returncode == 1 and f"study outcome {study} P01 complete | aborted | excluded" in refused.stderr
    judged = engine("study", "outcome", study, "P01", "aborted", "--reason", "fire alarm")
    assert (judged.returncode, judged.stdout) == (0, f"{it.record.name}: aborted\n")
    assert state_of(study, "P01") == ("aborted", 1, 2)
    assert [line["kind"] for line in log_lines(study)] == ["planned", "taken", "session", "outcome"]
    again = serving(study, "P01")
    started = first_input(again.record)
    assert started is not None and (started.slot, started.run, started.attempt) == (1, 1, 2)
    assert again.end() == 0
    check_day(study)


def test_one_session_at_a_time_and_nobody_is_led_into_somebody_elses(study: Path) -> None:
    it = serving(study, "P01")
    own = engine("serve", "--study", study, "--participant", "P01")
    assert own.returncode == 3 and "their own session is running" in own.stderr
    other = engine("serve", "--study", study, "--participant", "P02")
    assert other.returncode == 1 and "the session of P01 is running (run 1, begun 20" in other.stderr
    scenario = engine("serve", study / "scenario", "--mode", "debug")
    assert scenario.returncode == 3 and it.record.name in scenario.stderr, "it is the same robot"
    excluded = engine("study", "exclude", study, "P01", "no")
    assert excluded.returncode == 1 and "end it first" in excluded.stderr
    assert list(running_sessions(root=study / "sessions")) == [it.record]
    assert engine("stop", study).returncode == 0 and it.wait() == 0
    assert [line["kind"] for line in log_lines(study)] == ["planned", "taken", "session"]


def test_after_a_crash_it_goes_on_or_is_given_up(study: Path) -> None:
    it = serving(study, "P01")
    it.end(signal.SIGKILL)
    assert find_unfinished(root=study / "sessions") == [it.record]
    asked = engine("serve", "--study", study, "--participant", "P01")
    assert asked.returncode == 4
    assert "a session of P01 did not end" in asked.stderr and "participant P01, condition" in asked.stderr
    assert str(it.record) in asked.stderr and "--recover" in asked.stderr
    elsewhere = engine("serve", "--study", study, "--participant", "P02", "--session", it.record.name)
    assert elsewhere.returncode == 2 and "is the session of P01, not of P02" in elsewhere.stderr
    again = serving(study, "P01", "--recover")
    assert again.record == it.record
    again.wait_until(lambda: b'"status":"recovered"' in (it.record / "journal.jsonl").read_bytes())
    again.end(signal.SIGKILL)
    by_its_name = Session(study / "scenario", "--session", it.record)
    assert by_its_name.record == it.record, "a session of a study goes on as one, also when nobody names the study"
    by_its_name.end(signal.SIGKILL)
    new = serving(study, "P01", "--new")
    assert new.record != it.record and (it.record / "abandoned").exists()
    started = first_input(new.record)
    assert started is not None and (started.slot, started.run, started.attempt) == (1, 1, 2)
    assert [(line["session"], line["status"]) for line in log_lines(study) if line["kind"] == "outcome"] == [
        (it.record.name, "aborted")
    ]
    assert new.end() == 0
    check_day(study)


def test_a_crash_holds_up_nobody_else(study: Path) -> None:
    serving(study, "P01").end(signal.SIGKILL)
    other = serving(study, "P02")
    started = first_input(other.record)
    assert started is not None and started.slot == 2
    assert other.end() == 0
    status = engine("study", "status", study).stdout
    assert "P01, run 1, attempt 1, begun 20" in status and "its engine has gone" in status


def test_what_does_not_count_takes_no_slot(study: Path) -> None:
    for options, purpose, end in (
        (("--participant", "P01", "--mode", "debug"), "debug", "P01_hesitation_debug"),
        (("--participant", "P01", "--pilot"), "pilot", "P01_hesitation_real_pilot"),
        (("--training", "--condition", "no+loud"), "training", "hesitation_real_training"),
    ):
        it = Session("--study", study, *options)
        assert it.record.name[18:] == end
        started = first_input(it.record)
        assert started is not None and (started.purpose, started.slot) == (purpose, None)
        assert it.end() == 0
    assert [line["kind"] for line in log_lines(study)] == ["planned", "session", "session", "session"]
    assert "not counted: 1 debug, 1 pilot, 1 training" in engine("study", "status", study).stdout
    assert state_of(study, "P01") == ("waiting", 1, 1)


def test_run_plays_what_they_would_have_and_keeps_nothing(study: Path) -> None:
    run = ("run", "--study", study, "--participant", "P01", "--act", "Greet", "--speed", "max", "--json")
    records = [json.loads(line) for line in engine(*run).stdout.splitlines()]
    assert (records[0]["mode"], records[0]["purpose"], records[0]["slot"]) == ("debug", "debug", None)
    memory = {each["key"]: each["value"] for each in records if each["kind"] == "memory" and each["source"] == "study"}
    assert memory.keys() == {"hesitation", "noise"}
    assert engine(*run).stdout.count("\n") == len(records)
    assert not (study / "sessions").exists() and [line["kind"] for line in log_lines(study)] == ["planned"]
    assert "use either DIR or --study" in engine("run", study / "scenario", "--study", study).stderr
    real = engine("run", "--study", study, "--participant", "P01", "--mode", "real")
    assert real.returncode == 2 and "serve --study" in real.stderr
    other = engine("run", "--study", study, "--participant", "P01", "--set", "noise=7")
    assert other.returncode == 2 and "`noise` cannot be set together with the condition" in other.stderr


def test_finished_sessions_are_listed(study: Path, root: Path) -> None:
    it = serving(study, "P01")
    it.end()
    engine("study", "outcome", study, "P01", "complete")
    Session(study / "scenario", "--mode", "debug", "--participant", "Test 7").end()
    listed = engine("sessions", study).stdout.splitlines()
    assert listed[0].split() == ["when", "participant", "condition", "run", "outcome", "length", "mode", "folder"]
    assert (
        len(listed) == 2 and listed[1].split()[2] == "P01" and "complete" in listed[1] and it.record.name in listed[1]
    )
    (found,) = json.loads(engine("sessions", study, "--json").stdout)
    assert (found["participant"], found["run"], found["outcome"], found["status"]) == ("P01", 1, "complete", "ended")
    everything = engine("sessions", "--all").stdout
    assert "Test 7" in everything and "_Test-7_sample_debug" in everything and it.record.name not in everything
    of_scenario = engine("sessions", study / "scenario").stdout
    assert "_Test-7_sample_debug" in of_scenario
    assert engine("sessions", root / "nowhere").returncode == 2


def test_checks_are_the_first_inputs_and_stand_in_the_record(root: Path) -> None:
    study = root / "study"
    write_study(study, DESIGN + '\n[[check]]\nid = "lights"\nask = "The lamp is on"\n')
    refused = engine("serve", "--study", study, "--participant", "P01")
    assert refused.returncode == 1 and "lights" in refused.stderr
    assert [line["kind"] for line in log_lines(study) if line["kind"] != "checked"] == ["planned"]
    it = serving(study, "P01", "--confirm", "lights")
    assert it.end() == 0
    lines = [json.loads(line) for line in (it.record / "journal.jsonl").read_bytes().splitlines()]
    inputs = [line for line in lines if line.get("input", "robot") != "robot"]
    assert [each["input"] for each in inputs[:2]] == ["session_started", "check"]
    assert (inputs[1]["id"], inputs[1]["result"]) == ("lights", "passed")
    engine("study", "outcome", study, "P01", "aborted", "--reason", "alarm")
    serving(study, "P01", "--confirm", "lights").end(signal.SIGKILL)
    assert engine("serve", "--study", study, "--participant", "P01").returncode == 4, "first it is said what is open"
    refused = engine("serve", "--study", study, "--participant", "P01", "--new")
    assert refused.returncode == 1 and "lights" in refused.stderr
    assert state_of(study, "P01")[0] == "unfinished", "nothing was given up for a session that did not begin"
    assert serving(study, "P01", "--new", "--confirm", "lights").end() == 0


def test_what_a_factor_sets_cannot_be_set_beside_it(study: Path) -> None:
    refused = engine("serve", "--study", study, "--participant", "P01", "--set", "noise=7", "--set", "x=1")
    assert refused.returncode == 2
    assert refused.stderr.splitlines()[0] == "`noise` cannot be set: a factor of the study says what it is"
    assert [line["kind"] for line in log_lines(study)] == ["planned"]


def test_next_says_with_which_command(study: Path) -> None:
    found = engine("study", "next", study)
    assert found.returncode == 0 and found.stdout.startswith("next: P01, run 1 of 2, slot 1, condition ")
    assert f"rise-engine serve --study {study} --participant P01" in found.stdout
    (study / "participants.csv").write_text("participant,consent_study\nP01,\n", "utf-8")
    nobody = engine("study", "next", study)
    assert nobody.returncode == 1 and "P01 has not consented" in nobody.stdout
