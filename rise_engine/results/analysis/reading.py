"""Reads a session at one level for exports and reports, as the types of `model`.

All exports read a session's journal, session.toml and media.json through this module. It applies the level, so no
format can show more than it allows.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.kernel.records import (
    IDENTITY,
    AnyRecord,
    CheckRecord,
    CueRecord,
    FailureRecord,
    OutcomeRecord,
    OutcomeStatus,
    RecordingRecord,
    ScenarioRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
)
from rise_engine.kernel.wizard_marks import filler_acts
from rise_engine.privacy.levels import ExportLevel, LevelFilter, span_at_level
from rise_engine.results.analysis.acts import ActCollector
from rise_engine.results.analysis.course import (
    ConditionCollector,
    OutageCollector,
    PhaseCollector,
    PointCollector,
    count_repairs,
    interruption_between,
)
from rise_engine.results.analysis.model import CodedAnnotation, Interruption, PlayedAct, SessionData, SessionFacts
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.scenario.model import SIMULATED, Scenario
from rise_engine.session.coded import CodedFile, read_coded, read_spans
from rise_engine.session.coded_formats import CodedSpan
from rise_engine.session.folder import is_abandoned
from rise_engine.session.labels import RelabelledError, moment_of_zero
from rise_engine.session.media import MediaFile, read_media
from rise_engine.study.participants import load_participants
from rise_engine.study.sessions import GIVEN_UP
from rise_engine.study.standing import places_of
from rise_engine.study.study_log import LOG_FILE, LogEntry, StudyLogError, file_stamp, read_log
from rise_engine.study.study_toml import load_study
from rise_engine.study.traces import PARTICIPANTS_FILE, STUDY_FILE, owner_of, study_of_session, wizard_names


class Judgement(Struct, frozen=True):
    """The outcome of a session."""

    status: OutcomeStatus
    reason: str
    """As a person typed it."""


class Judgements(Struct, frozen=True):
    """The outcomes of all sessions of a study."""

    sessions: dict[str, Judgement] = {}
    """The last outcome of each session, by the name of its folder."""
    excluded: dict[str, str] = {}
    """Participants who do not count, whatever the outcomes of their sessions, with the reasons."""

    def of(self, session: str, participant: str) -> Judgement | None:
        """Return the outcome of a session. None: there is none.

        :param session: the folder's name.
        :param participant: the session's participant.
        """
        if participant in self.excluded:
            return Judgement("excluded", self.excluded[participant])
        return self.sessions.get(session)


NO_JUDGEMENTS = Judgements()


def read_judgements(study: Path | None) -> Judgements:
    """Read the outcomes from a study's log and participants.csv, or from the log alone if its files have errors.

    :param study: the study's folder; None: no study.
    """
    if study is None:
        return NO_JUDGEMENTS
    files = (LOG_FILE, PARTICIPANTS_FILE, STUDY_FILE)
    return _read_changed(study, tuple(file_stamp(study / name) for name in files))


@lru_cache(maxsize=4)
def _read_changed(study: Path, changed: tuple[tuple[int, int], ...]) -> Judgements:
    """Read the outcomes, cached while the files are unchanged, because each session of a study needs them."""
    try:
        log = read_log(study)
    except StudyLogError:
        log = []
    outcomes = {
        str(each.get("session")): Judgement(each.get("status"), str(each.get("reason") or ""))
        for each in log
        if each.kind == "outcome" and each.get("status") in ("complete", "aborted", "excluded")
    }
    return Judgements(outcomes, _excluded(study, log))


def _excluded(study: Path, log: list[LogEntry]) -> dict[str, str]:
    loaded = load_study(study, check_scenarios=False).study
    participants = load_participants(loaded).participants if loaded is not None else ()
    return dict(places_of(participants, log).excluded)


_FEW_RECORDS = (
    *(CheckRecord, RecordingRecord, SyncRecord, OutcomeRecord, SessionRecord),
    *(FailureRecord, CueRecord, StopRecord),  # for `count_repairs`
    ScenarioRecord,
)
"""Kinds of records of which even a long session has few."""
UnreadableCallback = Callable[[Path, SessionError], object]
"""Gets a session's folder and the reason why it is unreadable."""


