"""What the program looks at without a robot."""

from __future__ import annotations

import os
import shutil
from collections import namedtuple
from datetime import date, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

from rise_engine.checks.automatic import (
    check_clock,
    check_consent,
    check_disk,
    check_participant,
    check_scenario,
    check_wizard,
    is_clock_synchronised,
    size_text,
)
from rise_engine.checks.outcome import Finding
from rise_engine.scenario.loader import load
from rise_engine.study.model import Participant, ParticipantStanding, SessionEntry
from rise_engine.study.study_log import LogEntry
from tests.checks.samples import NOW, checked, study
from tests.cli.processes import folder

Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def free(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The first item is how many bytes are free, the others are which folders were asked about."""
    found: list[Any] = [5_000_000_000]

    def usage(path: Path) -> Usage:
        found.append(path)
        return Usage(10**12, 0, found[0])

    monkeypatch.setattr(shutil, "disk_usage", usage)
    return found


def test_disk_with_room(tmp_path: Path, free: list[Any]) -> None:
    assert check_disk(tmp_path, "") == Finding(True, "5.0 GB free")
    assert check_disk(tmp_path, "5 GB") == Finding(True, "5.0 GB free")


def test_disk_without(tmp_path: Path, free: list[Any]) -> None:
    reason = f"20.0 GB must be free in {tmp_path}"
    assert check_disk(tmp_path, "20 GB") == Finding(False, "5.0 GB free", reason)
    free[0] = 999_999_999
    assert not check_disk(tmp_path, "").passed
    free[0] = 1_000_000_000
    assert check_disk(tmp_path, "").passed


def test_disk_of_a_folder_that_has_still_to_be_made(tmp_path: Path, free: list[Any]) -> None:
    assert check_disk(tmp_path / "study" / "sessions", "").passed
    assert free[1:] == [tmp_path]


def test_disk_that_may_not_be_written(tmp_path: Path, free: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert check_disk(tmp_path, "") == Finding(False, "5.0 GB free", f"{tmp_path} may not be written")


def test_disk_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def usage(path: Path) -> Usage:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(shutil, "disk_usage", usage)
    assert check_disk(tmp_path, "").reason == f"the disk of {tmp_path} does not answer: Input/output error"


def test_sizes_in_words() -> None:
    assert [size_text(size) for size in (0, 1000, 999_949, 999_950, 12_340_000_000, 5_600_000_000_000)] == [
        "0 bytes", "1.0 kB", "999.9 kB", "1.0 MB", "12.3 GB", "5.6 TB",
    ]  # fmt: skip


def entry(started: str) -> SessionEntry:
    return SessionEntry("P01", 1, 1, "counted", "folder", started, "ended")


def test_clock_that_a_server_sets() -> None:
    assert check_clock(NOW, [], [], True) == Finding(True, "2026-11-22 10:00 UTC+01:00, set by a time server")


def test_clock_of_which_nobody_knows_who_sets_it() -> None:
    found = check_clock(NOW, [checked("a", "passed", NOW)], [entry("2026-11-22T08:59:59+00:00")], None)
    assert found.passed and found.value.endswith("whether a time server sets it is not known here")


def test_clock_that_nobody_sets() -> None:
    found = check_clock(NOW, [], [], False)
    assert not found.passed
    assert found.reason == ("no time server has set the clock; connect to one, or set it by hand")


@pytest.mark.parametrize("synchronised", [True, False, None])
@pytest.mark.parametrize("of", ["log", "sessions"])
def test_clock_before_what_was_last_recorded(of: str, synchronised: bool | None) -> None:
    later = "2026-11-22T09:00:01+00:00"  # a second after ten o'clock where the clock is
    log = [checked("a", "passed", later)] if of == "log" else []
    found = check_clock(NOW, log, [entry(later)] if of == "sessions" else [], synchronised)
    assert found.reason == ("that is before what was last recorded in this study (2026-11-22 10:00); set the clock")


def test_clock_and_times_that_are_none() -> None:
    log = [checked("a", "passed", "soon"), checked("a", "passed", "2099-01-01T00:00:00")]
    assert check_clock(NOW, log, [entry("")], True).passed


@pytest.mark.parametrize(("said", "found"), [("yes", True), ("no", False), ("", None), ("perhaps", None)])
def test_timedatectl_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, found: bool | None) -> None:
    program = tmp_path / "timedatectl"
    program.write_text(f'#!/bin/sh\n[ "$*" = "show --property=NTPSynchronized --value" ] && echo {said}\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert is_clock_synchronised() is found


def test_where_there_is_no_timedatectl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert is_clock_synchronised() is None


TODAY = date(2026, 11, 22)


def test_consent() -> None:
    person = Participant("P07", consent={"study": "2026-11-22", "recording": "2026-10-01"})
    assert check_consent(["study", "recording"], person, "P07", TODAY) == Finding(
        True, "study 2026-11-22, recording 2026-10-01"
    )
    assert check_consent([], person, "P07", TODAY) == Finding(True, "the study asks for no consent")


def test_consent_that_is_missing_says_all_of_it() -> None:
    person = Participant("P07", consent={"study": "", "recording": "2026-11-23", "video": "yes"}, line=8)
    assert check_consent(["study", "recording", "video", "sound"], person, "P07", TODAY) == Finding(
        False,
        reason="P07: consent_study has no date; consent_recording is 2026-11-23, which is still to come; "
        "consent_video is 'yes', which is not a date such as 2026-11-22; consent_sound has no date; "
        "see participants.csv (line 8)",
    )


def test_consent_of_somebody_unknown() -> None:
    assert check_consent(["study"], None, "P99", TODAY) == Finding(
        False, reason="P99 is not in participants.csv, so nothing is known of consent"
    )


def standing(state: Any, **more: Any) -> ParticipantStanding:
    return ParticipantStanding("P07", state, **({"next_run": 1, "runs": 2} | more))


LISTED = [Participant("P06"), Participant("P07")]


def test_participant_who_may_begin() -> None:
    found = check_participant("P07", LISTED, standing("waiting"), 0)
    assert found == Finding(True, "P07, run 1 of 2")
    again = standing("aborted", next_run=2, next_attempt=2)
    assert check_participant("P07", LISTED, again, 2) == Finding(True, "P07, run 2 of 2, attempt 2")
    # Consent is another check's, which says more about it.
    assert check_participant("P07", LISTED, standing("no-consent", why="no date in consent_study"), 0).passed


@pytest.mark.parametrize(
    ("state", "more", "reason"),
    [
        ("excluded", {"why": "squints"}, "P07 is excluded: squints"),
        ("withdrawn", {"why": "they have withdrawn"}, "P07 has withdrawn"),
        (
            "complete",
            {"sessions": (entry("2026-11-20T10:00:00+01:00"),)},
            "P07 has done everything, last on 2026-11-20",
        ),
        ("running", {"why": "since 10:00"}, "a session of P07 is running: since 10:00"),
        ("unfinished", {}, "a session of P07 is unfinished"),
        ("to-judge", {}, "the last session of P07 has no outcome yet: complete, aborted, excluded"),
        ("waiting", {"next_run": None, "why": "all rows are taken"}, "there is no run for P07: all rows are taken"),
    ],
)
def test_participant_who_may_not(state: str, more: dict[str, Any], reason: str) -> None:
    assert check_participant("P07", LISTED, standing(state, **more), 0) == Finding(False, reason=reason)


def test_participant_who_has_done_that_run() -> None:
    done = SessionEntry("P07", 1, 1, "counted", "folder", "", "ended", outcome="complete")
    found = check_participant("P07", LISTED, standing("to-go-on", next_run=2, sessions=(done,)), 1)
    assert found == Finding(False, reason="P07 has done run 1 before")


def test_participant_who_is_unknown() -> None:
    assert check_participant("", LISTED, None, 0) == Finding(False, reason="no participant is named")
    assert check_participant("P7", LISTED, None, 0) == Finding(
        False, reason="there is no participant P7 in participants.csv; did you mean `P07`?"
    )


def planned(**scenarios: str) -> list[LogEntry]:
    first = LogEntry("planned", "2026-11-01T10:00:00+01:00", {"scenarios": {"scenario": "of the first plan"}}, 1)
    return [first, LogEntry("planned", "2026-11-10T10:00:00+01:00", {"scenarios": scenarios}, 2)]


def test_scenario_as_it_was_planned(tmp_path: Path) -> None:
    made = folder(tmp_path / "scenario")
    scenario = load(made).scenario
    assert scenario is not None
    log = planned(scenario=scenario.hash)
    assert check_scenario(made, study(tmp_path), log) == Finding(True, "`scenario` is as it was on 2026-11-10")
    (made / "acts" / "greet.xml").write_text((made / "acts" / "greet.xml").read_text().replace("Hello", "Hi"))
    found = check_scenario(made, study(tmp_path), log)
    assert not found.passed
    assert found.reason == (
        "the scenario `scenario`, or the robot that it runs on, was changed since the plan of 2026-11-10; put it back "
        "as it was, or confirm the change (rise-engine study plan --again REASON)"
    )
    (made / "acts" / "greet.xml").write_text("<Dialog>")
    assert check_scenario(made, study(tmp_path), log).reason.startswith("the scenario `scenario` has errors: acts/")


def test_scenario_without_a_plan_or_of_another_one(tmp_path: Path) -> None:
    made = folder(tmp_path / "scenario")
    assert check_scenario(made, study(tmp_path), []).reason == "there is no plan yet: rise-engine study plan"
    assert check_scenario(made, study(tmp_path), planned(other="x")).reason == (
        "the plan of 2026-11-10 does not know the scenario `scenario`; make it again "
        "(rise-engine study plan --again REASON)"
    )


def test_wizard() -> None:
    assert check_wizard("anna", {}) == Finding(True, "anna")
    assert check_wizard("  ", {}) == Finding(False, reason="the wizard has given no name (--wizard NAME)")
    for name in ("root", "Lab", "pi"):
        assert check_wizard(name, {}) == Finding(
            False,
            name,
            "this is an account or a role, and does not say who it is; --wizard NAME, or add it to [wizards] in "
            "study.toml",
        )


def test_wizard_where_the_study_lists_them() -> None:
    wizards = {"anna": "W1", "lab": "W2"}
    assert check_wizard("lab", wizards).passed  # whoever wrote that knows who it is
    assert check_wizard("ana", wizards) == Finding(
        False, "ana", "not in the table [wizards] of study.toml; did you mean `anna`?"
    )


def test_a_moment_is_the_same_wherever_its_clock_hangs() -> None:
    tokyo = NOW.astimezone(timezone(timedelta(hours=9)))
    assert check_clock(tokyo, [checked("a", "passed", NOW)], [], True).passed
