"""How a study stands: a table of days, each as the log and the session folders tell it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.session.folder import SessionInfo
from rise_engine.study.model import Factor, Level, Participant, SessionEntry, Slot, Study, StudyStanding
from rise_engine.study.sessions import StudySession
from rise_engine.study.standing import study_standing
from rise_engine.study.study_log import WITHDRAWN_PREFIX, LogEntry
from rise_engine.study.traces import hash_pseudonym

YES, NO = {"hesitation": "yes"}, {"hesitation": "no"}
STUDY = Study(
    folder="/study",
    title="A study",
    id="astudy",
    seed=1,
    n=4,
    scenario="scenario",
    mode="real",
    factors=(
        Factor("hesitation", "between", (Level("yes"), Level("no"))),
        Factor("noise", "within", (Level("quiet"), Level("loud"))),
    ),
    consent=("study", "recording"),
)
PLAN = tuple(Slot(number, {}, [YES, NO][number % 2], ("quiet", "loud"), number) for number in range(1, 6))
CONSENT = {"study": "2026-11-01", "recording": "2026-11-02"}


def person(name: str, **more: Any) -> Participant:
    return Participant(name, **{"consent": CONSENT, **more})


PEOPLE = [person("P01"), person("P02"), person("P03")]


def entry(kind: str, **fields: Any) -> LogEntry:
    return LogEntry(kind, "2026-11-22T14:00:00+01:00", fields, 1)


def taken(participant: str, slot: int) -> LogEntry:
    return entry("taken", participant=participant, slot=slot)


def session(participant: str, run: int = 1, outcome: str | None = "complete", **more: Any) -> StudySession:
    """A session of a participant, by default one that ended and was judged."""
    fields = {
        "attempt": 1,
        "purpose": "counted",
        "started": "2026-11-22T14:15:00+01:00",
        "status": "ended",
        "slot": 1,
        "reason": "",
        **more,
    }
    fields["folder"] = f"{fields['started']}_{participant}_{run}_{fields['attempt']}"
    made = SessionEntry(participant=participant, run=run, outcome=outcome, **fields)  # type: ignore[arg-type]
    info = SessionInfo("Sample", "real", "generic", 1, "0" * 64, "/study/scenario", str(fields["started"]))
    return StudySession(made, Path("/study/sessions"), info)


def stand(log: list[LogEntry], sessions: list[StudySession], people: list[Participant] | None = None) -> StudyStanding:
    return study_standing(STUDY, PEOPLE if people is None else people, PLAN, log, sessions)


def of(standing: StudyStanding, name: str) -> Any:
    return next(each for each in standing.participants if each.participant == name)


CASES: list[tuple[str, list[StudySession], str, int | None, int]] = [
    ("nobody was here yet", [], "waiting", 1, 1),
    ("a session runs", [session("P01", outcome=None, status="running")], "running", None, 2),
    ("its engine has gone", [session("P01", outcome=None, status="unfinished")], "unfinished", None, 2),
    ("nobody has judged it", [session("P01", outcome=None)], "to-judge", None, 2),
    ("the first run is done", [session("P01")], "to-go-on", 2, 1),
    ("it was broken off", [session("P01", outcome="aborted")], "aborted", 1, 2),
    ("broken off twice", [session("P01", outcome="aborted"), session("P01", 1, "aborted", attempt=2)], "aborted", 1, 3),
    ("broken off, then done", [session("P01", outcome="aborted"), session("P01", attempt=2)], "to-go-on", 2, 1),
    ("the second was broken off", [session("P01"), session("P01", 2, "aborted")], "aborted", 2, 2),
    ("both are done", [session("P01"), session("P01", 2)], "complete", None, 1),
    (
        "both, after an abort",
        [session("P01"), session("P01", 2, "aborted"), session("P01", 2, attempt=2)],
        "complete",
        None,
        1,
    ),
    ("excluded by an outcome", [session("P01", outcome="excluded", reason="fell asleep")], "excluded", None, 2),
    ("a rehearsal never counts", [session("P01", purpose="pilot", slot=None)], "waiting", 1, 1),
    (
        "nor does a debug session that runs",
        [session("P01", 1, None, purpose="debug", status="running", slot=None)],
        "waiting",
        1,
        1,
    ),
]


@pytest.mark.parametrize(("what", "sessions", "state", "run", "attempt"), CASES, ids=[case[0] for case in CASES])
def test_a_participant_stands(
    what: str, sessions: list[StudySession], state: str, run: int | None, attempt: int
) -> None:
    log = [taken("P01", 1)] if any(each.entry.slot for each in sessions) else []
    log += [
        entry("outcome", participant="P01", session=each.name, status=each.entry.outcome, reason=each.entry.reason)
        for each in sessions
        if each.entry.purpose == "counted" and each.entry.outcome is not None
    ]
    found = of(stand(log, sessions), "P01")
    assert (found.state, found.next_run) == (state, run)
    if run is not None:
        assert found.next_attempt == attempt
    assert found.slot == (1 if any(each.entry.slot for each in sessions) and state != "excluded" else None)


def test_a_row_is_kept_and_the_next_participant_gets_the_next() -> None:
    standing = stand([taken("P01", 1)], [session("P01", outcome="aborted")])
    assert [(each.participant, each.slot) for each in standing.participants] == [
        ("P01", 1),
        ("P02", None),
        ("P03", None),
    ]
    assert standing.next == "P02", "somebody whose session was broken off comes after who has not had theirs"


def test_the_row_of_who_is_excluded_is_free_and_they_stay_out_once_it_is_given() -> None:
    log = [taken("P01", 1), entry("excluded", participant="P01", reason="had been here before")]
    standing = stand(log, [session("P01")])
    assert (of(standing, "P01").state, of(standing, "P01").why) == ("excluded", "had been here before")
    cells = {each.condition: (each.complete, each.open, each.planned) for each in standing.cells}
    assert cells == {"no": (0, 0, 2), "yes": (0, 0, 2)}
    standing = stand([taken("P01", 1), taken("P02", 1)], [session("P01")])  # the exclusion stood in participants.csv
    assert (of(standing, "P01").state, of(standing, "P02").slot) == ("excluded", 1)
    assert of(standing, "P01").why == "their slot 1 was given to P02"


def test_participants_csv_excludes_too() -> None:
    people = [person("P01", status="excluded"), person("P02", status="invited")]
    standing = stand([taken("P01", 1)], [session("P01")], people)
    assert (of(standing, "P01").state, of(standing, "P01").slot, standing.next) == ("excluded", None, "P02")


def test_who_has_withdrawn_holds_nothing_and_is_not_listed_under_a_hash() -> None:
    gone = hash_pseudonym("P01", "salt")
    log = [
        entry("taken", participant=f"{WITHDRAWN_PREFIX}{gone}", slot=1),
        entry("withdrawn", hash=gone, salt="salt", slot=1),
    ]
    standing = stand(log, [])
    assert of(standing, "P01").state == "withdrawn"
    assert len(standing.participants) == 3 and standing.next == "P02" and standing.due == ()


def test_consent_is_a_gate() -> None:
    people = [person("P01", consent={"study": "2026-11-01", "recording": ""}), person("P02", consent={})]
    standing = stand([], [], people)
    assert {each.state for each in standing.participants} == {"no-consent"} and standing.next == ""
    assert [each.why for each in standing.participants] == [
        "no date in consent_recording",
        "no date in consent_study and consent_recording",
    ]
    assert len(standing.due) == 2 and "P01 has not consented" in standing.due[0]


def test_what_is_due() -> None:
    sessions = [
        session("P01", outcome=None),
        session("P02", outcome=None, status="unfinished", slot=2),
        session("P09", slot=3),
    ]
    standing = stand([taken("P01", 1), taken("P02", 2), taken("P09", 3)], sessions)
    assert standing.due == (
        "P01, run 1, attempt 1, begun 2026-11-22 14:15: it ended without outcome; say complete, aborted or excluded",
        "P02, run 1, attempt 1, begun 2026-11-22 14:15: its engine has gone; continue it, or give it up",
        "P09 is in the study's log, but no longer in participants.csv",
    )
    assert of(standing, "P09").slot == 3, "a line that is deleted frees no row"


def test_cells_are_counted_by_who_holds_them() -> None:
    log = [taken("P01", 1), taken("P02", 2), taken("P03", 3)]
    done = [session("P01"), session("P01", 2), session("P02", slot=2)]
    standing = stand(log, done)
    assert {each.condition: (each.complete, each.open, each.planned) for each in standing.cells} == {
        "no": (1, 1, 2),
        "yes": (0, 1, 2),
    }
    assert (standing.complete, standing.wanted) == (1, 4)


def test_no_row_is_left_in_a_stratum() -> None:
    plan = (
        Slot(1, {"language": "de"}, YES, ("quiet", "loud"), 1),
        Slot(2, {"language": "en"}, NO, ("loud", "quiet"), 2),
    )
    people = [
        person(name, strata={"language": language}) for name, language in (("P01", "de"), ("P02", "de"), ("P03", "en"))
    ]
    standing = study_standing(STUDY, people, plan, [taken("P01", 1)], [session("P01", outcome="aborted")])
    assert of(standing, "P02").why == "all 1 rows of the plan for language de are taken"
    assert standing.next == "P03"


def test_without_a_plan_nobody_is_next() -> None:
    standing = study_standing(STUDY, PEOPLE, (), [], [], problems=["there is no plan yet"])
    assert standing.next == "" and standing.due == ("there is no plan yet",)
    assert {each.why for each in standing.participants} == {"there is no plan yet"}
