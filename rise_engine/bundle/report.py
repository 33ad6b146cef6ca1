"""The report of a study, in its bundle."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rise_engine.report.making import make_study_report
from rise_engine.report.page import page_text
from rise_engine.session.levels import ExportLevel

REPORT = "report"
"""Its folder: the page, and the reporting sheet."""


def write_report(root: Path, study: Path, level: ExportLevel, private: Iterable[str]) -> None:
    """Write the report of the study in `study`, and its reporting sheet, into the bundle in `root`.

    :raises OSError: they cannot be written.
    :raises rise_engine.errors.RiseError: the study cannot be read.
    """
    made = make_study_report(study, level, private)
    folder = root / REPORT
    folder.mkdir(0o700)
    (folder / "report.html").write_text(page_text(made.document), "utf-8")
    (folder / "sheet.md").write_text(made.sheet, "utf-8")
