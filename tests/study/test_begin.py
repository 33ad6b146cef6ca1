"""Who begins which session, and every sentence for who cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.errors import FileError
from rise_engine.cli.study.day import next_json
from rise_engine.kernel.inputs import CheckReport, OutcomeReport, SessionStarted
from rise_engine.study.begin import BeginRequest, CannotBegin, SessionPlan, plan_session, turn_warning
from rise_engine.study.state import OpenStudy, StudyStatus, read_state
from rise_engine.study.study_log import LockedLog

from .studies import DESIGN, ENDED, HEAD, PEOPLE, session_folder, write_journal, write_study

CHECKS = """
[[check]]
id = "lights"
ask = "The lamp behind the robot is on"
[[check]]
id = "consent"
auto = "consent"
[[check]]
id = "weather"
ask = "The sun shines"
blocks = false
[[check]]
id = "debrief"
ask = "Participant was debriefed"
when = "after"
"""
PASSED = CheckReport(id="lights", result="passed"), CheckReport(id="consent", result="passed")


def began(folder: Path, name: str, run: int = 1, *inputs: Any, attempt: int = 1, purpose: str = "counted") -> Path:
    """A session of a participant, with what happened in it after its start."""
    plan = plan_session(read_state(folder), BeginRequest("P01", checks=None)) if purpose == "counted" else None
    started = SessionStarted(
        participant=name,
        study="hesitation",
        slot=1 if plan is not None else None,
        run=run,
        attempt=attempt,
        purpose=purpose,  # type: ignore[arg-type]
    )
    path = session_folder(folder, started)
    write_journal(path, started, *inputs)
    return path


def refusal(state: StudyStatus, request: BeginRequest) -> list[str]:
    with pytest.raises(CannotBegin) as caught:
        plan_session(state, request)
    return list(caught.value.lines)


def begins(state: StudyStatus, *request: Any, **more: Any) -> SessionPlan:
    return plan_session(state, BeginRequest(*request, **more))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_study(tmp_path / "study")
    return tmp_path / "study"


def test_the_plan_says_what_the_session_is(folder: Path) -> None:
    plan = begins(read_state(folder), "P03")
    assert (plan.slot, plan.run.run, plan.attempt, plan.takes_slot, plan.mode) == (1, 1, 1, True, "real")
    started = plan.first_input(read_state(folder).study)
    assert started.condition == "+".join(started.factors.values()) and started.memory.keys() == {"hesitation", "noise"}
    assert (started.study, started.slot, started.run, started.purpose) == ("hesitation", 1, 1, "counted")
    assert plan.seed == plan.run.seed != begins(read_state(folder), "P03", mode="debug", seed=4).seed == 4


def test_the_second_run_is_the_rest_of_the_order_and_the_second_attempt_the_same(folder: Path) -> None:
    began(folder, "P01", 1, OutcomeReport(status="aborted", reason="alarm"), ENDED)
    again = begins(read_state(folder), "P01")
    assert (again.run.run, again.attempt, again.slot, again.takes_slot) == (1, 2, 1, False)
    began(folder, "P01", 1, OutcomeReport(status="complete"), ENDED, attempt=2)
    after = begins(read_state(folder), "P01")
    assert (after.run.run, after.attempt, after.slot) == (2, 1, 1)
    assert {after.run.factors["noise"], again.run.factors["noise"]} == {"quiet", "loud"}
    assert after.run.factors["hesitation"] == again.run.factors["hesitation"]


@pytest.mark.parametrize(
    ("request_", "sentences"),
    [
        (BeginRequest("P1"), ["there is no participant 'P1' in participants.csv; did you mean `P01`?"]),
        (BeginRequest(), ["say who takes part; the next one is P01"]),
        (BeginRequest("P01", run=2), ["P01 cannot have run 2 yet: the next one is run 1"]),
        (BeginRequest("P01", run=3), ["P01 has no run 3: every participant has 2"]),
        (BeginRequest("P01", seed=1), ["a session that counts has the plan's seed: do not give another"]),
        (
            BeginRequest("P01", condition="no+quiet"),
            ["'no+quiet' is not the condition of P01 in run 1: the plan gives it, so leave --condition out"],
        ),
        (BeginRequest("P1", seed=1), 2),
        (BeginRequest("p07", mode="debug"), ["there is no participant 'p07' in participants.csv; did you mean `P07`?"]),
        (BeginRequest("P77", purpose="training"), 1),
        (BeginRequest("X1", purpose="pilot"), 1),
        (
            BeginRequest("", purpose="training", condition="no+lou"),
            ["`noise` has no level `lou`; did you mean `loud`?"],
        ),
        (BeginRequest("", mode="debug", run=3), ["there is no run 3: every participant has 2"]),
    ],
)
def test_what_cannot_begin(folder: Path, request_: BeginRequest, sentences: list[str] | int) -> None:
    found = refusal(read_state(folder), request_)
    assert len(found) == sentences if isinstance(sentences, int) else found == sentences


def test_somebody_who_is_done_excluded_or_to_be_judged(folder: Path) -> None:
    began(folder, "P01", 1, ENDED)
    (found,) = refusal(read_state(folder), BeginRequest("P01"))
    assert "is not judged yet" in found and "complete, aborted or excluded" in found
    with LockedLog(folder) as log:
        log.append("excluded", participant="P01", reason="fell asleep")
    assert refusal(read_state(folder), BeginRequest("P01")) == ["P01 is excluded: fell asleep"]


def test_done_before(folder: Path) -> None:
    began(folder, "P01", 1, OutcomeReport(status="complete"), ENDED)
    assert refusal(read_state(folder), BeginRequest("P01", run=1)) == [
        "P01 has done run 1 before: the next one is run 2"
    ]
    began(folder, "P01", 2, OutcomeReport(status="complete"), ENDED)
    (found,) = refusal(read_state(folder), BeginRequest("P01"))
    assert found.startswith("P01 has done every run before, last 20")
    assert begins(read_state(folder), "P01", mode="debug").slot is None, "but it can be rehearsed"


def test_a_session_that_did_not_end(folder: Path) -> None:
    path = began(folder, "P01")
    with pytest.raises(CannotBegin) as caught:
        begins(read_state(folder), "P01")
    assert caught.value.unfinished is not None and caught.value.unfinished.folder == path.name
    assert "did not end" in str(caught.value) and "its engine has gone" in str(caught.value)
    assert begins(read_state(folder), "P02").slot == 2, "nobody else waits for it"


def test_a_folder_in_which_nothing_happened_is_no_session(folder: Path) -> None:
    session_folder(folder, SessionStarted(participant="P01", study="hesitation", slot=1, run=1, attempt=1))
    path = session_folder(folder, SessionStarted(participant="P01", study="hesitation", slot=1, run=1, attempt=1))
    write_journal(path)
    assert read_state(folder).sessions == () and begins(read_state(folder), "P01").attempt == 1


def test_consent_is_a_gate_for_whoever_is_a_person(tmp_path: Path) -> None:
    write_study(tmp_path, people=HEAD + "P01,,,\n")
    state = read_state(tmp_path)
    sentence = "P01 has not consented: consent_study of participants.csv has no date"
    assert refusal(state, BeginRequest("P01")) == [sentence]
    assert refusal(state, BeginRequest("P01", purpose="pilot")) == [sentence]
    assert begins(state, "P01", purpose="training").purpose == "training"


def test_every_reason_is_said_at_once(tmp_path: Path) -> None:
    design = DESIGN + CHECKS
    write_study(tmp_path, design, HEAD + "P01,,,\nP02,2026-11-01,,\n")
    (tmp_path / "study.toml").write_text(design.replace("seed = 20261122", "seed = 3"), "utf-8")
    found = refusal(read_state(tmp_path), BeginRequest("P01"))
    assert [sentence.split()[0] for sentence in found] == ["since", "the", "the", "P01"]
    assert "`seed` of study.toml changed" in found[0] and "`lights` was not made" in found[1]


@pytest.mark.parametrize(
    ("reports", "problems"),
    [
        (PASSED, 0),
        ((), 2),
        ((*PASSED, CheckReport(id="lights", result="failed", reason="it is dark")), 1),
        ((*PASSED, CheckReport(id="lights", result="skipped", reason="it is day")), 0),
        ((*PASSED, CheckReport(id="lights", result="skipped")), 1),
        ((*PASSED, CheckReport(id="consent", result="skipped", reason="they said so")), 1),
        ((*PASSED, CheckReport(id="weather", result="failed")), 0),
        ((*PASSED, CheckReport(id="ligths", result="passed")), 1),
    ],
)
def test_what_must_be_looked_at(tmp_path: Path, reports: tuple[CheckReport, ...], problems: int) -> None:
    write_study(tmp_path, DESIGN + CHECKS)
    request = BeginRequest("P01", checks=reports)
    if problems:
        assert len(refusal(read_state(tmp_path), request)) == problems
    else:
        assert begins(read_state(tmp_path), "P01", checks=reports).attempt == 1
    assert begins(read_state(tmp_path), "P01", purpose="training").purpose == "training"


def test_without_a_plan_only_a_named_condition_can_be_rehearsed(tmp_path: Path) -> None:
    write_study(tmp_path, plan=False)
    state = read_state(tmp_path)
    assert refusal(state, BeginRequest("P01")) == ["there is no plan yet: rise-engine study plan makes it"]
    assert "--condition" in refusal(state, BeginRequest("P01", mode="debug"))[0]
    plan = begins(state, "", purpose="training", condition="no+loud", run=2)
    assert (plan.run.run, plan.run.memory) == (2, {"hesitation": False, "noise": 3})


def test_a_rehearsal_is_what_the_participant_would_get(folder: Path) -> None:
    state = read_state(folder)
    counted, debug = begins(state, "P01"), begins(state, "P01", mode="debug")
    assert (debug.run, debug.purpose, debug.slot, debug.takes_slot) == (counted.run, "debug", None, False)
    began(folder, "P01", 1, purpose="pilot")
    assert begins(read_state(folder), "P01").attempt == 1, "a pilot is no attempt"
    assert begins(read_state(folder), "P01", purpose="pilot").attempt == 2


def test_with_minimise_the_cell_is_drawn_when_the_row_is_taken(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN.replace('"blocks"', '"minimise"'))
    plan = begins(read_state(tmp_path), "P01")
    assert plan.drawn == {"hesitation": plan.run.factors["hesitation"]} and plan.takes_slot
    with LockedLog(tmp_path) as log:
        log.append("taken", slot=1, participant="P01", levels=plan.drawn)
    kept = begins(read_state(tmp_path), "P01")
    assert kept.run == plan.run and not kept.takes_slot and kept.drawn == {}
    cells = read_state(tmp_path).standing.cells
    assert [(each.condition, each.open) for each in cells] == [(plan.run.factors["hesitation"], 1)]


def test_a_study_in_debug_mode_never_counts(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN.replace('mode = "real"', 'mode = "debug"'))
    state = read_state(tmp_path)
    assert begins(state, "P01").purpose == "debug" and "no session counts" in state.standing.due[0]


def test_what_is_wrong_with_its_files_is_said_with_their_lines(tmp_path: Path) -> None:
    write_study(tmp_path, people=HEAD + PEOPLE)
    (tmp_path / "participants.csv").write_text(HEAD + "P01,yesterday,,\n", "utf-8")
    with pytest.raises(FileError, match=r"participants.csv:2"):
        read_state(tmp_path)
    with pytest.raises(FileError), OpenStudy(tmp_path / "nowhere"):
        pass
    assert not (tmp_path / "nowhere").exists()


def test_somebody_who_is_not_next_is_named_with_their_language(tmp_path: Path) -> None:
    people = "P01,2026-11-01,,,en\nP02,2026-11-02,,,de\nP03,2026-11-02,,,\n"
    design = DESIGN.replace("n = 4", "n = 2") + '\n[participants]\ncolumns = ["language"]\n'
    write_study(tmp_path, design, HEAD.strip() + ",language\n" + people)
    state = read_state(tmp_path)
    assert turn_warning(state, begins(state, "P01")) == ""
    assert turn_warning(state, begins(state, "P02")) == "P01 (en) is next; you are about to open P02 (de)"
    assert turn_warning(state, begins(state, "P03")) == "P01 (en) is next; you are about to open P03"
    assert turn_warning(state, begins(state, "P02", mode="debug")) == ""
    assert ", language en" in next_json(state)["sentence"]
