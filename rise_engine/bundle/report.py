"""The report of a study, in its bundle."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rise_engine.analysis.model import SessionData
from rise_engine.export.format import ExportContext

REPORT = "report/report.html"


def write_report(root: Path, sessions: Iterable[SessionData], context: ExportContext) -> str:
    """Write the study's report into a bundle; why there is none, or empty."""
    return "this version of rise-tui makes no reports"
