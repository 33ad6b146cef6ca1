"""Checks a whole study at once: its files, its scenarios and its log."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import get_args

from msgspec import Struct

from rise_engine.base.nearest_name import nearest_name
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.tree import Held
from rise_engine.scenario.model import Scenario, SourceLocation
from rise_engine.session.folder import JOURNAL
from rise_engine.study.balance import block_problems
from rise_engine.study.labels import (
    SESSIONS,
    copied_sessions,
    outage_differences,
    reassignments,
    repeated_sessions,
    session_differences,
    session_folders,
)
from rise_engine.study.model import Participant, Slot, Study
from rise_engine.study.participants import (
    CONSENT_PREFIX,
    PARTICIPANTS_FILE,
    ParticipantsLoad,
    check_languages,
    load_participants,
)
from rise_engine.study.plan import make_plan, runs
from rise_engine.study.plan_file import NEW_PLAN_FILE, PLAN_FILE, PlanLoad, plan_hash, read_plan
from rise_engine.study.planning import held_slots, last_planned, plan_problem, scenario_hashes
from rise_engine.study.questionnaires import find_missing, load_questionnaire
from rise_engine.study.sessions import NOT_IN_SESSIONS, StudySession, read_sessions
from rise_engine.study.study_log import LOG_FILE, WITHDRAWN_PREFIX, EntryKind, LogEntry, StudyLogError, read_log
from rise_engine.study.study_toml import STUDY_FILE, StudyLoad, load_study
from rise_engine.study.traces import WORK_FOLDER, interrupted_withdrawals, is_withdrawn, returned_sessions
from rise_engine.study.verdict import check_results, read_verdict

_PARTICIPANT_TABLES = frozenset({"strata", "consent", "participants"})
_PLAN_TABLES = frozenset({"strata", "factors", "assignment"})
"""Tables of study.toml that other files depend on. If they have errors, the other files are not checked."""


class StudyReview(Struct, frozen=True):
    """The result of reviewing a study."""

    study: Study | None
    """None: its study.toml has errors."""
    diagnostics: list[Diagnostic]
    """Diagnostics of study.toml, scenarios, participants, plan, log and questionnaires, each in reading order."""
    participants: tuple[Participant, ...] = ()
    scenarios: Mapping[str, Scenario] = {}
    """The scenarios without errors, by absolute folder."""
    slots: tuple[Slot, ...] = ()
    is_planned: bool = False
    """Whether study.jsonl has a plan."""
    omitted: tuple[str, ...] = ()
    """Files that were not checked because they depend on tables of study.toml that have errors."""

    @property
    def errors(self) -> list[Diagnostic]:
        return [diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error"]


def review_study(folder: str | os.PathLike[str]) -> StudyReview:
    """Read and check all parts of a study. Nothing is changed.

    :param folder: the study's folder, or its study.toml.
    """
    loaded = load_study(folder)
    study = loaded.draft
    if study is None:
        return StudyReview(None, loaded.diagnostics)
    found = list(loaded.diagnostics)
    omitted: list[str] = []
    people = ParticipantsLoad((), [])
    if loaded.unsure & _PARTICIPANT_TABLES:
        omitted.append(PARTICIPANTS_FILE)
    else:
        people = load_participants(study)
        found += people.diagnostics
    of_languages = Diagnostics()
    check_languages(study, people.participants, loaded.scenarios, of_languages)
    found += of_languages.sorted()
    plan = PlanLoad(None, [])
    if loaded.unsure & _PLAN_TABLES:
        omitted += [PLAN_FILE] if (Path(study.folder) / PLAN_FILE).exists() else []
    else:
        plan = read_plan(study)
        found += plan.diagnostics
    entries, of_log = _review_log(loaded, people, plan, omitted)
    found += of_log
    if not loaded.unsure & (_PARTICIPANT_TABLES | {"questionnaire"}):
        found += _review_questionnaires(study, people, entries)
    return StudyReview(
        study=loaded.study,
        diagnostics=found,
        participants=people.participants,
        scenarios=loaded.scenarios,
        slots=plan.slots or (),
        is_planned=last_planned(entries) is not None,
        omitted=tuple(omitted),
    )


def _review_questionnaires(study: Study, people: ParticipantsLoad, entries: list[LogEntry]) -> list[Diagnostic]:
    """Check the survey tools' files, and whether everybody who took part is in them."""
    found: list[Diagnostic] = []
    owners = {name: each.participant for name, each in reassignments(entries).items()}
    took_part = [
        (owners.get(str(each.get("folder")), str(each.get("participant"))), int(each.get("run") or 0))
        for each in entries
        if each.kind == "session" and each.get("purpose") == "counted"
    ]
    for settings in study.questionnaires:
        read = load_questionnaire(
            study,
            settings,
            people.participants,
            runs=len(runs(study)),
            has_withdrawn=lambda name: is_withdrawn(name, entries),
        )
        found += read.diagnostics
        if read.items:
            found += find_missing(read, took_part, people.participants)
    return found


