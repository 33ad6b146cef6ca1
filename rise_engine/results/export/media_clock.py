"""A session as tiers on the clock of its recording: rows of annotations for video coding in ELAN, Praat and BORIS.

media time = offset + rate * session time (`rise_engine.session.media`). An annotator needs times on the recording's
clock. Annotations are scaled by its rate, because no annotation format can say that a camera runs fast. If a format
lets each file begin elsewhere (ELAN, BORIS), the other files are aligned with the first one.

While a session has no engine, its time stands still, but cameras continue. So events after a recovery are moved by the
time that passed on the computer's clock. A file is aligned with the part of the session that has its marks.

Annotations of a tier never overlap, are at least a millisecond long, and do not begin before 0. The layout ensures
this: of two that overlap, the second goes to a tier `NAME 2`; an event without duration becomes an annotation of
`MOMENT_MS` (or less, if the next one begins earlier); annotations before 0 are omitted and counted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.text import pluralize
from rise_engine.ports.recorder import MediaKind
from rise_engine.results.analysis.course import seconds_away
from rise_engine.results.analysis.model import Outage, SessionData
from rise_engine.session.coded_formats import CodedClock
from rise_engine.session.media import MediaFile

LONG_SECONDS = 20 * 60.0
"""In longer recordings, an unmeasured drift is visible: 50 ppm, usual between two clocks, make 60 ms."""
FRAME_SECONDS = 0.04
"""One video frame. Smaller differences are invisible."""
SAME_START_SECONDS = 30.0
"""Maximum seconds between starts of recorders that belong together. Later recordings are another part."""


class LinkedFile(Struct, frozen=True, kw_only=True):
    """A recording that an export links."""

    file: MediaFile
    path: Path
    """Absolute."""
    origin: float
    """Its own time in seconds at annotation time 0. Negative: it begins later."""


class MediaClock(Struct, frozen=True, kw_only=True):
    """The relation of times: annotation time = shift + rate * (session time + the gaps before it), in seconds."""

    rate: float = 1.0
    shift: float = 0.0
    gaps: tuple[Outage, ...] = ()
    linked: tuple[LinkedFile, ...] = ()
    """The recordings. The first is the one with this clock."""

    def to_ms(self, at: float) -> int:
        """Convert session time to whole milliseconds of annotation time. The order of times is kept."""
        return math.floor((self.shift + self.rate * (at + seconds_away(self.gaps, at))) * 1000 + 0.5)

    def as_coded(self) -> CodedClock:
        """Return the same clock in the form of annotation files."""
        return CodedClock(self.shift, self.rate, tuple((each.at, each.seconds) for each in self.gaps))


def clock_of_file(file: MediaFile, gaps: tuple[Outage, ...], origin: float = 0.0) -> MediaClock:
    """Return the clock of annotations that were made with an aligned recording.

    :param file: the recording.
    :param gaps: the session's outages.
    :param origin: its own seconds at annotation time 0.
    """
    return MediaClock(rate=file.rate, shift=offset_at_start(file, gaps) - origin, gaps=gaps)


def recording_clock(
    data: SessionData,
    warnings: list[str],
    *,
    first: MediaKind,
    alone: bool = False,
    fits: Callable[[MediaFile], bool] = lambda file: True,
) -> MediaClock:
    """Return the clock of one recording, whose own time is annotation time. Without one, session time with its gaps.

    `first`: the preferred kind of file. `alone`: only this file is linked. `fits`: the files that the format can use.
    `warnings` gets sentences about uncertainties.
    """
    files = [each for each in _aligned_files(data, warnings, first) if fits(each)]
    if not files:
        return MediaClock(gaps=data.outages)
    leader = files[0]
    files = files[:1] if alone else files
    gaps = data.outages
    offset = offset_at_start(leader, gaps)
    linked = [
        LinkedFile(file=each, path=_path(data, each), origin=offset_at_start(each, gaps) - offset) for each in files
    ]
    _warn_of_doubts(data, files, gaps, warnings)
    return MediaClock(rate=leader.rate, shift=offset, gaps=gaps, linked=tuple(linked))


def session_clock(data: SessionData, warnings: list[str]) -> MediaClock:
    """Return session time scaled by the rate of the first video, and moved only as far as ELAN requires.

    ELAN cannot show a file that begins after the annotations do (its time origin would be negative). If recordings
    began after the session, annotation time 0 is the start of the last one. A recording that began much later than the
    first is not linked, because everything before it would be lost.
    """
    files = _aligned_files(data, warnings, "video")
    if not files:
        return MediaClock(gaps=data.outages)
    gaps = data.outages
    begins = {id(each): -offset_at_start(each, gaps) for each in files}
    earliest = max(0.0, min(begins.values()))
    together = [each for each in files if begins[id(each)] <= earliest + SAME_START_SECONDS]
    for each in files:
        if each not in together:
            warnings.append(
                f"{data.facts.session}: {each.path} begins {begins[id(each)]:.1f} s after the session and long after "
                "the first recording, which ELAN cannot show together; it is not linked"
            )
    late = max(0.0, *(begins[id(each)] for each in together))
    linked = [LinkedFile(file=each, path=_path(data, each), origin=late - begins[id(each)]) for each in together]
    _warn_of_doubts(data, together, gaps, warnings)
    return MediaClock(rate=together[0].rate, shift=0.0 - late, gaps=gaps, linked=tuple(linked))


def warn_of_lost(data: SessionData, lost: int, warnings: list[str]) -> None:
    """Warn how many annotations are before the start of the recording."""
    if lost:
        warnings.append(
            f"{data.facts.session}: the recording begins later than the session, so {pluralize(lost, 'annotation')} "
            f"of what happened before {'is' if lost == 1 else 'are'} left out; `--format tables` has everything"
        )


def _aligned_files(data: SessionData, warnings: list[str], first: MediaKind) -> list[MediaFile]:
    """Return the aligned videos and audios. Kind `first` comes first, and within each kind files with a known drift."""
    found: list[MediaFile] = []
    for file in data.media:
        if file.kind not in ("video", "audio"):
            continue
        if file.offset is not None:
            found.append(file)
        else:
            warnings.append(
                f"{data.facts.session}: the place of {file.path} on the session's clock is not known, so it is not "
                "linked; align it with `rise-engine media add`, by --find-marks or --at"
            )
    return sorted(found, key=lambda file: (file.kind != first, not _rate_is_measured(file)))


def _warn_of_doubts(data: SessionData, files: list[MediaFile], gaps: tuple[Outage, ...], warnings: list[str]) -> None:
    """Warn about uncertain alignments of linked files. The first file sets the clock of the annotations."""
    leader, session = files[0], data.facts.session
    if gaps:
        times = ", ".join(f"{gap.seconds:.1f} s at {gap.at:.1f} s" for gap in gaps)
        warnings.append(
            f"{session}: it had no engine for a while ({times}); later annotations are moved by as much, by the "
            "computer's clock, as the recordings went on"
        )
    for file in files:
        if gaps and len({seconds_away(gaps, mark.session_at) for mark in file.marks}) > 1:
            warnings.append(
                f"{session}: marks before and after that have aligned {file.path}, which cannot be right for both; "
                "align it by those of one side (`rise-engine media add --at`)"
            )
        if not _path(data, file).exists():
            warnings.append(f"{session}: {file.path} is not there now; it is linked where it was")
        if file.aligned_by == "start":
            warnings.append(
                f"{session}: {file.path} is aligned by when its recorder was started, which can be off by a second; "
                "`rise-engine media add --find-marks` aligns it by its marks"
            )
        if not _rate_is_measured(file) and max(data.facts.duration, file.duration or 0.0) > LONG_SECONDS:
            warnings.append(
                f"{session}: the drift of {file.path} was not measured, and it is "
                "longer than 20 minutes; measure it with two marks far apart (`rise-engine media add --find-marks`)"
            )
        apart = abs(file.rate - leader.rate) * data.facts.duration
        if apart > FRAME_SECONDS:
            warnings.append(
                f"{session}: annotations run with {leader.path}; against it {file.path} is {apart:.2f} s off at the "
                "end, because their clocks differ"
            )


def _rate_is_measured(file: MediaFile) -> bool:
    return len(file.marks) >= 2 or file.rate != 1.0


def offset_at_start(file: MediaFile, gaps: Sequence[Outage]) -> float:
    """Return the media time at the session's start, also for a file that began after a gap and was aligned there."""
    assert file.offset is not None
    laid_at = file.marks[0].session_at if file.marks else max(0.0, -file.offset)
    return file.offset - file.rate * seconds_away(gaps, laid_at)


