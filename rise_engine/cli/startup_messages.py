"""What `rise-engine serve` says to a person: how far it is, and at last whether it serves."""

from __future__ import annotations

import sys

from rise_engine import exit_status
from rise_engine.server.spawn import EngineRefused, EngineStarted, StartOutcome, StartupProgress
from rise_engine.text import clean


def print_startup(message: StartupProgress | StartOutcome, scenario_folder: str) -> None:
    """Print it to standard error. `scenario_folder`: what was to run; empty for a study, which is right as it is."""
    match message:
        case StartupProgress(sentence=sentence):
            lines = [sentence]
        case EngineStarted(name=name, folder=folder):
            lines = [*message.lines, f"serving {name}; the record is in {folder}"]
        case EngineRefused():
            lines = _refusal_lines(message, scenario_folder)
    for line in lines:
        sys.stderr.write(clean(line) + "\n")
    sys.stderr.flush()


def _refusal_lines(refused: EngineRefused, scenario_folder: str) -> list[str]:
    lines = [*refused.lines]
    for folder, sentence in refused.unfinished:
        lines += [f"  {sentence}", f"    {folder}"]
    if refused.others:
        lines.append("of other participants or conditions, and not recovered for this one:")
    for folder, sentence in refused.others:
        lines += [f"  {sentence}", f"    {folder}"]
    if refused.code == exit_status.UNFINISHED and not refused.unfinished:
        lines.append("say --new to begin, or name theirs to go on with one (--participant, --condition)")
    elif refused.code == exit_status.UNFINISHED:
        lines.append("say --recover to go on with the latest, or --new")
    elif refused.code == exit_status.REFUSED:
        refused_folder = f"{scenario_folder} was refused: " if scenario_folder else ""
        lines.append(f"{refused_folder}nothing was started")
    return lines