def read_session(
    folder: Path,
    *,
    level: ExportLevel = "full",
    private: Iterable[str] = (),
    wizards: Mapping[str, str] | None = None,
) -> SessionData:
    """Read everything about one session at one level.

    From a running, torn or damaged session, it reads all readable parts; `problems` has sentences about the others.

    :param folder: the session's folder.
    :param level: how much is shown (`rise_engine.privacy.levels`).
    :param private: private memory keys in addition to the scenario's.
    :param wizards: the code of each wizard below the level full, by name; None: as in the session's study.
    :raises SessionError: nothing can be read, or, at a level below full, the private keys are unknown.
    """
    return _read(folder, level, private, wizards)[0]


def read_sessions(
    folders: Iterable[Path],
    *,
    level: ExportLevel = "full",
    private: Iterable[str] = (),
    wizards: Mapping[str, str] | None = None,
    on_unreadable: UnreadableCallback | None = None,
) -> Iterator[SessionData]:
    """Read several sessions one after the other, on demand. None is kept.

    A person has the same code in all sessions, and each session has its own name.

    :param folders: the sessions' folders, in the wanted order.
    :param level: as for `read_session`, like `private` and `wizards`.
    :param on_unreadable: called for an unreadable session, which is omitted; None: SessionError is raised.
    :raises RelabelledError: two files disagree about a session.
    :raises SessionError: as for `read_session`.
    """
    private = tuple(private)
    people: dict[Path | None, dict[str, str]] = {}
    taken: set[str] = set()
    for folder in folders:
        study = study_of_session(folder)
        known = people.setdefault(study, dict(wizard_names(study) if wizards is None else wizards))
        try:
            data, named = _read(folder, level, private, known)
        except RelabelledError:  # do not omit it: the other results would be false, too
            raise
        except SessionError as error:
            if on_unreadable is None:
                raise
            on_unreadable(folder, error)
            continue
        known.update(named)
        name = _unused(data.facts.session, taken)
        taken.add(name)
        yield data if name == data.facts.session else replace(data, facts=replace(data.facts, session=name))


def _unused(name: str, taken: set[str]) -> str:
    names = (name if number == 1 else f"{name}-{number}" for number in range(1, len(taken) + 2))
    return next(each for each in names if each not in taken)


def _read(
    folder: Path, level: ExportLevel, private: Iterable[str], wizards: Mapping[str, str] | None
) -> tuple[SessionData, dict[str, str]]:
    """Read the session, and return it with the codes of its people."""
    study = study_of_session(folder)
    source = SessionRecords(
        folder, level=level, private=private, wizards=wizard_names(study) if wizards is None else wizards
    )
    problems = list(source.problems)
    scenario: Scenario | None = None
    try:
        scenario = source.load_scenario()
    except SessionError as error:
        problems.append(
            f"its trials are not known, and it is not certain which parts of the robot its actions used: {error}"
        )
    acts, phases, points = ActCollector(scenario), PhaseCollector(), PointCollector()
    condition = ConditionCollector()
    away = OutageCollector(_speed_of(source))
    few: list[AnyRecord] = []
    end = 0.0
    for record in source.read():
        acts.add(record)
        phases.add(record)
        condition.add(record)
        points.add(record, away.add(record))
        if isinstance(record, _FEW_RECORDS):
            few.append(record)
        end = record.t
    interruptions = away.interruptions()
    played = acts.acts(away.outages, interruptions)
    media = _media(folder, problems) if level == "full" else ()
    data = SessionData(
        facts=replace(
            _facts(source, few, end, away.downtime, _judgement(source, study, few)), changed_keys=condition.keys()
        ),
        level=level,
        folder=folder,
        records=source,
        acts=played,
        cues=acts.cues(played),
        keys=acts.keys(),
        raised=acts.raised(),
        phases=phases.phases(end),
        outages=tuple(away.outages),
        interruptions=interruptions,
        points=points.points(),
        checks=tuple({each.id: each for each in few if isinstance(each, CheckRecord)}.values()),
        recordings=tuple({each.name: each for each in few if isinstance(each, RecordingRecord)}.values()),
        syncs=tuple(each for each in few if isinstance(each, SyncRecord)),
        media=media,
        coded=read_annotations(folder, source.filter, played, interruptions, end, problems),
        scenario=scenario,
        repairs=count_repairs(few, played, phases.stepped_back, filler_acts(scenario) if scenario is not None else ()),
        problems=tuple(problems),
    )
    return data, source.filter.people