def _path(data: SessionData, file: MediaFile) -> Path:
    return (data.folder / file.path).absolute()


TierActor: TypeAlias = Literal["robot", "wizard", "participant", "session"]
"""Who acts in a tier."""
MOMENT_MS = 100
"""The length of the annotation of an event without duration."""
ROBOT_SPEECH = "robot speech"
"""The only tier of an empty session, because programs require at least one."""
_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff\u2028\u2029]")
"""Characters that XML cannot contain, or that some programs take for a line end. Annotations have one line."""


class TierSpan(Struct, frozen=True, kw_only=True):
    """A part of a session in session seconds, before it is laid out."""

    tier: str
    start: float
    end: float | None
    """None: an event without duration."""
    text: str
    code: str
    """A code that is the same for equal events: an act's name, a rule with its state."""
    actor: TierActor
    asked_by: str = ""
    """The kind of requester, for an act."""


class Annotation(Struct, frozen=True, kw_only=True):
    """One annotation, in milliseconds on the clock of the annotations."""

    start: int
    end: int
    """Later than `start`."""
    moment: bool
    """Whether it had no length and got one to be visible."""
    text: str
    """One line, never empty."""
    span: TierSpan
    """Its source."""


class Tier(Struct, frozen=True, kw_only=True):
    """One row of annotations in the order of time, without overlaps."""

    name: str
    """One line, unique in the session."""
    lane: int
    """0, or a higher number for overlapping annotations."""
    actor: TierActor
    annotations: tuple[Annotation, ...]