def findings_of_files(folder: Path, files: Held) -> list[Diagnostic]:
    """Check study.toml and participants.csv as an editor holds them. Empty if there is no study.

    :param folder: the study's folder.
    :param files: contents by file name.
    """
    if STUDY_FILE not in files:
        return []
    loaded = load_study(folder, check_scenarios=False, held=files)
    if loaded.draft is None or loaded.unsure & _PARTICIPANT_TABLES:
        return list(loaded.diagnostics)
    return [*loaded.diagnostics, *load_participants(loaded.draft, files).diagnostics]


def _review_log(
    loaded: StudyLoad, people: ParticipantsLoad, plan: PlanLoad, omitted: list[str]
) -> tuple[list[LogEntry], list[Diagnostic]]:
    study = loaded.draft
    assert study is not None
    diagnostics = Diagnostics()
    folder = Path(study.folder)
    try:
        entries = read_log(folder, diagnostics)
    except StudyLogError as error:
        diagnostics.error("unreadable", SourceLocation(LOG_FILE), str(error))
        return [], diagnostics.sorted()
    for sentence in interrupted_withdrawals(folder):
        diagnostics.error("interrupted-withdrawal", SourceLocation(WORK_FOLDER), sentence)
    planned = last_planned(entries)
    if not loaded.unsure & _PLAN_TABLES:
        _check_plan(study, planned, plan, diagnostics)
    if planned is None and loaded.study is not None and study.assignment.between == "blocks":
        for problem in block_problems(study, make_plan(study)):
            diagnostics.warning("uneven-blocks", loaded.n_location, problem)
    if planned is not None:
        _check_scenarios(study, loaded.scenarios, planned, diagnostics)
    if PARTICIPANTS_FILE not in omitted and not people.errors:
        _check_holders(entries, people.participants, plan.slots, diagnostics)
    for name, sentence in copied_sessions(folder, entries).items():
        diagnostics.error("copied-session", SourceLocation(f"{SESSIONS}/{name}"), sentence)
    for name, sentence in returned_sessions(folder, entries).items():
        diagnostics.error("returned-session", SourceLocation(f"{SESSIONS}/{name}"), sentence)
    sessions = _check_sessions(study, entries, diagnostics)
    review_entries(study, entries, sessions, people.participants, diagnostics)
    return entries, diagnostics.sorted()


def _check_sessions(study: Study, entries: list[LogEntry], diagnostics: Diagnostics) -> dict[str, StudySession]:
    """Check that the log's sessions are there, are readable, and agree with other files. Returns them by name."""
    folder = Path(study.folder)
    known = {each.name: each for each in read_sessions(folder, study.id, entries)}
    for session in known.values():
        location = SourceLocation(f"{SESSIONS}/{session.name}")
        if session.missing == NOT_IN_SESSIONS:  # as when data are deleted in time
            diagnostics.warning("lost-session", location, f"it {session.missing}")
        elif session.missing:
            diagnostics.error("lost-session", location, f"it {session.missing}")
        elif session.without_end:
            diagnostics.warning("no-end", location, f"it {session.without_end}")
    for name, sentence in repeated_sessions(each.entry for each in known.values() if not each.missing).items():
        diagnostics.error("repeated-session", SourceLocation(f"{SESSIONS}/{name}"), sentence)
    for path in session_folders(folder):
        other = known.get(path.name)
        is_read = other is not None and other.info is not None
        differences = other.differences if other is not None and is_read else session_differences(path, entries)
        for sentence in (*differences, *outage_differences(path)):
            diagnostics.error("other-label", SourceLocation(f"{SESSIONS}/{path.name}"), sentence)
    return known