def _facts(
    source: SessionRecords,
    few: Iterable[AnyRecord],
    end: float,
    downtime: float | None,
    judgement: Judgement | None,
) -> SessionFacts:
    """Return the facts from the journal, or from session.toml if an old journal lacks them."""
    begun, info = source.begun or SessionRecord(0, 0.0, "", status="started"), source.info

    def fact(name: str, in_info: str = "") -> Any:
        value = getattr(begun, name)
        return value if value or info is None else getattr(info, in_info or name) or value

    recovered = [each for each in few if isinstance(each, SessionRecord) and each.status == "recovered"]
    moved = source.moved
    started = ""
    if source.level == "full":
        started = moment_of_zero(begun.wall, begun.t, _speed_of(source)) or (info.started if info is not None else "")
    facts = SessionFacts(
        session=source.name,
        **{name: fact(name) for name in IDENTITY},
        mode=source.mode,
        outcome=judgement.status if judgement is not None else None,
        outcome_reason=judgement.reason if judgement is not None else "",
        title=fact("scenario", "title"),
        scenario_hash=fact("scenario_hash"),
        changed_to=tuple(each.hash for each in few if isinstance(each, ScenarioRecord)),
        language=fact("language"),
        robot=fact("robot"),
        driver=begun.driver or (SIMULATED if source.mode == "debug" else ""),
        injected_faults=fact("injected_faults", "faults"),
        seed=fact("seed"),
        speed=_speed_of(source),
        started=started,
        duration=end,
        ended=source.contents.ended,
        downtime=downtime,
        recoveries=len(recovered),
        versions=fact("versions"),
    )
    if moved is None:
        return facts
    return replace(facts, **moved.labels, run_as=moved.run_as)


def _speed_of(source: SessionRecords) -> float:
    """Return the speed from the journal, or from session.toml for an old journal, whose record has 1."""
    begun, info = source.begun, source.info
    return info.speed if info is not None and (begun is None or begun.speed == 1.0) else begun.speed if begun else 1.0


def _judgement(source: SessionRecords, study: Path | None, few: Iterable[AnyRecord]) -> Judgement | None:
    """Return the outcome according to the study, or else according to the session itself."""
    found = read_judgements(study).of(source.folder.resolve().name, owner_of(source.folder))
    if found is not None:
        reason = found.reason if found.reason == GIVEN_UP else source.filter.count_typed_words(found.reason)
        return Judgement(found.status, reason)
    outcomes = [each for each in few if isinstance(each, OutcomeRecord)]
    if outcomes:
        return Judgement(outcomes[-1].status, outcomes[-1].reason)
    if not source.contents.ended and is_abandoned(source.folder):
        return Judgement("aborted", GIVEN_UP)
    return None


def _media(folder: Path, problems: list[str]) -> tuple[MediaFile, ...]:
    try:
        return read_media(folder)
    except SessionError as error:
        problems.append(str(error))
        return ()


# --- annotations ------------------------------------------------------------------------------------------------------


