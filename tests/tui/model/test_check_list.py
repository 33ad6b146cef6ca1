"""The checks around a session: what is in the way, who answered, what is skipped and why."""

from __future__ import annotations

import pytest

from rise_engine.checks.outcome import CheckOutcome
from rise_engine.study.model import Purpose, StudyCheck
from rise_tui.model.check_list import CheckItem, CheckList
from rise_tui.rendering.text import plain_text
from tests.tui.fake_study import CHECKS, VALUES, pending


def item(checks: CheckList, id: str) -> CheckItem:
    found = checks.find(id)
    assert found is not None
    return found


def made(*wanted: StudyCheck, purpose: Purpose = "counted", binding: bool = True, **failed: str) -> CheckList:
    """All checks have been made: those in `failed` with a reason; the others have passed or ask somebody."""
    checks = CheckList(pending("before", wanted or CHECKS), purpose, binding=binding)
    for each in checks.items:
        finish(checks, each.check.id, failed.get(each.check.id, ""))
    return checks


def finish(checks: CheckList, id: str, reason: str = "") -> None:
    check = item(checks, id).check
    if check.ask:
        outcome = CheckOutcome(id, check.ask, "asked", question=check.ask)
    else:
        outcome = CheckOutcome(id, check.auto, "failed" if reason else "passed", "" if reason else VALUES[id], reason)
    checks.finish(item(checks, id), outcome)


def test_what_runs_what_asks_and_what_failed_is_in_the_way_in_this_order_of_weight() -> None:
    checks = CheckList(pending("before"), "counted", binding=True)
    assert checks.obstacle == "consent, lights, door, disk and tracker are still running"
    checks = made(tracker="no answer from 10.0.0.7")
    assert checks.obstacle == "tracker failed"
    assert checks.first_open() == 1 and checks.first_open(2) == 2 and checks.first_open(3) == 4
    finish(checks, "tracker")
    assert checks.obstacle == "lights and door: answer with y or n"
    for id in ("lights", "door"):
        assert checks.answer(item(checks, id), True, "wizard:anna")
    assert checks.obstacle == "" and checks.first_open() is None
    assert [(each.id, each.result) for each in checks.reports] == [
        (id, "passed") for id in ("consent", "lights", "door", "disk", "tracker")
    ]
    assert [each.source for each in checks.reports[:3]] == ["engine", "wizard:anna", "wizard:anna"]


def test_an_answer_can_be_changed_and_what_the_program_checks_has_none() -> None:
    checks = made()
    lights = item(checks, "lights")
    assert checks.answer(lights, False, "wizard:anna") and lights.status == "failed"
    assert checks.answer(lights, True, "wizard:anna") and lights.status == "passed"
    assert not checks.answer(item(checks, "disk"), True, "wizard:anna")


@pytest.mark.parametrize(
    ("id", "reason", "problem"),
    [
        ("tracker", "", "give a reason for skipping a check"),
        ("tracker", "it is broken", ""),
        ("consent", "a reason", "consent cannot be skipped"),
    ],
)
def test_what_can_be_skipped_and_with_which_reason(id: str, reason: str, problem: str) -> None:
    checks = made(tracker="again", consent="consent_recording has no date")
    why_not = checks.why_not_skip(item(checks, id), reason)
    assert problem in why_not and bool(problem) == bool(why_not)


def test_a_skipped_check_keeps_what_it_had_found() -> None:
    checks = made(tracker="again")
    checks.skip(item(checks, "tracker"), "it is broken", "wizard:anna")
    report = checks.reports[-1]
    assert (report.id, report.result, report.reason) == ("tracker", "skipped", "it is broken")
    assert (report.value, report.source) == ("failed before: again", "wizard:anna")


def test_what_does_not_block_or_comes_after_a_session_is_in_nobodys_way() -> None:
    loose = StudyCheck("disk", auto="disk", blocks=False)
    assert made(loose, disk="only 2 GB are free").obstacle == ""
    assert made(CHECKS[3], disk="only 2 GB are free").obstacle == "disk failed"
    assert made(CHECKS[3], purpose="pilot", binding=False, disk="only 2 GB are free").obstacle == ""


@pytest.mark.parametrize("width", [60, 76, 92])
def test_rows_say_the_state_the_question_and_what_was_found(width: int) -> None:
    checks = made(tracker="no answer from 10.0.0.7")
    lines = [plain_text(row.line) for row in checks.rows(width)]
    assert all(len(line) <= width for line in lines)
    for piece in ("✓ passed", "34.1 GB free", "? y or n", "The door is closed", "✗ failed", "no answer from 10.0.0.7"):
        assert piece in "\n".join(lines)
