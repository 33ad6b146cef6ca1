"""Decisions after a session: whether it counts, whose it is, and whether a participant is excluded."""

from __future__ import annotations

from collections.abc import Sequence

from rise_engine.base.errors import SessionError, StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.inputs import OutcomeReport
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.scenario.model import Json
from rise_engine.session.folder import mark_abandoned
from rise_engine.study.labels import Reassignment, reassignments
from rise_engine.study.sessions import StudySession, outcome_fields, refuse_running_elsewhere
from rise_engine.study.standing import describe_entry, in_stratum
from rise_engine.study.state import OpenStudy, StudyStatus
from rise_engine.study.verdict import read_verdict

COMMAND_LINE = "command-line"
"""The source of a decision if no name is given."""


def judge_session(
    open: OpenStudy,
    participant: str,
    status: OutcomeStatus,
    reason: str = "",
    *,
    session: str = "",
    source: str = COMMAND_LINE,
    here: bool = False,
) -> StudySession:
    """Record a session's outcome, also if its engine has gone, or to correct an earlier outcome.

    :param open: the study, locked.
    :param participant: the session's participant.
    :param status: the outcome.
    :param reason: why; required unless the status is complete and the session has no outcome yet.
    :param session: the name of its folder; empty: the participant's session without outcome, or else their last one.
    :param source: who decides.
    :param here: a person has confirmed that another computer, which had the session last, no longer runs it.
    :return: the session as it was before.
    :raises StudyError: with every reason against it.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be written.
    """
    target = session_to_judge(open.state, participant, session)
    problems = _outcome_problems(open.state, target, status, reason)
    if problems:
        raise StudyError(*problems)
    try:
        refuse_running_elsewhere(target, here=here)
    except SessionError as error:
        raise StudyError(str(error)) from None
    report = OutcomeReport(status=status, reason=reason.strip(), source=source)
    open.log.append("outcome", **outcome_fields(target.entry, report, read_verdict(target.path).seconds))
    if target.left_open:
        mark_abandoned(target.path)
    return target


def reassign_session(open: OpenStudy, session: str, participant: str, reason: str) -> Reassignment:
    """Give a session that was run under the wrong participant to the one who took part.

    The plan's row goes with it if it fits the participant and was not used otherwise. The log records this; the
    session's own record stays unchanged.

    :param open: the study, locked.
    :param session: the name of its folder.
    :param participant: the one who took part.
    :param reason: why.
    :return: the new assignment.
    :raises StudyError: with every reason against it.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be written.
    """
    state = open.state
    _check_known(state, participant)
    target = next((each for each in state.sessions if each.name == session), None)
    if target is None:
        near = did_you_mean(session, [each.name for each in state.sessions])
        raise StudyError(f"the study has no session {session!r}{near}")
    entry = target.entry
    slot, why_not = _moving_row(state, target, participant)
    problems = [] if reason.strip() else ["say why it is another participant's: --reason"]
    if entry.participant == participant:
        problems.append(f"{session} is {participant}'s already")
    if entry.status != "ended":
        problems.append(f"{session} has not ended: end it first, or give it up")
    elif entry.purpose != "counted":
        problems.append(f"{session} is a {entry.purpose} session: it never counts")
    elif entry.outcome is None:
        problems.append(f"{session} is not judged yet: say first how it counts")
    elif entry.outcome == "complete" and slot is None:
        problems.append(f"{session} is complete, and its row of the plan cannot go to {participant}: {why_not}")
    problems += [f"{name} has withdrawn" for name in (entry.participant, participant) if name in state.places.withdrawn]
    if problems:
        raise StudyError(*problems)
    theirs = [each.entry for each in state.sessions if each.entry.participant == participant]
    counted = [each.attempt for each in theirs if (each.purpose, each.run) == ("counted", entry.run)]
    fields: dict[str, Json] = {
        "session": session,
        "was": entry.participant,
        "participant": participant,
        "slot": slot,
        "run": entry.run,
        "attempt": 1 + max(counted, default=0),
        "reason": reason.strip(),
        "source": COMMAND_LINE,
    }
    written = open.log.append("reassigned", **fields)
    if slot is not None:
        levels = state.places.levels.get(slot)
        drawn: dict[str, Json] = {"levels": dict(levels)} if levels else {}
        open.log.append("taken", slot=slot, participant=participant, instead_of=entry.participant, **drawn)
    return reassignments([written])[session]


