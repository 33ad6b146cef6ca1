"""Sessions that did not end and that no engine continues, for the message when no session runs."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from typing import NamedTuple

from rise_engine.base.errors import SessionError
from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import session_name
from rise_engine.session.folder import describe_session, find_unfinished, read_info

MAX_SCENARIOS = 3
"""Maximum number of listed scenarios, those with the latest sessions."""


class UnfinishedSession(NamedTuple):
    """The latest unfinished session of one scenario."""

    command: str
    """The command that offers to recover it."""
    sentence: str
    """A description of the session."""


def unfinished_sessions(running: Mapping[str, SessionSummary | None]) -> list[UnfinishedSession]:
    """Find unfinished sessions, the latest first, without the `running` ones (`registry.ask_all_summaries`)."""
    recorded = {os.path.realpath(about.folder) for about in running.values() if about is not None and about.folder}
    found: dict[str, UnfinishedSession] = {}
    for folder in find_unfinished():
        if os.path.realpath(folder) in recorded:
            continue
        try:
            scenario = read_info(folder, compare=False).scenario_folder
        except SessionError:
            continue
        name = session_name(scenario)
        if name in found or name in running or not os.path.isdir(scenario):  # noqa: PTH112
            continue
        found[name] = UnfinishedSession(f"rise-tui --config {shlex.quote(scenario)}", describe_session(folder))
        if len(found) == MAX_SCENARIOS:
            break
    return list(found.values())


def unfinished_lines(sessions: list[UnfinishedSession]) -> list[str]:
    """Format the sessions as lines; none if there are no sessions."""
    if not sessions:
        return []
    first = "A session did not end. To go on with it:"
    if len(sessions) > 1:
        first = "These sessions did not end. To go on with one of them:"
    return ["", first, *(line for command, what in sessions for line in (f"  {command}", f"      {what}"))]
