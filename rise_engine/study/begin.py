"""Decides whether a session of a study can begin, and with which condition, seed and language.

`plan_session` decides and writes nothing. `SessionPlan` describes the session, including its first input. The caller
writes `taken`, the folder and `session` under the log's lock (`rise_engine.run.server.study_session`).
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.inputs import CheckReport, SessionStarted
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import Mode
from rise_engine.study.checks import check_text, reuse_result, skip_problem
from rise_engine.study.model import (
    LANGUAGE,
    Participant,
    ParticipantStanding,
    PlannedRun,
    Purpose,
    SessionEntry,
    Slot,
    Study,
)
from rise_engine.study.plan import parse_condition, planned_run, runs_of
from rise_engine.study.sessions import StudySession
from rise_engine.study.standing import BEGINNABLE, missing_consent, when_text
from rise_engine.study.state import StudyStatus

PARTICIPANT_PURPOSES: frozenset[Purpose] = frozenset({"counted", "pilot"})
"""Purposes of sessions with a participant, who must have consented."""


class CannotBegin(StudyError):
    """The session cannot begin; one sentence for each reason."""

    def __init__(self, *sentences: str, running: bool = False, unfinished: SessionEntry | None = None) -> None:
        super().__init__(*sentences)
        self.running = running
        """Whether a session of the study runs."""
        self.unfinished = unfinished
        """The participant's session that did not end, if it is the only obstacle."""


class BeginRequest(Struct, frozen=True):
    """A request to begin a session."""

    participant: str = ""
    run: int = 0
    """0: the next run."""
    purpose: Purpose = "counted"
    condition: str = ""
    """The condition of a rehearsal. Other purposes allow only the participant's own."""
    mode: Mode | None = None
    """None: the study's mode."""
    checks: tuple[CheckReport, ...] | None = ()
    """The results of the study's checks. None: they are not made yet and not required here."""
    seed: int | None = None


class SessionPlan(Struct, frozen=True):
    """A session of a study before its folder exists."""

    participant: str
    purpose: Purpose
    mode: Mode
    run: PlannedRun
    slot: int | None
    """The plan's row that it holds. None: it has no row."""
    attempt: int
    seed: int
    takes_slot: bool = False
    """Whether this session takes the row."""
    drawn: dict[str, str] = {}
    """The between levels, if they are drawn when the row is taken."""
    language: str = ""
    """The language that the study assigns, used if the scenario has translations."""
    is_assigned: bool = False
    """Whether a factor or a stratum assigns the language, so that the scenario must have it."""

    def spoken_in(self, asked: str, scenario: LoadResult) -> str:
        """Return the session's language. Empty: the language of the scenario's acts.

        :param asked: the requested language, or empty.
        :param scenario: its scenario, loaded without a language.
        :raises CannotBegin: the session counts, and the study assigns another language, or one without a translation.
        """
        own = scenario.scenario.language if scenario.scenario is not None else ""
        is_missing = own and not scenario.translations and self.language not in ("", own)
        if is_missing and self.is_assigned and self.purpose == "counted":
            raise CannotBegin(f"this study is not in the language `{self.language}`; it is in `{own}`")
        given = self.language if scenario.translations else ""
        if asked and given and asked != given and self.purpose == "counted":
            raise CannotBegin(
                f"{asked!r} is not the language of {self.participant}: the study says {given!r}, so leave it out"
            )
        return asked or given

    def first_input(self, study: Study) -> SessionStarted:
        """Return the session's first input, without versions."""
        return SessionStarted(
            participant=self.participant,
            condition=self.run.condition,
            factors=dict(self.run.factors),
            study=study.id,
            study_hash=study.hash,
            slot=self.slot,
            run=self.run.run,
            attempt=self.attempt,
            purpose=self.purpose,
            memory=dict(self.run.memory),
        )


def plan_session(state: StudyStatus, request: BeginRequest) -> SessionPlan:
    """Decide with which row, condition, seed and language the session begins.

    :param state: the study's current state, read under the lock by the caller that will begin the session.
    :param request: the requested session.
    :raises CannotBegin: with all reasons.
    """
    study = state.study
    mode = request.mode or study.mode
    purpose = "debug" if mode == "debug" else request.purpose
    request = replace(request, mode=mode, purpose=purpose)
    plan = _plan_counted(state, request) if purpose == "counted" else _plan_rehearsal(state, request)
    participant = next((each for each in state.participants if each.participant == request.participant), None)
    is_assigned = LANGUAGE in plan.run.factors or LANGUAGE in study.strata
    return replace(plan, language=_language(plan.run, participant), is_assigned=is_assigned)


def _language(run: PlannedRun, participant: Participant | None) -> str:
    """Return a session's `language`: from a factor, a stratum or a further column of participants.csv."""
    of_person = {} if participant is None else {**participant.columns, **participant.strata}
    return str({**of_person, **run.factors}.get(LANGUAGE, "")).strip()


