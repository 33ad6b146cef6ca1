"""What `rise-engine serve` says to a person: how far it is, and at last whether it serves."""

from __future__ import annotations

import sys

from rise_engine import exit_status
from rise_engine.server.spawn import StartupProgress, StartupReport
from rise_engine.text import clean


def print_startup(message: StartupReport | StartupProgress, scenario_folder: str) -> None:
    """Print it to standard error."""
    lines = [message.sentence] if isinstance(message, StartupProgress) else _report_lines(message, scenario_folder)
    for line in lines:
        sys.stderr.write(clean(line) + "\n")
    sys.stderr.flush()


def _report_lines(report: StartupReport, scenario_folder: str) -> list[str]:
    lines = [*report.lines]
    for folder, sentence in report.unfinished:
        lines += [f"  {sentence}", f"    {folder}"]
    if report.others:
        lines.append("of other participants or conditions, and not recovered for this one:")
    for folder, sentence in report.others:
        lines += [f"  {sentence}", f"    {folder}"]
    if report.code == exit_status.UNFINISHED and not report.unfinished:
        lines.append("say --new to begin, or name theirs to go on with one (--participant, --condition)")
    elif report.code == exit_status.UNFINISHED:
        lines.append("say --recover to go on with the latest, or --new")
    elif report.code == exit_status.REFUSED:
        lines.append(f"{scenario_folder} was refused: nothing was started")
    elif report.code == exit_status.OK:
        lines.append(f"serving {report.name}; the record is in {report.folder}")
    return lines
