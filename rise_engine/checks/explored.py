"""Whether the scenario that is about to run was explored, and nothing in it gets stuck (`auto = "explored"`).

What came of it is kept beside the study, so that the same scenario is looked at once; of a scenario that has changed
since, the answer is stale, and it is looked at anew.
"""

from __future__ import annotations

import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine.checks.outcome import Finding, local_now
from rise_engine.explore.exploration import Exploration, explore
from rise_engine.json_codec import encode
from rise_engine.scenario import load
from rise_engine.scenario.model import Mode, Scenario
from rise_engine.session.disk import write_private_file

KEPT = ".explored.json"
"""In the study's folder; hidden, so that it is no part of what is published."""
SECONDS = 60.0
"""How long is looked at most."""


class ExploredBefore(Struct, frozen=True):
    """What came of exploring a scenario."""

    scenario: str
    """Its hash."""
    at: str
    """When, as ISO 8601."""
    situations: int
    is_complete: bool
    problems: tuple[str, ...]


def look_at_explored(study: Path, scenario_folder: str, robot: str | None, mode: Mode) -> Finding:
    """Whether anything in a scenario can get stuck (blocking, a minute at most).

    :param study: the study's folder, where the answer is kept.
    :param scenario_folder: what will run.
    :param robot: another robot than the scenario's; None: its own.
    :param mode: the session's.
    """
    scenario = load(scenario_folder, robot=robot, mode=mode).scenario
    if scenario is None:
        return Finding(False, reason="the scenario has errors; `rise-engine check` says which")
    before = read_kept(study)
    if before is not None and before.scenario == scenario.hash and before.is_complete:
        return _finding(before, "")
    stale = ""
    if before is not None and before.scenario != scenario.hash:
        stale = f"the scenario has changed since it was explored on {before.at[:10]}; explored anew, "
    found = _explore(scenario, local_now())
    with suppress(OSError):  # what cannot be kept is looked at again
        new = study / f"{KEPT}.new"
        write_private_file(new, encode(found))
        new.replace(study / KEPT)
    return _finding(found, stale)


def read_kept(study: Path) -> ExploredBefore | None:
    """What is kept beside a study; None: nothing that can be read."""
    try:
        return msgspec.json.decode((study / KEPT).read_bytes(), type=ExploredBefore)
    except (OSError, msgspec.DecodeError):
        return None


def _explore(scenario: Scenario, now: datetime) -> ExploredBefore:
    until = time.monotonic() + SECONDS
    exploration: Exploration = explore(scenario, go_on=lambda space: time.monotonic() < until)
    problems = tuple(finding.text for finding in exploration.findings if finding.level == "problem")
    at = now.isoformat(timespec="seconds")
    return ExploredBefore(scenario.hash, at, exploration.situations, exploration.is_complete, problems)


def _finding(found: ExploredBefore, stale: str) -> Finding:
    looked = f"{stale}looked at {found.situations:,} situations"
    if not found.problems:
        rest = "" if found.is_complete else f"; that was not all of them, within {SECONDS:g} s"
        return Finding(True, f"{looked}, none with a problem{rest}")
    more = f" (and {len(found.problems) - 1} more)" if len(found.problems) > 1 else ""
    return Finding(False, looked, f"{found.problems[0]}{more}; `rise-engine explore` shows the way there")
