"""How a session counts, said afterwards; and who does not take part any more."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from rise_engine.base.errors import StudyError
from rise_engine.kernel.inputs import OutcomeReport, SessionStarted
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.session import lock
from rise_engine.session.lock import HOLDER_FILE, LockHolder
from rise_engine.study.judge import exclude_participant, judge_session, reassign_session
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.study_log import LockedLog, read_log
from rise_engine.study.withdrawal import withdraw

from .studies import ENDED, session_folder, write_journal, write_study


def session(folder: Path, name: str, *inputs: OutcomeReport, slot: int | None = 1, end: bool = True) -> Path:
    """A session that ended, perhaps with an outcome."""
    purpose = "counted" if slot is not None else "pilot"
    started = SessionStarted(
        participant=name,
        study="hesitation",
        slot=slot,
        run=1,
        attempt=1,
        purpose=purpose,  # type: ignore[arg-type]
    )
    path = session_folder(folder, started)
    write_journal(path, started, *inputs, *([ENDED] if end else []))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_study(tmp_path / "study")
    return tmp_path / "study"


def judge(folder: Path, name: str, status: OutcomeStatus, reason: str = "", session: str = "") -> str:
    """The state of the participant afterwards, or why it cannot be."""
    try:
        with OpenStudy(folder) as open:
            judge_session(open, name, status, reason, session=session)
    except StudyError as error:
        return str(error)
    return read_state(folder).state_of(name) or ""


def test_a_session_that_ended_without_outcome(folder: Path) -> None:
    path = session(folder, "P01")
    assert judge(folder, "P01", "aborted") == "say why it is aborted: --reason"
    assert judge(folder, "P01", "complete") == "to-go-on"
    entry = read_log(folder)[-1]
    assert (entry.kind, entry.get("session"), entry.get("status"), entry.get("seconds")) == (
        "outcome",
        path.name,
        "complete",
        60.0,
    )
    assert "is complete already" in judge(folder, "P01", "complete", "once more")


def test_one_whose_engine_has_gone_is_not_offered_again(folder: Path) -> None:
    path = session(folder, "P01", end=False)
    assert read_state(folder).state_of("P01") == "unfinished"
    assert judge(folder, "P01", "aborted", "power cut") == "aborted"
    assert (path / "abandoned").exists()


def test_the_outcome_in_a_journal_is_written_by_whoever_opens_the_study_next(folder: Path) -> None:
    session(folder, "P01", OutcomeReport(status="aborted", reason="no"), OutcomeReport(status="complete", reason="yes"))
    assert read_state(folder).state_of("P01") == "to-go-on", "who only looks sees it, too"
    assert [entry.kind for entry in read_log(folder)] == ["planned"]
    for _ in range(2):
        with OpenStudy(folder):
            pass
        assert [entry.kind for entry in read_log(folder)] == ["planned", "taken", "session", "outcome"]
    assert read_log(folder)[-1].get("reason") == "yes", "the last one counts"


def test_an_outcome_can_be_corrected_with_a_reason_while_nothing_rests_on_it(folder: Path) -> None:
    session(folder, "P01", OutcomeReport(status="excluded", reason="wrong key"))
    assert read_state(folder).state_of("P01") == "excluded"
    assert judge(folder, "P01", "complete") == "say why it is changed: --reason"
    assert judge(folder, "P01", "complete", "it was the wrong key") == "to-go-on"
    judge(folder, "P01", "excluded", "no, it was right")
    with LockedLog(folder) as log:
        log.append("taken", slot=1, participant="P02")
    assert judge(folder, "P01", "complete", "no") == "slot 1 was given to P02 since P01 was excluded"


def test_what_has_nothing_to_be_judged(folder: Path) -> None:
    assert judge(folder, "P1", "complete") == "the study knows no participant 'P1'; did you mean `P01`?"
    assert judge(folder, "P01", "complete") == "P01 has had no session yet"
    path = session(folder, "P01", slot=None)
    assert judge(folder, "P01", "complete").startswith("P01 has had no session yet; those")
    assert "never counts" in judge(folder, "P01", "complete", session=path.name)
    assert "P01 has no session x" in judge(folder, "P01", "complete", session="x")


def test_somebody_is_excluded_and_their_row_is_free(folder: Path) -> None:
    session(folder, "P01", OutcomeReport(status="complete"))
    with OpenStudy(folder) as open:
        assert exclude_participant(open, "P01", "  had been here before ") == 1
    state = read_state(folder)
    assert (state.state_of("P01"), state.places.excluded["P01"]) == ("excluded", "had been here before")
    free = state.row_for(state.participants[1])
    assert free is not None and free.slot == 1
    for name, reason, said in (
        ("P01", "again", "is excluded already"),
        ("P02", " ", "say why"),
        ("P9", "x", "knows no"),
    ):
        with pytest.raises(StudyError, match=said), OpenStudy(folder) as open:
            exclude_participant(open, name, reason)


def test_a_session_whose_folder_was_moved_away_still_counts(folder: Path) -> None:
    path = session(folder, "P01", OutcomeReport(status="complete"))
    with OpenStudy(folder):
        pass
    path.rename(folder.parent / path.name)
    state = read_state(folder)
    assert state.state_of("P01") == "to-go-on"
    assert state.standing.due == (f"{path.name} of P01 is not in the study's sessions any more",)


def test_a_session_that_cannot_be_read_is_not_said_to_be_missing(folder: Path) -> None:
    path = session(folder, "P01", OutcomeReport(status="complete"))
    with OpenStudy(folder):
        pass
    (path / "session.toml").write_text("format = 99\n")
    (due,) = read_state(folder).standing.due
    assert due.startswith(f"{path.name} of P01 cannot be read: ") and "newer version (format 99" in due


def test_what_another_computer_may_still_run_is_not_judged(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = session(folder, "P01", end=False)
    holder = LockHolder(1, "lab-2", "anna", "2026-11-22T14:00:00+01:00")
    (path / HOLDER_FILE).write_bytes(msgspec.json.encode(holder))
    monkeypatch.setattr(lock, "file_system", lambda path: "nfs4")
    assert "on the computer lab-2" in judge(folder, "P01", "aborted", "power cut")
    assert read_state(folder).state_of("P01") == "unfinished" and (path / HOLDER_FILE).exists()
    options = SessionOptions("", study=str(folder), participant="P01", unfinished="new")
    prepared = SessionPreparation(options, lambda message: None)
    with pytest.raises(ServeRefused, match="on the computer lab-2"):
        prepared.open_journal(lambda: None, lambda: 0.0)
    prepared.close()
    assert not [entry for entry in read_log(folder) if entry.kind == "outcome"]
    with OpenStudy(folder) as open:
        judge_session(open, "P01", "aborted", "power cut", here=True)
    assert read_state(folder).state_of("P01") == "aborted"


def test_folders_of_other_studies_are_passed_over(folder: Path) -> None:
    started = SessionStarted(participant="P01", study="another", slot=1, run=1, attempt=1, purpose="counted")
    write_journal(session_folder(folder, started), started, ENDED)
    (folder / "sessions" / "notes").mkdir()
    assert read_state(folder).sessions == () and read_state(folder).state_of("P01") == "waiting"


def test_sessions_are_in_the_order_of_their_moments_also_when_clocks_are_set_back(folder: Path) -> None:
    for name, started in (("P01", "2026-10-25T02:30:00.000+02:00"), ("P02", "2026-10-25T02:10:00.000+01:00")):
        info = session(folder, name, OutcomeReport(status="complete")) / "session.toml"
        lines = [
            f'started = "{started}"' if line.startswith("started") else line for line in info.read_text().splitlines()
        ]
        info.write_text("\n".join(lines))
    assert [each.entry.participant for each in read_state(folder).sessions] == ["P01", "P02"]


# --- reassigned -------------------------------------------------------------------------------------------------------

ABORTED = OutcomeReport(t=50.0, status="aborted", reason="the wrong participant")
COMPLETE = OutcomeReport(t=50.0, status="complete")


def reassign(folder: Path, session: Path, name: str, reason: str = "P02 sat there") -> str:
    """Why it cannot be; empty: it was done."""
    try:
        with OpenStudy(folder) as open:
            reassign_session(open, session.name, name, reason)
    except StudyError as error:
        return str(error)
    return ""


def test_a_session_goes_to_the_one_who_heard_it_and_its_row_with_it(folder: Path) -> None:
    path = session(folder, "P01", ABORTED)
    before = (path / "journal.jsonl").read_bytes(), (path / "session.toml").read_bytes()
    assert reassign(folder, path, "P02") == ""
    state = read_state(folder)
    (moved,) = state.sessions
    assert (moved.entry.participant, moved.entry.slot, moved.entry.attempt, moved.differences) == ("P02", 1, 1, ())
    assert (state.state_of("P01"), state.state_of("P02")) == ("waiting", "aborted")
    assert state.places.slots == {"P02": 1}
    assert [each.participant for each in state.standing.participants if each.sessions] == ["P02"]
    assert before == ((path / "journal.jsonl").read_bytes(), (path / "session.toml").read_bytes())
    with OpenStudy(folder) as open:  # nothing is left for the next one to write
        assert [each.kind for each in open.log.entries()] == [each.kind for each in read_log(folder)]
    assert [each.kind for each in read_log(folder)][-2:] == ["reassigned", "taken"]


def test_a_killed_command_leaves_nothing_half_done(folder: Path) -> None:
    """Between the two lines of the log: the next one who opens the study writes the second."""
    path = session(folder, "P01", ABORTED)
    assert reassign(folder, path, "P02") == ""
    log = folder / "study.jsonl"
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[:-1]))
    state = read_state(folder)
    assert state.places.slots == {"P02": 1} and state.state_of("P01") == "waiting"


def test_who_has_a_row_of_their_own_keeps_it(folder: Path) -> None:
    session(folder, "P02", ABORTED, slot=2)
    path = session(folder, "P01", ABORTED)
    assert reassign(folder, path, "P02") == ""
    state = read_state(folder)
    assert state.places.slots == {"P02": 2, "P01": 1} and state.state_of("P01") == "waiting"
    assert [(each.entry.participant, each.entry.slot, each.entry.attempt) for each in state.sessions] == [
        ("P02", 2, 1),
        ("P02", None, 2),
    ]
    assert judge(folder, "P02", "excluded", "gone home", path.name) == "excluded"
    assert read_state(folder).sessions[-1].differences == ()


def test_it_can_be_given_back(folder: Path) -> None:
    path = session(folder, "P01", ABORTED)
    assert (reassign(folder, path, "P02"), reassign(folder, path, "P01", "it was P01 after all")) == ("", "")
    state = read_state(folder)
    assert state.places.slots == {"P01": 1} and state.sessions[0].differences == ()
    assert (state.state_of("P01"), state.state_of("P02")) == ("aborted", "waiting")


def test_an_excluding_outcome_goes_with_it(folder: Path) -> None:
    path = session(folder, "P01", OutcomeReport(t=50.0, status="excluded", reason="fell asleep"))
    assert reassign(folder, path, "P02") == ""
    assert read_state(folder).places.excluded == {"P02": "fell asleep"}


@pytest.mark.parametrize(
    ("outcome", "end", "name", "reason", "problem"),
    [
        (ABORTED, True, "P02", " ", "say why it is another participant's: --reason"),
        (ABORTED, True, "P1", "x", "the study knows no participant 'P1'; did you mean"),
        (ABORTED, True, "P01", "x", "is P01's already"),
        (None, True, "P02", "x", "is not judged yet: say first how it counts"),
        (None, False, "P02", "x", "has not ended: end it first, or give it up"),
        (
            COMPLETE,
            True,
            "P03",
            "x",
            "is complete, and its row of the plan cannot go to P03: P03 has a row or sessions already",
        ),
    ],
)
def test_what_cannot_be_reassigned(
    folder: Path, outcome: OutcomeReport | None, end: bool, name: str, reason: str, problem: str
) -> None:
    session(folder, "P03", ABORTED, slot=3)
    path = session(folder, "P01", *([outcome] if outcome is not None else []), end=end)
    with OpenStudy(folder):
        before = read_log(folder)
    assert problem in reassign(folder, path, name, reason)
    assert read_log(folder) == before


def test_a_complete_session_takes_its_row_along(folder: Path) -> None:
    path = session(folder, "P01", COMPLETE)
    assert reassign(folder, path, "P02") == ""
    assert read_state(folder).state_of("P02") == "to-go-on"


@pytest.mark.parametrize("gone", ["P01", "P02"])
def test_withdrawal_follows_it(folder: Path, gone: str) -> None:
    path = session(folder, "P01", ABORTED)
    assert reassign(folder, path, "P02") == ""
    withdraw(folder, gone)
    state = read_state(folder)
    assert path.exists() == (gone == "P01")
    assert f'"{gone}"' not in (folder / "study.jsonl").read_text()
    if gone == "P01":
        assert state.places.slots == {"P02": 1} and state.sessions[0].differences == ()
        assert (state.state_of("P02"), state.sessions[0].entry.outcome) == ("aborted", "aborted")
    else:
        assert state.places.slots == {} and state.state_of("P01") == "waiting"
