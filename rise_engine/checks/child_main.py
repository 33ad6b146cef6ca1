"""What a child of `rise_engine.checks.child` does: it looks once, answers, and is gone."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

import msgspec

from rise_engine.base.json_codec import encode
from rise_engine.base.text import restore_all_surrogates
from rise_engine.checks.child import ChildRequest
from rise_engine.checks.kinds import look_at_explored
from rise_engine.checks.outcome import Finding
from rise_engine.checks.recorder import look_at_recorders
from rise_engine.checks.replay import look_at_last_session
from rise_engine.checks.robot import look_at_robot, say_word


def main() -> None:
    """The child's whole life."""
    answer = os.dup(1)
    os.dup2(2, 1)  # what libraries print is no answer
    request = msgspec.convert(restore_all_surrogates(msgspec.json.decode(sys.stdin.buffer.read())), ChildRequest)
    finding = _look(request)
    os.write(answer, encode(finding))
    os.close(answer)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # threads of a middleware that do not end are nobody's concern any more


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
