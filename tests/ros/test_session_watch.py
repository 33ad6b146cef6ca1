"""The reference wrapper's dead man's switch (adapters/rise_ros/rise_ros/session_watch.py): when a robot may move."""

from __future__ import annotations

import asyncio
import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.ros2.session_node.neighbours import BEAT_SECONDS, TOPIC, NeighbourSessions
from rise_adapters.ros2.transport.port import STATUS

from tests.ros.memory import MemoryTransport, MemoryWire

_SPEC = spec_from_file_location(
    "session_watch", Path(__file__).parents[2] / "adapters/rise_ros/rise_ros/session_watch.py"
)
assert _SPEC is not None and _SPEC.loader is not None
session_watch: Any = module_from_spec(_SPEC)
_SPEC.loader.exec_module(session_watch)
SILENT, NONE = "the session has given no sign of life for 2 s", "no session is there"


def word(state: str, id: str = "a") -> str:
    return json.dumps({"id": id, "state": state})


@pytest.mark.parametrize(
    ("said", "now", "why"),
    [
        ([], 100, ""),
        ([(0, word("asking"))], 100, ""),
        ([(0, word("serving"))], 2, ""),
        ([(0, word("serving"))], 2.1, SILENT),
        ([(0, word("serving")), (2, word("serving"))], 3, ""),
        ([(0, word("serving")), (1, word("over"))], 100, ""),
        ([(0, word("serving")), (1, word("over", "b"))], 100, SILENT),
        ([(0, word("serving")), (9, word("serving", "recovered"))], 10, ""),
        ([(0, word("serving")), (3, word("serving", "b"))], 3, SILENT),
        ([(0, word("serving")), (4, word("serving", "b"))], 4.1, ""),
        ([(0, word("serving")), (1, word("serving", "b")), (2.5, word("over", "b"))], 100, SILENT),
        ([(0, word("serving")), (1, word("asking", "b"))], 100, SILENT),
        ([(0, word("serving"))] + [(5, junk) for junk in ("", "7", "[]", '{"id": 1}', "[" * 9999)], 5, SILENT),
    ],
)
def test_when_the_robot_may_move(said: list[tuple[float, str]], now: float, why: str) -> None:
    watch, required, off = (
        session_watch.SessionWatch(seconds, required=required)
        for seconds, required in ((2, False), (2, True), (0, True))
    )
    for each in (watch, required, off):
        for at, text in said:
            each.hear(text, at)
    there = any('"serving"' in text for _, text in said) and not any(text == word("over") for _, text in said)
    assert watch.why_not_move(now) == why
    assert required.why_not_move(now) == (why if there else NONE)
    assert off.why_not_move(now) == ""


async def test_a_session_gives_signs_of_life_until_its_end() -> None:
    """What it says is what the switch hears, twice within the two seconds at least."""
    loop = asyncio.get_running_loop()
    wire = MemoryWire()
    watch = session_watch.SessionWatch(2)
    MemoryTransport(wire, loop, "/robot_wrapper").subscribe(
        session_watch.TOPIC, "std_msgs/msg/String", lambda m: watch.hear(m["data"], loop.time()), STATUS
    )
    session = NeighbourSessions(MemoryTransport(wire, loop, "/rise"))
    assert session_watch.TOPIC == TOPIC and BEAT_SECONDS * 3 < 2
    session.announce_serving("Greeting", "folder")
    for _ in range(4):
        await asyncio.sleep(BEAT_SECONDS * 3)
        assert watch.why_not_move(loop.time()) == ""
    wire.kill("/rise")
    await asyncio.sleep(BEAT_SECONDS * 5)
    assert watch.why_not_move(loop.time()) == SILENT
    wire.heal("/rise")
    await asyncio.sleep(BEAT_SECONDS)
    assert watch.why_not_move(loop.time()) == ""
    session.close()
    await asyncio.sleep(10)
    assert watch.why_not_move(loop.time()) == "" and watch.why_not_move(loop.time() + 100) == ""