def _check_plan(study: Study, planned: LogEntry | None, plan: PlanLoad, diagnostics: Diagnostics) -> None:
    folder, location = Path(study.folder), SourceLocation(PLAN_FILE)
    present = plan_hash(folder)
    if planned is None:
        if present:
            message = f"{LOG_FILE} does not know this plan; `rise-engine study plan` checks and accepts it"
            diagnostics.error("not-planned", location, message)
    elif present != planned.get("plan_hash") and plan_hash(folder, NEW_PLAN_FILE) == planned.get("plan_hash"):
        message = "a new plan was made but is not in its place yet: `rise-engine study plan` puts it there"
        diagnostics.error("not-planned", location, message)
    elif problem := plan_problem(study, planned, present):
        diagnostics.error("plan-changed", location, problem)
    if plan.slots is not None and len(plan.slots) < study.n:
        message = f"the plan has {len(plan.slots)} rows for n = {study.n} participants"
        diagnostics.warning("short-plan", location, message)


def _check_scenarios(
    study: Study, scenarios: Mapping[str, Scenario], planned: LogEntry, diagnostics: Diagnostics
) -> None:
    before = dict(planned.get("scenarios") or {})
    for name, digest in scenario_hashes(study, scenarios).items():
        if name in before and before[name] != digest:
            message = (
                f"this scenario, or the robot that it runs on, was changed after the plan of {planned.at[:10]}: put it "
                "back, or confirm the change: rise-engine study plan --again REASON"
            )
            diagnostics.warning("scenario-changed", SourceLocation(name), message)


def _check_holders(
    entries: list[LogEntry],
    participants: tuple[Participant, ...],
    slots: tuple[Slot, ...] | None,
    diagnostics: Diagnostics,
) -> None:
    """Check that holders of slots are still in participants.csv, in the slot's stratum."""
    by_name = {each.participant: each for each in participants}
    rows = {slot.slot: slot for slot in slots or ()}
    for slot, name in held_slots(entries, participants).items():
        participant, row = by_name.get(name), rows.get(slot)
        if participant is None:
            message = f"`{name}` holds slot {slot} and has no row here any more"
            diagnostics.error("lost-participant", SourceLocation(PARTICIPANTS_FILE), message)
        elif row is not None and any(participant.strata.get(key) != value for key, value in row.strata.items()):
            stratum = ", ".join(f"{key} {value}" for key, value in row.strata.items())
            message = f"`{name}` took slot {slot} as {stratum}, and is in another stratum now"
            location = SourceLocation(PARTICIPANTS_FILE, participant.line)
            diagnostics.warning("stratum-changed", location, message)


# --- the log ----------------------------------------------------------------------------------------------------------


_KINDS = get_args(EntryKind)
_ROUNDED = 0.001
"""Maximum difference in seconds between the log's times and a journal's."""


def review_entries(
    study: Study,
    entries: Sequence[LogEntry],
    sessions: Mapping[str, StudySession],
    people: Iterable[Participant],
    diagnostics: Diagnostics,
) -> None:
    """Report entries that no program reads, that contradict sessions, or that do not fit the study.

    :param study: the design.
    :param entries: all entries of study.jsonl.
    :param sessions: by the names of their folders.
    :param people: the rows of participants.csv.
    :param diagnostics: gets the problems.
    """
    _check_kinds(entries, diagnostics)
    _check_taken(entries, diagnostics)
    _check_mode(study, entries, diagnostics)
    _check_consent(study, sessions.values(), people, diagnostics)
    for session in sessions.values():
        if session.info is not None and session.entry.status == "ended":
            _check_log_copies(session, entries, diagnostics)