def turn_warning(state: StudyStatus, plan: SessionPlan) -> str:
    """Warn that another participant is next: `P07 (en) is next; you are about to open P08 (de)`.

    Empty if it is this participant's turn or the session does not count.
    """
    following = state.standing.next
    if plan.purpose != "counted" or following in ("", plan.participant):
        return ""
    person = next((each for each in state.participants if each.participant == following), None)
    language = _language(replace(plan.run, factors={}), person)
    first, other = (f" ({tag})" if tag else "" for tag in (language, plan.language))
    return f"{following}{first} is next; you are about to open {plan.participant}{other}"


def unfinished_sessions_of(state: StudyStatus, request: BeginRequest) -> list[StudySession]:
    """Return the participant's unfinished sessions of this purpose (and run), the earliest first."""
    return [
        each
        for each in state.sessions
        if each.entry.status == "unfinished"
        and (each.entry.participant, each.entry.purpose) == (request.participant, request.purpose)
        and request.run in (0, each.entry.run)
    ]


def sessions_to_give_up(state: StudyStatus, request: BeginRequest) -> list[StudySession]:
    """Return the unfinished sessions that a new session gives up. Rehearsals never block a session."""
    return unfinished_sessions_of(state, replace(request, run=0)) if request.purpose == "counted" else []


def running_problem(state: StudyStatus, participant: str) -> str:
    """Return a sentence that a session of the study runs, and whose. Empty: none runs."""
    running = next((each.entry for each in state.sessions if each.entry.status == "running"), None)
    if running is None:
        return ""
    owner_text = "their own session" if running.participant == participant else f"the session of {running.participant}"
    if not running.participant:
        owner_text = "another session of this study"
    return f"{owner_text} is running (run {running.run}, begun {when_text(running.started)}): end it first"


def _plan_counted(state: StudyStatus, request: BeginRequest) -> SessionPlan:
    study, name = state.study, request.participant
    problems = list(state.problems)
    participant = _find_participant(state, name, problems)
    if running := running_problem(state, name):
        problems.append(running)
    if request.seed is not None:
        problems.append("a session that counts has the plan's seed: do not give another")
    standing = next((each for each in state.standing.participants if each.participant == name), None)
    may_begin = standing is None or standing.state in BEGINNABLE or standing.state == "no-consent"
    if request.checks is not None and may_begin:  # otherwise the session cannot begin, and no checks are needed
        problems += check_problems(state, request.checks)
    if participant is None or standing is None:
        raise CannotBegin(*problems, running=bool(running))
    if standing.state == "unfinished" and not problems:
        unfinished = next(each for each in standing.sessions if each.status == "unfinished")
        raise CannotBegin(_why_not_begin(standing), unfinished=unfinished)
    if not may_begin:
        if standing.state != "running":
            problems.append(_why_not_begin(standing))
    elif missing := missing_consent(study, participant):
        problems.append(f"{name} has not consented: {' and '.join(missing)} of participants.csv has no date")
    planned = _planned_run(state, participant, standing, request, problems) if state.plan else None
    if problems or planned is None:
        raise CannotBegin(*dict.fromkeys(problems), running=bool(running))
    run, drawn = planned
    if request.condition and request.condition != run.condition:
        raise CannotBegin(
            f"{request.condition!r} is not the condition of {name} in run {run.run}: the plan gives it, so leave "
            "--condition out"
        )
    return SessionPlan(
        participant=name,
        purpose="counted",
        mode=request.mode or study.mode,
        run=run,
        slot=run.slot,
        attempt=standing.next_attempt,
        seed=run.seed,
        takes_slot=standing.slot is None,
        drawn=drawn if standing.slot is None else {},
    )


def _planned_run(
    state: StudyStatus,
    participant: Participant,
    standing: ParticipantStanding,
    request: BeginRequest,
    problems: list[str],
) -> tuple[PlannedRun, dict[str, str]] | None:
    """Return the participant's run and its drawn levels. If the plan has none, add a problem and return None."""
    if standing.state not in BEGINNABLE:
        return None
    row = state.row_for(participant)
    if row is None:
        problems.append(f"{participant.participant} gets no row: {standing.why}")
        return None
    levels = state.levels_of(row, participant)
    runs = runs_of(state.study, row, levels)
    number = request.run or standing.next_run or 1
    if not 1 <= number <= len(runs):
        problems.append(f"{participant.participant} has no run {number}: {_run_count(len(runs))}")
        return None
    if number != standing.next_run:
        done = any(each.run == number and each.outcome == "complete" for each in standing.sessions)
        which = f"has done run {number} before" if done else f"cannot have run {number} yet"
        problems.append(f"{participant.participant} {which}: the next one is run {standing.next_run}")
        return None
    return runs[number - 1], {} if row.levels else levels


def _run_count(runs: int) -> str:
    return "every participant has one" if runs == 1 else f"every participant has {runs}"


