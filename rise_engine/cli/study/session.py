"""`serve --study` and `run --study`: the choice of a study's session, before anything starts."""

from __future__ import annotations

import shlex

from msgspec.structs import replace

from rise_engine.checks.outcome import CheckContext
from rise_engine.cli.options import resolve_study_folder
from rise_engine.cli.study.checks import CheckOptions, gather_check_reports
from rise_engine.cli.terminal import Refused, exit_with_usage, print_notes
from rise_engine.kernel.inputs import CheckReport, SessionStarted
from rise_engine.kernel.records import Purpose
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.loader import load
from rise_engine.study.begin import (
    BeginRequest,
    CannotBegin,
    SessionPlan,
    plan_session,
    sessions_to_give_up,
    turn_warning,
)
from rise_engine.study.participants import SessionKind
from rise_engine.study.recording_table import decide_recording, recording_lines
from rise_engine.study.sessions import given_up_fields
from rise_engine.study.state import StudyStatus, read_state


def study_session(
    options: SessionOptions,
    study: str,
    folder: str | None,
    run: int,
    *,
    pilot: bool,
    training: bool,
    checks: CheckOptions,
) -> SessionOptions:
    """Make the options of a session of a study to serve. Ends the program, with all reasons, if it cannot begin.

    :param options: from the command line, without the study.
    :param study: the study's folder, as the user wrote it.
    :param folder: the scenario's folder, if the user named one.
    :param run: the participant's run; 0: the next one.
    :param checks: answers to the study's checks, which this function makes.
    """
    if folder is not None:
        exit_with_usage("a session of a study has the study's scenario: use either DIR or --study")
    if pilot and training:
        exit_with_usage("use either --pilot or --training")
    purpose: Purpose = "pilot" if pilot else "training" if training else "counted"
    where = resolve_study_folder(study).absolute()
    options = replace(options, study=str(where), run=run, purpose=purpose)
    state = read_state(where)
    recovers = state.state_of(options.participant) == "unfinished" or purpose != "counted"
    if options.unfinished not in ("ask", "new") and (recovers or options.unfinished != "recover"):
        return options
    # Report known problems before the user makes the checks.
    plan = _plan(state, options, serves=True)
    if plan is None:
        return options
    if warning := turn_warning(state, plan):
        print_notes(f"warning: {warning}")
    decision = decide_recording(state.study, state.participants, plan.participant, plan.purpose, options.record)
    print_notes(*recording_lines(decision))
    return replace(options, folder=plan.run.scenario, checks=_make_checks(state, plan, options, checks))


def _make_checks(
    state: StudyStatus, plan: SessionPlan, options: SessionOptions, checks: CheckOptions
) -> tuple[CheckReport, ...]:
    context = CheckContext(
        state.study,
        plan.participant,
        plan.run.scenario,
        plan.mode,
        plan.purpose,
        plan.run.run,
        robot=options.robot or state.study.robot or None,
        wizard=options.wizard,
        ros=options.ros,
        kind=SessionKind(plan.run, plan.language),
    )
    try:
        return gather_check_reports(context, checks)
    except Refused as refused:
        raise refused.with_hint("nothing was started") from None


def rehearsed_session(
    options: SessionOptions, study: str, folder: str | None, run: int
) -> tuple[SessionOptions, SessionStarted]:
    """Make the options and the first input of a session for `run`: in debug mode, so that it takes no row.

    Ends the program, with all reasons, if there is no such session. Parameters are those of `study_session`.
    """
    if folder is not None:
        exit_with_usage("a session of a study has the study's scenario: use either DIR or --study")
    if options.mode == "real":
        exit_with_usage(
            "`run` keeps nothing, so it is always in debug mode with --study; for a real session, use serve --study"
        )
    state = read_state(resolve_study_folder(study).absolute())
    seed = options.seed
    plan = _plan(state, replace(options, mode="debug", run=run, seed=None))
    assert plan is not None
    robot = options.robot or state.study.robot or None
    scenario, chosen = plan.run.scenario, plan.seed if seed is None else seed
    language = options.language
    if plan.language:
        language = plan.spoken_in(language, load(scenario, robot=robot, mode="debug"))
    options = replace(options, folder=scenario, mode="debug", robot=robot, seed=chosen, language=language)
    return options, plan.first_input(state.study)


def _plan(state: StudyStatus, options: SessionOptions, *, serves: bool = False) -> SessionPlan | None:
    """Plan the session; None: another one to be served runs or did not end, which the engine reports."""
    request = BeginRequest(
        participant=options.participant,
        run=options.run,
        purpose=options.purpose,
        condition=options.condition,
        mode="debug" if options.mode == "debug" else None if options.mode is None else "real",
        checks=None,
        seed=options.seed,
    )
    if options.unfinished == "new":
        state = state.with_outcomes(map(given_up_fields, sessions_to_give_up(state, request)))
    try:
        return plan_session(state, request)
    except CannotBegin as error:
        if serves and (error.running or error.unfinished is not None):
            return None
        hints = []
        if state.state_of(options.participant) == "to-judge":
            command = f"rise-engine study outcome {shlex.quote(state.study.folder)} {options.participant}"
            hints.append(f"  {command} complete | aborted | excluded")
        raise Refused(*error.lines, hints=hints) from None
