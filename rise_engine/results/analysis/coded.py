"""People's annotations of a session as a level shows them, compared with the robot's speech."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.privacy.levels import LevelFilter, told_span
from rise_engine.results.analysis.model import CodedAnnotation, Outage, PlayedAct
from rise_engine.results.analysis.outages import seconds_without_engine
from rise_engine.session.coded import CodedFile, read_coded, read_spans
from rise_engine.session.coded_formats import CodedSpan

Spans = Sequence[tuple[float, float]]


def read_annotations(
    folder: Path,
    level: LevelFilter,
    acts: Iterable[PlayedAct],
    outages: Sequence[Outage],
    end: float,
    problems: list[str],
) -> tuple[CodedAnnotation, ...]:
    """Read the annotations, in the order in which they begin.

    :param folder: the session's folder.
    :param level: the level's filter.
    :param acts: the session's acts.
    :param outages: when it had no engine.
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
        found += [coded_annotation(each, file, level, speech, outages) for each in spans]
    return tuple(sorted(found, key=lambda each: each.begin))


def robot_speech(acts: Iterable[PlayedAct], end: float) -> Spans:
    """Return when the robot spoke, in order: from the confirmation of a speech action to its end. Pieces that overlap
    or follow at once are joined.

    :param acts: the session's acts.
    :param end: the session's end, which also ends unfinished speech.
    """
    pieces: list[tuple[float, float]] = []
    spoken = [
        (part.accepted_at, part.ended_at if part.ended_at is not None else end)
        for act in acts
        for part in act.parts
        if "speech" in part.channels and part.accepted_at is not None
    ]
    for begin, until in sorted(spoken):
        if pieces and begin <= pieces[-1][1]:
            pieces[-1] = (pieces[-1][0], max(pieces[-1][1], until))
        else:
            pieces.append((begin, until))
    return pieces


def coded_annotation(
    span: CodedSpan, file: CodedFile, level: LevelFilter, robot: Spans, outages: Sequence[Outage]
) -> CodedAnnotation:
    """Convert one annotation and compare it with the robot's speech.

    :param span: the annotation in session seconds.
    :param file: its file.
    :param level: the level's filter.
    :param robot: when the robot spoke.
    :param outages: when the session had no engine.
    """
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
        robot_overlap_s=_overlap(span, robot) if is_speech else None,
        gap_s=_gap(span.begin, robot, outages) if is_speech else None,
    )


def _overlap(span: CodedSpan, robot: Spans) -> float:
    shared = (min(span.end, end) - max(span.begin, begin) for begin, end in robot)
    return round(sum(each for each in shared if each > 0), 6)


def _gap(at: float, robot: Spans, outages: Sequence[Outage]) -> float | None:
    before = bisect_right(robot, at, key=lambda piece: piece[0])
    if not before:
        return None
    end = robot[before - 1][1]
    if seconds_without_engine(outages, min(end, at), max(end, at)) is not None:
        return None
    return round(at - end, 6)
