"""Praat TextGrids of a session: the same tiers as for ELAN, for the analysis of sound.

They are in the long form of Praat's manual ("TextGrid file formats"): intervals without gaps, with empty ones between
the annotations, and doubled quotes in texts. A TextGrid belongs to one sound but does not name it. Its times are those
of the session's first sound file, or else of the first video, or else session time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.format import ExportContext, ExportFormat
from rise_engine.results.export.media_clock import MediaClock, recording_clock, warn_of_lost
from rise_engine.results.export.spans import spans_of
from rise_engine.results.export.tiers import Tier, lay_out


def write_textgrid(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the TextGrid of one session to `out`, a path that does not exist."""
    for data in sessions:
        clock = recording_clock(data, context.warnings, first="audio", alone=True)
        found = lay_out(spans_of(data), clock, data.facts.duration)
        tell_whose_time(data, clock, context.warnings)
        warn_of_lost(data, found.lost, context.warnings)
        end = max(found.end, *(round((each.file.duration or 0.0) * 1000) for each in clock.linked), 0)
        with out.open("x", encoding="utf-8", newline="\n") as file:
            file.writelines(f"{line}\n" for line in _lines(found.tiers, end))


def tell_whose_time(data: SessionData, clock: MediaClock, warnings: list[str]) -> None:
    """Name the recording whose time a file has, because the file cannot."""
    if clock.linked:
        warnings.append(
            f"{data.facts.session}: its times are those of {clock.linked[0].file.path}, in which the session "
            f"begins at {clock.shift:.3f} s"
        )


def _lines(tiers: tuple[Tier, ...], end: int) -> Iterator[str]:
    yield from ('File type = "ooTextFile"', 'Object class = "TextGrid"', "")
    yield from ("xmin = 0", f"xmax = {_seconds(end)}", "tiers? <exists>", f"size = {len(tiers)}", "item []:")
    for number, tier in enumerate(tiers, 1):
        intervals = list(_intervals(tier, end))
        yield f"    item [{number}]:"
        yield '        class = "IntervalTier"'
        yield f"        name = {_quoted(tier.name)}"
        yield from ("        xmin = 0", f"        xmax = {_seconds(end)}")
        yield f"        intervals: size = {len(intervals)}"
        for place, (start, stop, text) in enumerate(intervals, 1):
            yield f"        intervals [{place}]:"
            yield from (f"            xmin = {_seconds(start)}", f"            xmax = {_seconds(stop)}")
            yield f"            text = {_quoted(text)}"


def _intervals(tier: Tier, end: int) -> Iterator[tuple[int, int, str]]:
    """Give the annotations and the gaps between them, from 0 to `end`."""
    at = 0
    for annotation in tier.annotations:
        if annotation.start > at:
            yield at, annotation.start, ""
        yield annotation.start, annotation.end, annotation.text
        at = annotation.end
    if at < end:
        yield at, end, ""


def _seconds(ms: int) -> str:
    return f"{ms // 1000}.{ms % 1000:03d}".rstrip("0").rstrip(".")


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"'


FORMAT = ExportFormat(
    name="textgrid",
    about="Praat: the same tiers as a TextGrid, in the time of the session's sound file",
    shape="file-per-session",
    suffix=".TextGrid",
    write=write_textgrid,
)