def _moving_row(state: StudyStatus, session: StudySession, participant: str) -> tuple[int | None, str]:
    """Return the row that moves with a session; or None and the reason why its holder keeps it."""
    entry = session.entry
    counted = [each.entry for each in state.sessions if each.entry.purpose == "counted"]
    others = [each for each in counted if each.participant == entry.participant and each.folder != entry.folder]
    theirs = [each for each in counted if each.participant == participant]
    row = next((each for each in state.plan if each.slot == entry.slot), None)
    listed = next((each for each in state.participants if each.participant == participant), None)
    if row is None or state.places.slots.get(entry.participant) != row.slot:
        return None, f"{entry.participant} does not hold it any more"
    if others:
        return None, f"{entry.participant} has other sessions in it"
    if theirs or participant in state.places.slots:
        return None, f"{participant} has a row or sessions already"
    if listed is None or not in_stratum(row, listed.strata):
        stratum = ", ".join(f"{name} {value}" for name, value in row.strata.items())
        return None, f"the row is for {stratum or 'participants who are listed'}"
    return row.slot, ""


def exclude_participant(open: OpenStudy, participant: str, reason: str) -> int | None:
    """Record that a participant no longer counts. Their row goes to the next one of their stratum.

    :param open: the study, locked.
    :param participant: who is excluded.
    :param reason: why.
    :return: the row that becomes free; None: they held none.
    :raises StudyError: with every reason against it.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be written.
    """
    state = open.state
    _check_known(state, participant)
    problems: list[str] = []
    if not reason.strip():
        problems.append("say why they are excluded: the study's report gives the reason")
    if participant in state.places.withdrawn:
        problems.append(f"{participant} has withdrawn")
    elif participant in state.places.excluded:
        problems.append(f"{participant} is excluded already: {state.places.excluded[participant]}")
    if _sessions_with_status(state, participant, "running"):
        problems.append(f"a session of {participant} is running: end it first")
    if problems:
        raise StudyError(*problems)
    slot = state.places.slots.get(participant)
    open.log.append("excluded", participant=participant, slot=slot, reason=reason.strip(), source=COMMAND_LINE)
    return slot


def session_to_judge(state: StudyStatus, participant: str, name: str = "") -> StudySession:
    """Find the session to judge: by name, or else the participant's session without outcome, or else their last one.

    :raises StudyError: there is none, or it never counts.
    """
    _check_known(state, participant)
    theirs = [each for each in state.sessions if each.entry.participant == participant]
    counted = [each for each in theirs if each.entry.purpose == "counted"]
    if name:
        found = next((each for each in theirs if each.name == name), None)
        if found is None:
            near = did_you_mean(name, [each.name for each in theirs])
            raise StudyError(f"{participant} has no session {name}{near}")
        if found not in counted:
            raise StudyError(f"{name} is a {found.entry.purpose} session: it never counts and needs no outcome")
        return found
    if not counted:
        rehearsed = "; those that they had do not count" if theirs else ""
        raise StudyError(f"{participant} has had no session yet{rehearsed}")
    return next((each for each in counted if each.entry.outcome is None), counted[-1])


def _outcome_problems(state: StudyStatus, session: StudySession, status: OutcomeStatus, reason: str) -> list[str]:
    entry = session.entry
    problems: list[str] = []
    if entry.status == "running":
        return [f"{describe_entry(entry)}, is running: end it first, it asks for the outcome"]
    if entry.outcome == status:
        problems.append(f"{describe_entry(entry)}, is {status} already")
    if not reason.strip() and (status != "complete" or entry.outcome is not None):
        what = "changed" if entry.outcome is not None else status
        problems.append(f"say why it is {what}: --reason")
    if entry.outcome is not None:
        problems += _correction_problems(state, session)
    elif entry.participant in state.places.withdrawn:
        problems.append(f"{entry.participant} has withdrawn")
    return problems


def _correction_problems(state: StudyStatus, session: StudySession) -> Sequence[str]:
    """Explain why a judged session cannot be judged again if later decisions depend on its outcome."""
    entry = session.entry
    counted = [
        each
        for each in state.sessions
        if (each.entry.participant, each.entry.purpose) == (entry.participant, "counted")
    ]
    if counted and counted[-1].name != session.name:
        return [f"{describe_entry(entry)}, is not their last: later sessions depend on its outcome"]
    taker = next((name for name, slot in state.places.slots.items() if slot == entry.slot), entry.participant)
    if taker != entry.participant:
        return [f"slot {entry.slot} was given to {taker} since {entry.participant} was excluded"]
    return []


def _check_known(state: StudyStatus, participant: str) -> None:
    known = dict.fromkeys(each.participant for each in state.standing.participants)
    if participant not in known:
        near = did_you_mean(participant, list(known))
        raise StudyError(f"the study knows no participant {participant!r}{near}")


def _sessions_with_status(state: StudyStatus, participant: str, status: str) -> list[StudySession]:
    return [each for each in state.sessions if (each.entry.participant, each.entry.status) == (participant, status)]
