"""The tiers of a session as lines of tab-separated text, for a transcription that somebody has begun already.

ELAN reads them with File > Import > CSV / Tab-delimited text file; R and spreadsheets read them as they are. Times are
milliseconds in the session's first video (else its first sound file, else of the session), as a transcription has them
that was made from that video.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rise_engine.analysis.model import SessionData
from rise_engine.export.format import ExportContext, ExportFormat
from rise_engine.export.media_clock import recording_clock, warn_of_lost
from rise_engine.export.spans import spans_of
from rise_engine.export.textgrid import tell_whose_time
from rise_engine.export.tiers import lay_out

COLUMNS = ("tier", "begin_ms", "end_ms", "text")


def write_elan_tab(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the annotations of one session to `out`, a path that does not exist."""
    for data in sessions:
        clock = recording_clock(data, context.warnings, first="video", alone=True)
        found = lay_out(spans_of(data), clock, data.facts.duration)
        tell_whose_time(data, clock, context.warnings)
        warn_of_lost(data, found.lost, context.warnings)
        with out.open("x", encoding="utf-8", newline="\n") as file:
            file.write("\t".join(COLUMNS) + "\n")
            for tier in found.tiers:
                for each in tier.annotations:
                    file.write(f"{tier.name}\t{each.start}\t{each.end}\t{each.text}\n")


FORMAT = ExportFormat(
    name="elan-tab",
    about="ELAN: the same tiers as tab-separated text, to import into a transcription that you have",
    shape="file-per-session",
    suffix=".txt",
    write=write_elan_tab,
)