def _find_participant(
    state: StudyStatus, name: str, problems: list[str], *, rehearses: bool = False
) -> Participant | None:
    known = [each.participant for each in state.participants]
    if not name:
        nexts = f"; the next one is {state.standing.next}" if state.standing.next else ""
        problems.append(f"say who takes part{nexts}")
        return None
    found = next((each for each in state.participants if each.participant == name), None)
    if found is None:
        remedy = "; a rehearsal needs no participant" if rehearses else "; add a line for them"
        near = did_you_mean(name, known, limit=0 if rehearses else 12) or remedy
        problems.append(f"there is no participant {name!r} in participants.csv{near}")
    return found


def _why_not_begin(standing: ParticipantStanding) -> str:
    """Return a sentence why the participant cannot begin."""
    name = standing.participant
    match standing.state:
        case "excluded":
            return f"{name} is excluded: {standing.why or 'no reason was given'}"
        case "withdrawn":
            return f"{name} has withdrawn"
        case "unfinished":
            return f"a session of {name} did not end ({standing.why}): continue it, or give it up"
        case "to-judge":
            what = f"a session of {name} is not judged yet ({standing.why})"
            return f"{what}: say whether it is complete, aborted or excluded"
        case _:
            runs = "every run" if standing.runs > 1 else "the session"
            return f"{name} has done {runs} before, last {when_text(standing.sessions[-1].started)}"


def check_problems(state: StudyStatus, reports: Sequence[CheckReport]) -> list[str]:
    """List the problems of the checks before a session that counts: checks that are missing or failed.

    :param reports: the results; the last one of an id counts.
    """
    study = state.study
    given = {each.id: each for each in reports}
    known = [check.id for check in study.checks]
    problems = [f"the study has no check {id!r}{did_you_mean(id, known)}" for id in given if id not in known]
    now = datetime.now().astimezone()
    for check in study.checks:
        report = given.get(check.id)
        if check.when != "before" or not check.blocks:
            continue
        if report is None:
            if not reuse_result(check, state.log, now).good_since:
                problems.append(f"the check `{check.id}` was not made: {check_text(check)}")
        elif report.result == "failed":
            reason = f": {report.reason or report.value}" if report.reason or report.value else ""
            problems.append(f"the check `{check.id}` failed{reason}")
        elif report.result == "skipped" and (problem := skip_problem(check, "counted", report.reason)):
            problems.append(problem)
    return problems


def _plan_rehearsal(state: StudyStatus, request: BeginRequest) -> SessionPlan:
    """Plan a session that does not count. It takes no row, and runs as the participant's row or as requested."""
    study, name = state.study, request.participant
    problems: list[str] = []
    if running := running_problem(state, name):
        problems.append(running)
    participant: Participant | None = None
    if request.purpose in PARTICIPANT_PURPOSES:
        participant = _find_participant(state, name, problems)
        if participant is not None and (missing := missing_consent(study, participant)):
            problems.append(f"{name} has not consented: {' and '.join(missing)} of participants.csv has no date")
    else:
        participant = _find_participant(state, name, problems, rehearses=True) if name else None
    run = _rehearsed_run(state, participant, request, problems)
    if problems or run is None:
        raise CannotBegin(*dict.fromkeys(problems), running=bool(running))
    sessions = [each for each in state.standing.rehearsals if (each.participant, each.run) == (name, run.run)]
    return SessionPlan(
        participant=name,
        purpose=request.purpose,
        mode=request.mode or study.mode,
        run=run,
        slot=None,
        attempt=1 + max((each.attempt for each in sessions), default=0),
        seed=run.seed if request.seed is None else request.seed,
    )


def _rehearsed_run(
    state: StudyStatus, participant: Participant | None, request: BeginRequest, problems: list[str]
) -> PlannedRun | None:
    study = state.study
    if request.condition:
        return _run_of_condition(study, request, problems)
    row = state.row_for(participant) if participant is not None else next(iter(state.plan), None)
    row = row or next(iter(state.plan), None)
    if row is None:
        if study.factors:
            problems.append("there is no plan yet: say which condition (--condition), or make the plan")
            return None
        row = Slot(0, {}, {}, ("",), 0)
    runs = runs_of(study, row, state.levels_of(row, participant))
    number = request.run or _next_run(state, request.participant) or 1
    if not 1 <= number <= len(runs):
        problems.append(f"there is no run {number}: {_run_count(len(runs))}")
        return None
    return runs[number - 1]


def _next_run(state: StudyStatus, participant: str) -> int | None:
    return next((each.next_run for each in state.standing.participants if each.participant == participant), None)


def _run_of_condition(study: Study, request: BeginRequest, problems: list[str]) -> PlannedRun | None:
    try:
        return planned_run(study, parse_condition(study, request.condition), run=request.run or 1)
    except ValueError as error:
        problems.append(str(error))
        return None