class RobotSpeech(NamedTuple):
    """A time in which the robot spoke without a break, in session seconds."""

    begin: float
    end: float
    known: bool = True
    """Whether the robot reported its end."""


def read_annotations(
    folder: Path,
    level: LevelFilter,
    acts: Iterable[PlayedAct],
    interruptions: Sequence[Interruption],
    end: float,
    problems: list[str],
) -> tuple[CodedAnnotation, ...]:
    """Read the annotations, in the order in which they begin.

    :param folder: the session's folder.
    :param level: the level's filter.
    :param acts: the session's acts.
    :param interruptions: the session's interruptions, including outages.
    :param end: the session's end in seconds.
    :param problems: gets sentences about unreadable files.
    """
    found: list[CodedAnnotation] = []
    try:
        files = read_coded(folder)
    except SessionError as error:
        problems.append(str(error))
        return ()
    speech = robot_speech(acts, end) if files else ()
    for file in files:
        try:
            spans = read_spans(folder, file)
        except SessionError as error:
            problems.append(f"the annotations in {file.name} are left out: {error}")
            continue
        found += [coded_annotation(each, file, level, speech, interruptions) for each in spans]
    return tuple(sorted(found, key=lambda each: each.begin))


def robot_speech(acts: Iterable[PlayedAct], end: float) -> Sequence[RobotSpeech]:
    """Return when the robot spoke, in order: from the confirmation of a speech action to its end. Overlapping and
    adjacent pieces are joined.

    :param acts: the session's acts.
    :param end: the session's end, which also ends unfinished speech.
    """
    pieces: list[RobotSpeech] = []
    spoken = [
        RobotSpeech(part.accepted_at, end if part.ended_at is None else part.ended_at, part.known_end == part.ended_at)
        for act in acts
        for part in act.parts
        if "speech" in part.channels and part.accepted_at is not None
    ]
    for piece in sorted(spoken):
        if pieces and piece.begin <= pieces[-1].end:
            last = max(pieces[-1], piece, key=lambda each: each.end)
            pieces[-1] = last._replace(begin=pieces[-1].begin)
        else:
            pieces.append(piece)
    return pieces


def coded_annotation(
    span: CodedSpan,
    file: CodedFile,
    level: LevelFilter,
    robot: Sequence[RobotSpeech],
    interruptions: Sequence[Interruption],
) -> CodedAnnotation:
    """Convert one annotation and compare it with the robot's speech.

    :param span: the annotation in session seconds.
    :param file: its file.
    :param level: the level's filter.
    :param robot: the robot's speech.
    :param interruptions: the session's interruptions, including outages.
    """
    had_outage = span.outage or interruption_between(interruptions, span.begin, span.end) == "outage"
    is_speech, shown = span.tier in file.speech, span_at_level(span, file, level)
    return CodedAnnotation(
        tier=span.tier,
        annotator=shown.annotator,
        begin=span.begin,
        end=span.end,
        value=shown.value,
        modifiers=span.modifiers,
        comment=shown.comment,
        file=file.name if level.level == "full" else "",
        speech=is_speech,
        outage_s=span.outage or None,
        robot_overlap_s=_overlap(span, robot) if is_speech and not had_outage else None,
        gap_s=_gap(span.begin, robot, interruptions) if is_speech else None,
    )


def _overlap(span: CodedSpan, robot: Sequence[RobotSpeech]) -> float:
    shared = (min(span.end, each.end) - max(span.begin, each.begin) for each in robot)
    return round(sum(each for each in shared if each > 0), 6)


def _gap(at: float, robot: Sequence[RobotSpeech], interruptions: Sequence[Interruption]) -> float | None:
    before = bisect_right(robot, at, key=lambda piece: piece.begin)
    if not before or not robot[before - 1].known:
        return None
    end = robot[before - 1].end
    if interruption_between(interruptions, min(end, at), max(end, at)) == "outage":
        return None
    return round(at - end, 6)
