"""Which checks have to be made, which can be skipped, and which are due."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from rise_engine.study.checks import PendingCheck, check_text, due_after_checks, pending_checks, skip_problem
from rise_engine.study.model import SessionEntry, StudyCheck
from tests.checks.samples import NOW, checked, study

DAY = 86_400.0
LAMP = StudyCheck("lamp", ask="The lamp is on")
CAMERA = StudyCheck("camera", run=("./calibrate", "left eye"), valid=30 * DAY)
DEBRIEF = StudyCheck("debrief", ask="Participant was debriefed", when="after")
LAB = study(Path("/lab"), LAMP, CAMERA, DEBRIEF)
TEXT = "./calibrate 'left eye'"


def test_what_a_check_looks_at_in_words() -> None:
    assert [check_text(check) for check in (LAMP, CAMERA)] == ["The lamp is on", TEXT]
    assert check_text(StudyCheck("d", auto="disk")).startswith("there is room")


def test_checks_of_a_moment_in_the_order_of_the_file() -> None:
    assert pending_checks(LAB, "before", [], NOW) == (PendingCheck(LAMP), PendingCheck(CAMERA))
    assert pending_checks(LAB, "after", [], NOW) == (PendingCheck(DEBRIEF),)


def good_since(*log: object, check: StudyCheck = CAMERA) -> str:
    of = study(Path("/lab"), check)
    return pending_checks(of, "before", log, NOW)[0].good_since  # type: ignore[arg-type]


def test_one_with_every_is_good_for_that_long() -> None:
    edge = NOW - timedelta(days=30)
    log = [checked("camera", "passed", edge, text=TEXT, value="0.4 degrees")]
    assert pending_checks(LAB, "before", log, NOW)[1] == PendingCheck(CAMERA, log[0].at, "0.4 degrees")
    assert not good_since(checked("camera", "passed", edge - timedelta(seconds=1), text=TEXT))


def test_without_every_it_is_made_each_time() -> None:
    assert not good_since(checked("lamp", "passed", NOW, text="The lamp is on"), check=LAMP)


def test_the_last_one_counts_unless_it_was_skipped() -> None:
    passed = checked("camera", "passed", NOW - timedelta(days=2), text=TEXT)
    assert good_since(passed, checked("camera", "skipped", NOW, text=TEXT, reason="late")) == passed.at
    assert not good_since(passed, checked("camera", "failed", NOW, text=TEXT))
    assert not good_since(checked("camera", "skipped", NOW, text=TEXT, reason="late"))
    again = checked("camera", "passed", NOW - timedelta(days=1), text=TEXT)
    assert good_since(checked("camera", "failed", NOW - timedelta(days=2), text=TEXT), again) == again.at
    assert good_since(passed, checked("other", "failed", NOW, text=TEXT)) == passed.at


def test_what_looked_at_something_else_is_not_good() -> None:
    assert not good_since(checked("camera", "passed", NOW, text="./calibrate 'right eye'"))


@pytest.mark.parametrize("at", ["2026-11-23T10:00:00+01:00", "soon", "2026-11-22T10:00:00"])
def test_a_time_that_cannot_be_is_not_good(at: str) -> None:
    assert not good_since(checked("camera", "passed", at, text=TEXT))


@pytest.mark.parametrize("kind", ["consent", "participant"])
def test_what_is_about_one_participant_says_nothing_about_the_next(kind: str) -> None:
    check = StudyCheck("person", auto=kind, valid=30 * DAY)
    assert not good_since(checked("person", "passed", NOW, text=check_text(check)), check=check)


def test_a_skip_needs_a_reason() -> None:
    assert skip_problem(LAMP, "counted", "it is broken") == ""
    for blank in ("", "  \t"):
        assert skip_problem(LAMP, "counted", blank) == "lamp: give a reason for skipping a check"


def test_consent_is_never_skipped_in_a_session_that_counts() -> None:
    consent = StudyCheck("agreed", auto="consent")
    sentence = "agreed: consent cannot be skipped in a session that counts"
    assert skip_problem(consent, "counted", "he said yes") == sentence
    assert skip_problem(consent, "pilot", "a colleague") == ""
    assert "cannot be skipped" in skip_problem(StudyCheck("who", auto="participant"), "counted", "I know him")


def session(folder: str, **more: object) -> SessionEntry:
    fields = {"attempt": 1, "purpose": "counted", "status": "ended"} | more
    return SessionEntry("P07", 1, folder=folder, started="", **fields)  # type: ignore[arg-type]


def test_what_nobody_has_looked_at_afterwards_is_due() -> None:
    sessions = [
        session("one"),
        session("two", attempt=2),
        session("three", purpose="pilot"),
        session("four", status="running"),
    ]
    log = [
        checked("debrief", "passed", NOW, when="after", session="one"),
        checked("debrief", "failed", NOW, when="after", session="two"),
    ]
    sentence = "P07, run 1, attempt 2: not confirmed: “Participant was debriefed” (check debrief)"
    assert due_after_checks(LAB, sessions, log) == [sentence]
    log.append(checked("debrief", "skipped", NOW, when="after", session="two", reason="left in a hurry"))
    assert due_after_checks(LAB, sessions, log) == []