def _check_kinds(entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    for each in entries:
        if each.kind in _KINDS:
            continue
        message = f"`{each.kind}` is not a kind of entry, so this line is ignored"
        if near := nearest_name(each.kind, _KINDS):
            diagnostics.error("unknown-kind", SourceLocation(LOG_FILE, each.line), f"{message}; did you mean `{near}`?")
        else:
            message += "; a newer version may have written it"
            diagnostics.warning("unknown-kind", SourceLocation(LOG_FILE, each.line), message)


def _check_taken(entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    """Check that the participant of each counted session had taken its slot, if any participant took it."""
    moved = {(each.get("slot"), each.get("participant")) for each in entries if each.get("instead_of")}
    takers: dict[object, dict[str, LogEntry]] = {}
    took: dict[str, LogEntry] = {}
    for each in entries:
        slot, name = each.get("slot"), str(each.get("participant"))
        if each.kind == "taken":
            takers.setdefault(slot, {})[name] = took[name] = each
        elif each.kind == "session" and each.get("purpose") == "counted" and slot and (slot in takers or name in took):
            names = takers.get(slot, {})
            if name in names or (slot, name) in moved or any(other.startswith(WITHDRAWN_PREFIX) for other in names):
                continue
            moved.add((slot, name))  # report it once
            other, taken = list(names.items())[-1] if names else (name, took[name])
            message = (
                f"it says that {other} took slot {taken.get('slot')}, but {each.get('folder')}, the session of {name}, "
                f"began in slot {slot} (line {each.line}), which {name} had not taken"
            )
            diagnostics.error("other-holder", SourceLocation(LOG_FILE, taken.line), message)


def _check_mode(study: Study, entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    real = sum(
        each.kind == "session" and each.get("purpose") == "counted" and each.get("mode") == "real" for each in entries
    )
    if study.mode == "debug" and real:
        message = f'mode is "debug", but {pluralize(real, "session")} with the robot counted; set it to "real" again'
        diagnostics.warning("debug-mode", SourceLocation(STUDY_FILE), message)


def _check_consent(
    study: Study, sessions: Iterable[StudySession], people: Iterable[Participant], diagnostics: Diagnostics
) -> None:
    first: dict[str, str] = {}
    for each in sessions:
        if each.info is not None and each.entry.purpose == "counted":
            with suppress(ValueError):
                day = datetime.fromisoformat(each.entry.started).date().isoformat()
                first[each.entry.participant] = min(day, first.get(each.entry.participant, day))
    for person in people:
        for name in study.consent:
            given, day = person.consent.get(name, ""), first.get(person.participant, "")
            if day and given > day:
                message = (
                    f"`{person.participant}` has consented on {given} ({CONSENT_PREFIX}{name}), and their first "
                    f"session was on {day}"
                )
                diagnostics.warning("late-consent", SourceLocation(PARTICIPANTS_FILE, person.line), message)


def _check_log_copies(session: StudySession, entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    """Check the results of checks and the lengths that the log copies from the journals."""
    own_entries = [each for each in entries if session.name in (each.get("folder"), each.get("session"))]
    for begun in (each for each in own_entries if each.kind == "session" and each.get("checks")):
        recorded = check_results(session.path)
        for each in begun.get("checks"):
            results = recorded.get(str(each.get("id")), frozenset()) if isinstance(each, dict) else frozenset()
            if results and each.get("result") not in results:
                message = (
                    f"it says that the check {each.get('id')} {each.get('result')} before {session.name}, but its "
                    f"{JOURNAL} says {' and '.join(sorted(results))}"
                )
                diagnostics.warning("other-result", SourceLocation(LOG_FILE, begun.line), message)
    outcome = next((each for each in own_entries if each.kind == "outcome"), None)
    seconds = outcome.get("seconds") if outcome is not None else None
    if outcome is not None and isinstance(seconds, float | int) and seconds:
        end = read_verdict(session.path).seconds
        if seconds < end - _ROUNDED:  # a journal that ends earlier is reported by `session_differences`
            message = f"it says {seconds:.3f} s, but {JOURNAL} of {session.name} ends at {end:.3f} s"
            diagnostics.warning("other-result", SourceLocation(LOG_FILE, outcome.line), message)
