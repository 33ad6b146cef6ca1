"""Reports of people and programs about a session: checks, its outcome, recordings, marks in them (semantics.md 11).

A report leaves one record and changes nothing else.
"""

from __future__ import annotations

from typing import TypeAlias

from rise_engine.kernel.core import Core
from rise_engine.kernel.inputs import CheckReport, OutcomeReport, RecordingReport, SyncMark
from rise_engine.kernel.records import CheckRecord, OutcomeRecord, RecordingRecord, SyncRecord

Report: TypeAlias = CheckReport | OutcomeReport | RecordingReport | SyncMark
ReportRecord: TypeAlias = CheckRecord | OutcomeRecord | RecordingRecord | SyncRecord

REPORT_KINDS: dict[type, str] = {
    CheckRecord: "check",
    OutcomeRecord: "outcome",
    RecordingRecord: "recording",
    SyncRecord: "sync",
}
"""The kind in records, by the record's class."""


def record_report(core: Core, report: Report) -> None:
    """Record a report unchanged."""
    match report:
        case CheckReport(id=id, text=text, result=result, value=value):
            core.emit(CheckRecord, id, text, result, value, report.reason, report.source)
        case OutcomeReport():
            core.emit(OutcomeRecord, report.status, report.reason, report.source)
        case RecordingReport(name=name, status=status, path=path):
            core.emit(RecordingRecord, name, status, path, report.bytes, report.reason, report.source)
        case SyncMark():
            core.emit(SyncRecord, report.number, report.medium, report.text, report.source, report.at, report.within)
