"""The runner of checks: one call for any kind, with a time limit. It never blocks, and a failed check raises nothing.

Long checks run in the background.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from threading import Event, Thread
from typing import Any, TypeAlias, TypeVar

from rise_engine.base.errors import RiseError
from rise_engine.checks import automatic
from rise_engine.checks.outcome import CheckContext, CheckOutcome, Finding, make_outcome
from rise_engine.checks.programs import KINDS, ChildRequest, run_in_child, run_program_check
from rise_engine.kernel.inputs import CheckReport
from rise_engine.kernel.records import ENGINE
from rise_engine.study.model import StudyCheck
from rise_engine.study.recording_table import RecordingDecision, decide_recording
from rise_engine.study.sessions import SESSIONS, checked_fields
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.study_log import LockedLog

Result = TypeVar("Result")

ENDING_SECONDS = 3.0
"""Seconds after the limit in which the work may end what it has started."""


class BackgroundExecutor(Executor):
    """An executor with a new thread for each call, so that a hanging disk blocks neither the loop nor the exit.

    The exit would wait for the threads of asyncio's own executor.
    """

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()

        def work() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                result = function(*arguments, **named)
            except BaseException as error:  # passed on to the caller
                future.set_exception(error)
            else:
                future.set_result(result)

        Thread(target=work, name="rise-check", daemon=True).start()
        return future


_EXECUTOR = BackgroundExecutor()


async def call_in_background(work: Callable[[Event], Result], limit: float) -> Result:
    """Run a blocking function in a thread, and wait without blocking the loop.

    :param work: the function. It gets an event, which is set when the caller gives up; it must end soon after that.
    :param limit: seconds until the call gives up.
    :raises TimeoutError: it did not end within the limit, nor within ENDING_SECONDS after that.
    :raises asyncio.CancelledError: the caller was cancelled; the event was set, and the work had ENDING_SECONDS to end.
    """
    cancelled = Event()
    future = asyncio.get_running_loop().run_in_executor(_EXECUTOR, work, cancelled)
    future.add_done_callback(_take_exception)
    try:
        done, _ = await asyncio.wait({future}, timeout=limit)
        if not done:
            cancelled.set()
            done, _ = await asyncio.wait({future}, timeout=ENDING_SECONDS)
        if not done:
            raise TimeoutError
        return future.result()
    except asyncio.CancelledError:
        cancelled.set()
        await asyncio.wait({future}, timeout=ENDING_SECONDS)
        raise
    finally:
        future.cancel()  # a later result is dropped


def _take_exception(future: asyncio.Future[Any]) -> None:
    """Take a late exception, so that asyncio does not warn about it."""
    if not future.cancelled():
        future.exception()


_LOG = logging.getLogger(__name__)

PROGRAM_SECONDS = 30.0
LIMITS = {"robot": 60.0, "sound": 90.0, "replay": 300.0, "recorder": 40.0, "explored": 60.0}
DEFAULT_LIMIT_SECONDS = 15.0
"""Limit in seconds for a check that only reads files."""


def limit_seconds(check: StudyCheck) -> float:
    """Return the maximum seconds of a check: `limit` in study.toml, or the default of its kind."""
    if check.limit is not None:
        return check.limit
    return LIMITS.get(check.auto, DEFAULT_LIMIT_SECONDS) if check.auto else PROGRAM_SECONDS


async def run_check(check: StudyCheck, context: CheckContext) -> CheckOutcome:
    """Make a check without blocking the loop, for its limit plus some seconds at most.

    :param check: the check.
    :param context: the session that it is made for.
    :return: passed or failed; or `asked`, if a person has to answer `question`: immediately for a check that asks,
        after the word for `sound`.
    :raises asyncio.CancelledError: the caller was cancelled; everything that the check had started was ended.
    """
    if check.ask:
        return make_outcome(check, Finding(True, question=check.ask))
    limit = limit_seconds(check)

    def work(cancelled: Event) -> Finding:
        return _run_check(check, context, limit, cancelled)

    try:
        # Programs and children apply the limit themselves, so that their output until then is reported.
        finding = await call_in_background(work, limit + 1.0)
    except TimeoutError:
        finding = Finding(False, reason=f"there was no answer within {limit:g} s")
    except RiseError as error:
        finding = Finding(False, reason=str(error))
    except Exception as error:  # an exception in a check is a failed check
        _LOG.exception("the check %s failed", check.id)
        finding = Finding(False, reason=f"the check itself failed ({type(error).__name__}: {error})")
    return make_outcome(check, finding)


def _run_check(check: StudyCheck, context: CheckContext, limit: float, cancelled: Event) -> Finding:
    study = context.study
    sessions = Path(study.folder) / SESSIONS
    if check.run:
        return run_program_check(check.run, context, limit, cancelled)
    if check.auto in KINDS:
        if check.auto == "recorder":
            decision = _decide_recording(context)
            if not decision.settings.recorders:
                return Finding(True, decision.remark or "the study has no recorders")
        request = ChildRequest(
            check.auto,
            context.scenario,
            context.robot,
            context.mode,
            context.ros,
            sessions=str(sessions),
            study=study.folder,
            session=context.kind,
            recording=study.recording,
            task=study.id,
        )
        return run_in_child(request, limit, cancelled)
    match check.auto:
        case "disk":
            return automatic.check_disk(sessions, check.minimum)
        case "wizard":
            return automatic.check_wizard(context.wizard, study.wizards)
    check_study = _CHECKS_OF_STUDY.get(check.auto)
    if check_study is None:
        return Finding(False, reason=f"this version cannot look at {check.auto!r}")
    return check_study(context, read_state(Path(study.folder)))


def _decide_recording(context: CheckContext) -> RecordingDecision:
    """Decide what to record: the test, too, records only participants who have consented."""
    participants = read_state(Path(context.study.folder)).participants if context.participant else ()
    return decide_recording(context.study, participants, context.participant, context.purpose)


def _check_clock(context: CheckContext, state: StudyStatus) -> Finding:
    sessions = [each.entry for each in state.sessions]
    return automatic.check_clock(context.now(), state.log, sessions, automatic.is_clock_synchronised())


def _check_consent(context: CheckContext, state: StudyStatus) -> Finding:
    name = context.participant
    participant = next((each for each in state.participants if each.participant == name), None)
    return automatic.check_consent(state.study.consent, participant, name, context.now().date())


def _check_participant(context: CheckContext, state: StudyStatus) -> Finding:
    name = context.participant
    standing = next((each for each in state.standing.participants if each.participant == name), None)
    return automatic.check_participant(name, state.participants, standing, context.run)


def _check_scenario(context: CheckContext, state: StudyStatus) -> Finding:
    return automatic.check_scenario(Path(context.scenario), state.study, state.log)


_CheckFunction: TypeAlias = Callable[[CheckContext, StudyStatus], Finding]
_CHECKS_OF_STUDY: dict[str, _CheckFunction] = {
    "clock": _check_clock,
    "consent": _check_consent,
    "participant": _check_participant,
    "scenario": _check_scenario,
}


# --- reports and the log --------------------------------------------------------------------------------------------


def report_check(outcome: CheckOutcome, source: str = ENGINE) -> CheckReport:
    """Make the session's report of a check.

    :param outcome: a final one, not `asked`.
    :param source: the person who answered or skipped it, such as `wizard:anna`; by default the program.
    :raises ValueError: it was not answered yet.
    """
    if outcome.result == "asked":
        raise ValueError(f"{outcome.id} has not been answered")
    return CheckReport(
        id=outcome.id,
        text=outcome.text,
        result=outcome.result,
        value=outcome.value,
        reason=outcome.reason,
        source=source,
    )


def append_checked(check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
    """Write the result of a check to study.jsonl (blocking), also if no session begins after it.

    :param check: the check.
    :param context: the session that it was made for.
    :param report: its result.
    :raises rise_engine.study.study_log.StudyLogError: it cannot be written.
    """
    fields = checked_fields(report, check.when, context.purpose)
    if check.valid is None:  # a check that stays valid belongs to no participant, so a withdrawal does not remove it
        fields |= {"participant": context.participant, "run": context.run}
    if context.session:
        fields["session"] = context.session
    with LockedLog(Path(context.study.folder), context.now) as log:
        log.append("checked", **fields)
