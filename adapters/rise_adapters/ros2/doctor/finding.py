"""One finding of the doctor, and the printed form of all findings."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
from msgspec import Struct

# --- the environment of a terminal ------------------------------------------------------------------------------------

Environment: TypeAlias = Mapping[str, str]

DISTRIBUTION = "jazzy"
DEFAULT_RMW = "rmw_fastrtps_cpp"
"""The default middleware of that distribution."""
CYCLONE_RMW = "rmw_cyclonedds_cpp"


def sourced_prefixes(environment: Environment) -> list[Path]:
    """The folders of sourced installations and workspaces, from AMENT_PREFIX_PATH."""
    return [Path(prefix) for prefix in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def installed_version(package: str) -> str:
    """The version of a Python package; empty: not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


Level: TypeAlias = Literal["ok", "note", "warning", "problem"]


class DoctorFinding(Struct, frozen=True):
    """One finding."""

    level: Level
    about: str
    """Its subject: ros, rmw, network, transport, interfaces, robot or graph."""
    sentence: str
    remedy: str = ""
    """The remedy."""


def exit_status(findings: Sequence[DoctorFinding]) -> int:
    """The exit status: 1 if there is a problem."""
    return 1 if any(finding.level == "problem" for finding in findings) else 0


def as_text(findings: Sequence[DoctorFinding], width: int = 100) -> str:
    """The findings for a person, with totals in the last line."""
    lines: list[str] = []
    for finding in findings:
        head = f"{finding.level:<9}"
        lines += textwrap.wrap(finding.sentence, width, initial_indent=head, subsequent_indent=" " * 9)
        if finding.remedy:
            lines += textwrap.wrap(finding.remedy, width, initial_indent=" " * 9 + "→ ", subsequent_indent=" " * 11)
    counts = [(level, sum(finding.level == level for finding in findings)) for level in ("problem", "warning")]
    problems = [f"{number} {level}{'s' if number != 1 else ''}" for level, number in counts if number]
    lines.append(", ".join(problems) if problems else "no problems found")
    return "\n".join(lines) + "\n"


def as_json(findings: Sequence[DoctorFinding]) -> str:
    """The findings as one JSON object."""
    levels = [finding.level for finding in findings]
    return msgspec.json.encode(
        {"problems": levels.count("problem"), "warnings": levels.count("warning"), "findings": list(findings)}
    ).decode()
