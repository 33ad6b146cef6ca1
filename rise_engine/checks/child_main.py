"""The main program of a child of `rise_engine.checks.child`: it makes one check, answers, and exits."""

from __future__ import annotations

import asyncio
import os
import sys
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec

from rise_engine.base.errors import SessionError
from rise_engine.base.files import is_locked
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize, restore_all_surrogates
from rise_engine.checks.child import ChildRequest
from rise_engine.checks.devices import look_at_recorders, look_at_robot, say_word
from rise_engine.checks.kinds import look_at_explored
from rise_engine.checks.outcome import Finding
from rise_engine.session.folder import JOURNAL, has_begun, read_info
from rise_engine.session.replay import compare_replay
from rise_engine.study.labels import refuse_relabelled


def look_at_last_session(sessions: Path) -> Finding:
    """Replay the last session (blocking, long for a long session); a study without sessions passes.

    :param sessions: the study's folder of sessions.
    """
    folder = last_session(sessions)
    if folder is None:
        return Finding(True, "there is no earlier session")
    try:
        refuse_relabelled(folder)
        compared = compare_replay(folder)
    except SessionError as error:
        return Finding(False, folder.name, f"the last session cannot be replayed: {error}")
    if compared.identical:
        return Finding(True, f"{folder.name}: identical, {pluralize(compared.records, 'record')}")
    why = str(compared.difference) if compared.difference is not None else "something in its journal cannot be read"
    return Finding(False, folder.name, f"the last session does not replay identically: {why}")


def last_session(sessions: Path) -> Path | None:
    """Return the session that began last and does not run; None: there is none."""
    found: list[tuple[datetime, Path]] = []
    with suppress(OSError):
        for folder in sessions.iterdir():
            if has_begun(folder) and not is_locked(folder / JOURNAL):
                with suppress(SessionError, ValueError):
                    found.append((datetime.fromisoformat(read_info(folder, compare=False).started), folder))
    return max(found)[1] if found else None


def main() -> None:
    """Handle one request."""
    answer = os.dup(1)
    os.dup2(2, 1)  # output that libraries print is not the answer
    request = msgspec.convert(restore_all_surrogates(msgspec.json.decode(sys.stdin.buffer.read())), ChildRequest)
    finding = _look(request)
    os.write(answer, encode(finding))
    os.close(answer)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # does not wait for threads of a middleware that never end


def _look(request: ChildRequest) -> Finding:
    if request.kind == "replay":
        return look_at_last_session(Path(request.sessions))
    if request.kind == "explored":
        return look_at_explored(Path(request.study), request.session, request.robot, request.mode)
    if request.kind == "recorder":
        return asyncio.run(look_at_recorders(request))
    return asyncio.run(say_word(request) if request.kind == "sound" else look_at_robot(request))


if __name__ == "__main__":
    main()