class TierSet(Struct, frozen=True, kw_only=True):
    """All tiers of one session. There is at least one."""

    tiers: tuple[Tier, ...]
    lost: int
    """The number of omitted spans that ended before 0."""
    end: int
    """Milliseconds at which the session or the last annotation ended, at least 1."""


def lay_out(
    spans: Iterable[TierSpan],
    clock: MediaClock,
    duration: float,
    *,
    group: Callable[[TierSpan], str] = lambda span: span.tier,
) -> TierSet:
    """Lay out all spans in tiers, in the order of their first spans.

    `clock`: converts session time. `duration`: the session's length in session seconds. `group`: spans with the same
    result must not overlap; it becomes the tier's name.
    """
    groups: dict[str, list[TierSpan]] = {}
    for span in spans:
        groups.setdefault(one_line(group(span)) or "?", []).append(span)
    names = _Names(groups)
    tiers: list[Tier] = []
    lost = 0
    for name, members in groups.items():
        doers = {span.actor for span in members}
        actor: TierActor = members[0].actor if len(doers) == 1 else "session"
        lanes, fell_off = _pack(members, clock)
        lost += fell_off
        for number, lane in enumerate(lanes):
            given = names.give(name, number)
            tiers.append(Tier(name=given, lane=number, actor=actor, annotations=tuple(lane)))
    if not tiers:
        tiers.append(Tier(name=ROBOT_SPEECH, lane=0, actor="robot", annotations=()))
    ends = [tier.annotations[-1].end for tier in tiers if tier.annotations]
    return TierSet(tiers=tuple(tiers), lost=lost, end=max([1, clock.to_ms(duration), *ends]))


def one_line(text: str) -> str:
    """Convert a text to one line that XML and all readers accept: blanks for line ends and tabs, `�` for controls."""
    text = text.replace("\r\n", " ")
    text = _UNFIT.sub(lambda found: " " if found[0] in "\t\n\r\x0b\x0c\x85\u2028\u2029" else "\ufffd", text)
    return text.strip()


class _Names:
    """Makes unique tier names. A rule may be called `note 2`."""

    def __init__(self, groups: Iterable[str]) -> None:
        self._taken = set(groups)

    def give(self, name: str, lane: int) -> str:
        if lane == 0:
            return name
        number = lane + 1
        while f"{name} {number}" in self._taken:
            number += 1
        self._taken.add(f"{name} {number}")
        return f"{name} {number}"


class _LaidSpan(Struct):
    """A span in milliseconds. The end of an event without duration may still move."""

    start: int
    end: int
    yields: bool
    """Whether it may end earlier, because the next one begins."""
    span: TierSpan


def _pack(spans: list[TierSpan], clock: MediaClock) -> tuple[list[list[Annotation]], int]:
    """Return as few rows without overlaps as possible, and the number of spans before 0."""
    pieces: list[_LaidSpan] = []
    for span in spans:
        start = clock.to_ms(span.start)
        end = start if span.end is None else clock.to_ms(span.end)
        moment = end <= start
        if (start if moment else end - 1) < 0:
            continue
        pieces.append(_LaidSpan(max(start, 0), start + MOMENT_MS if moment else end, moment, span))
    fell_off = len(spans) - len(pieces)
    pieces.sort(key=lambda piece: piece.start)  # stable: keeps the order of equal starts
    lanes: list[list[_LaidSpan]] = []
    for piece in pieces:
        for lane in lanes:
            last = lane[-1]
            if last.end <= piece.start or (last.yields and last.start < piece.start):
                last.end = min(last.end, piece.start)
                lane.append(piece)
                break
        else:
            lanes.append([piece])
    return [[_annotation(piece) for piece in lane] for lane in lanes], fell_off


def _annotation(piece: _LaidSpan) -> Annotation:
    text = one_line(piece.span.text) or one_line(piece.span.code) or "?"
    return Annotation(start=piece.start, end=piece.end, moment=piece.yields, text=text, span=piece.span)
