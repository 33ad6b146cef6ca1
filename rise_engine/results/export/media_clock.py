"""The conversion of session time to the time of a recording that is annotated.

media time = offset + rate * session time (`rise_engine.session.media`). An annotator needs times on the recording's
clock. Annotations are scaled by its rate, because no annotation format can say that a camera runs fast. If a format
lets each file begin elsewhere (ELAN, BORIS), the other files are aligned with the first one.

While a session has no engine, its time stands still, but cameras go on. So events after a recovery are moved by the
time that passed on the computer's clock. A file is aligned with the part of the session that has its marks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from msgspec import Struct

from rise_engine.base.text import pluralize
from rise_engine.ports.recorder import MediaKind
from rise_engine.results.analysis.model import Outage, SessionData
from rise_engine.results.analysis.outages import seconds_away
from rise_engine.session.coded_formats import CodedClock
from rise_engine.session.media import MediaFile

LONG_SECONDS = 20 * 60.0
"""In longer recordings, an unmeasured drift is visible: 50 ppm, usual between two clocks, make 60 ms."""
FRAME_SECONDS = 0.04
"""One video frame. Smaller differences are invisible."""
SAME_START_SECONDS = 30.0
"""Recorders that are started together begin within this time. A recording that begins later is another part, for
example after a camera restart."""


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
        """Return the same clock in the form that annotation files state and read back."""
        return CodedClock(self.shift, self.rate, tuple((each.at, each.seconds) for each in self.gaps))


def clock_of_file(file: MediaFile, gaps: tuple[Outage, ...], origin: float = 0.0) -> MediaClock:
    """Return the clock of annotations that were made with an aligned recording.

    :param file: the recording.
    :param gaps: when the session had no engine.
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
    `warnings` gets sentences about what is uncertain.
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
    _tell_doubts(data, files, gaps, warnings)
    return MediaClock(rate=leader.rate, shift=offset, gaps=gaps, linked=tuple(linked))


def session_clock(data: SessionData, warnings: list[str]) -> MediaClock:
    """Return session time scaled by the rate of the first video, and moved only as far as ELAN needs it.

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
    _tell_doubts(data, together, gaps, warnings)
    return MediaClock(rate=together[0].rate, shift=0.0 - late, gaps=gaps, linked=tuple(linked))


def warn_of_lost(data: SessionData, lost: int, warnings: list[str]) -> None:
    """Warn how many annotations are before the start of the recording."""
    if lost:
        warnings.append(
            f"{data.facts.session}: the recording begins later than the session, so {pluralize(lost, 'annotation')} "
            f"of what happened before {'is' if lost == 1 else 'are'} left out; `--format tables` has everything"
        )


def _aligned_files(data: SessionData, warnings: list[str], first: MediaKind) -> list[MediaFile]:
    """Return the aligned videos and audios. Kind `first` is first, and within each kind files with a known drift."""
    found: list[MediaFile] = []
    for file in data.media:
        if file.kind not in ("video", "audio"):
            continue
        if file.offset is not None:
            found.append(file)
        else:
            warnings.append(
                f"{data.facts.session}: the place of {file.path} on the session's clock is not known, so it is not "
                "linked; `rise-engine media add` with --find-marks or --at says it"
            )
    return sorted(found, key=lambda file: (file.kind != first, not _rate_is_measured(file)))


def _tell_doubts(data: SessionData, files: list[MediaFile], gaps: tuple[Outage, ...], warnings: list[str]) -> None:
    """Warn about uncertain alignments of linked files. The first file sets the clock of the annotations."""
    leader, session = files[0], data.facts.session
    if gaps:
        times = ", ".join(f"{gap.seconds:.1f} s at {gap.at:.1f} s" for gap in gaps)
        warnings.append(
            f"{session}: it had no engine for a while ({times}); what happened after that is moved by as much, by the "
            "computer's clock, as the recordings went on"
        )
    for file in files:
        if gaps and len({seconds_away(gaps, mark.session_at) for mark in file.marks}) > 1:
            warnings.append(
                f"{session}: marks before and after that have laid {file.path}, which cannot be right for both; lay "
                "it by those of one side (`rise-engine media add --at`)"
            )
        if not _path(data, file).exists():
            warnings.append(f"{session}: {file.path} is not there now; it is linked where it was")
        if file.aligned_by == "start":
            warnings.append(
                f"{session}: {file.path} is laid by when its recorder was started, which can be off by a second; "
                "`rise-engine media add --find-marks` lays it by its marks"
            )
        if not _rate_is_measured(file) and max(data.facts.duration, file.duration or 0.0) > LONG_SECONDS:
            warnings.append(
                f"{session}: how much faster or slower the clock of {file.path} runs was not measured, and it is "
                "longer than 20 minutes; two marks far apart in it say so (`rise-engine media add --find-marks`)"
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
