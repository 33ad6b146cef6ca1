"""People's annotations of a session as a level shows them, compared with the robot's speech."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from rise_engine.base.errors import SessionError
from rise_engine.privacy.levels import LevelFilter, told_span
from rise_engine.results.analysis.model import CodedAnnotation, Interruption, PlayedAct
from rise_engine.results.analysis.outages import interruption_between
from rise_engine.session.coded import CodedFile, read_coded, read_spans
from rise_engine.session.coded_formats import CodedSpan


class RobotSpeech(NamedTuple):
    """A time in which the robot spoke without a break, in session seconds."""

    begin: float
    end: float
    known: bool = True
    """Whether the robot told when it ended."""


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
    :param interruptions: among them, when it had no engine.
    :param end: the session's end in seconds.
    :param problems: gets sentences about what cannot be read.
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
            problems.append(f"what was annotated in {file.name} is left out: {error}")
            continue
        found += [coded_annotation(each, file, level, speech, interruptions) for each in spans]
    return tuple(sorted(found, key=lambda each: each.begin))


def robot_speech(acts: Iterable[PlayedAct], end: float) -> Sequence[RobotSpeech]:
    """Return when the robot spoke, in order: from the confirmation of a speech action to its end. Pieces that overlap
    or follow at once are joined.

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
    :param robot: when the robot spoke.
    :param interruptions: among them, when the session had no engine.
    """
    had_outage = span.outage or interruption_between(interruptions, span.begin, span.end) == "outage"
    is_speech, told = span.tier in file.speech, told_span(span, file, level)
    return CodedAnnotation(
        tier=span.tier,
        annotator=told.annotator,
        begin=span.begin,
        end=span.end,
        value=told.value,
        modifiers=span.modifiers,
        comment=told.comment,
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
