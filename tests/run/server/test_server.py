"""What a client may do wrong, and that only it bears the consequences."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec import inspect

from rise_engine.run.protocol.messages import (
    MAX_LINE_BYTES,
    MAX_MESSAGE_BYTES,
    VERSION,
    ClientMessage,
    RefusedMessage,
    ServerMessage,
    encode_line,
)
from rise_engine.run.server import server as serving
from rise_engine.run.server.hub import SessionHub
from tests.patience import PATIENCE

from .serving import GREETING, Follower, RawConnection, served

BAD = {
    "no JSON": b"hello there\n",
    "binary": bytes(range(11, 256)) + b"\n",
    "zero bytes": b"\0" * 1000 + b"\n",
    "an empty line": b"\n",
    "a list": b"[1, 2]\n",
    "no type": b'{"id": 1}\n',
    "an unknown type": b'{"type": "format-disk"}\n',
    "an input of the robot": b'{"type":"send","id":1,"message":{"input":"robot","status":"lost"}}\n',
    "a field of another type": b'{"type":"send","id":"one","message":{"input":"note","text":"x"}}\n',
    "a missing field": b'{"type":"send","id":1}\n',
    "an unknown verb": b'{"type":"control","id":1,"verb":"seize"}\n',
    "half a character": b'{"type":"end","id":1,"reason":"\xc3"}\n',
    "a huge number": b'{"type":"end","id":' + b"9" * 5000 + b"}\n",
    "deep nesting": b'{"type":"end","id":1,"x":' + b"[" * 100_000 + b"\n",
    "two lines, the first bad": b'x\n{"type":"about"}\n',
}


@pytest.mark.parametrize("attached", [False, True], ids=["at first", "later"])
async def test_a_bad_line_ends_that_connection_with_a_sentence(scratch: Path, attached: bool) -> None:
    async with served(scratch) as session:
        other = await Follower(session.client()).attach()
        for what, line in BAD.items():
            bad = await RawConnection.open(session.path)
            if attached:
                bad.attach()
                await bad.until("ready")
            bad.writer.write(line)
            assert "is not a message of the protocol" in await bad.refused(), what
            assert other.error is None, what
        assert (await other.client.change_control("take")).accepted


@pytest.mark.parametrize("ended", [False, True], ids=["without its end", "with its end"])
async def test_a_line_without_bounds_ends_that_connection(scratch: Path, ended: bool) -> None:
    async with served(scratch) as session:
        bad = await RawConnection.open(session.path)
        bad.attach()
        await bad.until("ready")
        bad.writer.write(b" " * (MAX_LINE_BYTES + 1) + (b"\n" if ended else b""))
        assert "more than 1,048,576 bytes" in await bad.refused()
        assert not session.server.connections


async def test_a_line_may_come_in_bits_and_many_at_once(scratch: Path) -> None:
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        for byte in b'{"type":"attach","version":%d,"name":"slow","role":"node"}\n' % VERSION:
            raw.writer.write(bytes([byte]))
            await raw.writer.drain()
            await asyncio.sleep(0)
        await raw.until("ready")
        lines = [
            json.dumps({"type": "send", "id": id, "message": {"input": "note", "text": "x" * 300}}) for id in range(500)
        ]
        raw.writer.write("\n".join([*lines, ""]).encode())
        assert [(await raw.until("reply"))["id"] for _ in range(500)] == list(range(500))
        await raw.close()


async def test_half_a_line_and_the_end_of_the_connection(scratch: Path) -> None:
    async with served(scratch) as session:
        follower = await Follower(session.client("watch", "observer")).attach()
        raw = await RawConnection.open(session.path)
        raw.attach("half", "wizard")
        await raw.until("ready")
        await follower.until(lambda view: view.control == "wizard:half")
        raw.send(type="send", id=1, message={"input": "submit", "function": "raiseEventTopic", "behavior": "/last"})
        raw.writer.write(b'{"type":"send","id":2,"mess')
        raw.writer.close()
        await follower.until(lambda view: view.control is None)
        assert [task.behavior for task in follower.view.tasks.values()] == ["/last"], "what was whole was taken"


async def test_another_version_is_refused_in_words(scratch: Path) -> None:
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        raw.send(type="attach", version=VERSION + 1, name="anna", role="wizard", theme="a field of the future")
        sentence = await raw.refused()
        assert f"version {VERSION}" in sentence and f"version {VERSION + 1}" in sentence


def test_the_version_says_which_messages_there_are() -> None:
    """If this fails, a message, a record or the view has changed: raise VERSION, and write the new number here.

    A console of an earlier version would leave out what it does not know, such as a part that cannot be stopped.
    """
    fields: dict[str, list[str]] = {}

    def note(value: Any) -> None:
        if isinstance(value, inspect.StructType) and value.cls.__name__ not in fields:
            fields[value.cls.__name__] = [each.encode_name for each in value.fields]
            for each in value.fields:
                note(each.type)
        for part in ("types", "item_types", "item_type", "key_type", "value_type", "type"):
            parts = getattr(value, part, ())
            for each in parts if isinstance(parts, tuple) else (parts,):
                note(each)

    for union in (ClientMessage, ServerMessage):
        note(inspect.type_info(union))
    text = json.dumps(fields, sort_keys=True)
    assert "unstoppable" in text and len(fields) > 40
    assert (VERSION, hashlib.sha256(text.encode()).hexdigest()[:16]) == (4, "8e02af971c2e0377")


async def test_a_client_attaches_first_and_once(scratch: Path) -> None:
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        raw.send(type="send", id=1, message={"input": "note", "text": "x"})
        assert await raw.refused() == "attach first"
        raw = await RawConnection.open(session.path)
        raw.attach()
        raw.attach()
        assert await raw.refused() == "you are attached already"


async def test_a_name_can_be_shown(scratch: Path) -> None:
    async with served(scratch) as session:
        for name in ("", " ", " anna", "anna#2", "a\nb", "x" * 65):
            raw = await RawConnection.open(session.path)
            raw.attach(name)
            assert "name" in await raw.refused(), name


@pytest.mark.slow
async def test_a_connection_that_does_not_attach_is_closed(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "ATTACH_SECONDS", 0.05)
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        assert "not attached within 0.05 seconds" in await raw.refused()
        attached = await RawConnection.open(session.path)
        attached.attach()
        await attached.until("ready")
        second = await RawConnection.open(session.path)
        await second.refused()
        attached.send(type="send", id=1, message={"input": "note", "text": "x"})
        await attached.until("reply")
        await attached.close()


async def test_the_number_of_clients_is_limited(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "MAX_CLIENTS", 3)
    async with served(scratch) as session:
        raws = [await RawConnection.open(session.path) for _ in range(3)]
        for raw in raws:
            raw.attach()
            await raw.until("ready")
        more = await RawConnection.open(session.path)
        more.attach()
        assert "3 clients are connected" in await more.refused()
        raws[0].send(type="send", id=1, message={"input": "note", "text": "x"})
        await raws[0].until("reply")
        for raw in raws:
            await raw.close()


async def test_a_long_message_is_rejected_and_the_next_one_is_not(scratch: Path) -> None:
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        raw.attach()
        raw.send(type="send", id=1, message={"input": "note", "text": "x" * MAX_MESSAGE_BYTES})
        raw.send(type="send", id=2, message={"input": "note", "text": "x"})
        first, second = await raw.until("reply"), await raw.until("reply")
        assert (first["id"], first["accepted"]) == (1, False) and "65,536 bytes" in first["reason"]
        assert (second["id"], second["accepted"]) == (2, True)
        await raw.close()


async def test_unanswered_messages_are_bounded_but_stop_all_is_not(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with served(scratch) as session:
        held: list[object] = []

        def holds(self: SessionHub, client: object, message: object, answer: object) -> None:
            held.append(answer)

        raw = await RawConnection.open(session.path)
        raw.attach()
        await raw.until("ready")
        with monkeypatch.context() as patch:
            patch.setattr(SessionHub, "submit", holds)
            for id in range(serving.MAX_UNANSWERED + 1):
                raw.send(type="send", id=id, message={"input": "note", "text": "x"})
            reply = await raw.until("reply")
            assert (reply["id"], reply["accepted"]) == (serving.MAX_UNANSWERED, False) and "not answered" in reply[
                "reason"
            ]
        raw.send(type="send", id=999, message={"input": "submit", "function": "stopAll"})
        reply = await raw.until("reply")
        assert (reply["id"], reply["accepted"]) == (999, True)
        await raw.close()


async def test_a_summary_without_attaching(scratch: Path) -> None:
    from rise_engine.run.protocol import registry

    async with served(scratch) as session:
        follower = await Follower(session.client()).attach()
        await follower.until(lambda view: view.control)
        about = (await asyncio.to_thread(registry.ask_all_summaries))[session.name]
        assert about is not None
        assert (about.mode, about.control, about.clients) == ("debug", "wizard:anna", ["wizard:anna"])
        assert (about.folder, about.pid, about.version) == (str(session.folder), os.getpid(), VERSION)
        assert (
            about.title == "LabLinking: setting the table" and not about.busy and about.program.startswith("rise-tui")
        )
        await follower.close()


async def test_signs_of_life_come_by_themselves(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "HEARTBEAT_SECONDS", 0.02)
    async with served(scratch, speed=1.0) as session:
        follower = await Follower(session.client()).attach()
        await follower.until(lambda view: len(follower.pulses) > 2)
        seen = [pulse.robot_seen for pulse in follower.pulses]
        assert None not in seen and seen == sorted(seen), "the simulated robot is there all the time"
        assert all(pulse.lag >= 0 for pulse in follower.pulses)
        monkeypatch.setattr(session.engine._commands, "_robot", object())  # a driver that does not know the question
        before = len(follower.pulses)
        await follower.until(lambda view: len(follower.pulses) > before + 1)
        assert follower.pulses[-1].robot_seen is None
        await follower.close()


async def test_nobody_else_may_connect(scratch: Path) -> None:
    async with served(scratch) as session:
        folder = session.path.parent
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700 and stat.S_IMODE(session.path.stat().st_mode) == 0o600
        if os.getuid() != 0:
            return
        os.chmod(scratch, 0o755)  # noqa: PTH101
        assert await _as_nobody(session.path) == "PermissionError"
        os.chmod(folder, 0o755)  # noqa: PTH101
        assert await _as_nobody(session.path) == "PermissionError"
        os.chmod(session.path, 0o666)  # noqa: PTH101
        assert "belongs to another user" in await _as_nobody(session.path)


async def _as_nobody(path: Path) -> str:
    code = f"""
import os, socket
os.setgid(65534); os.setuid(65534)
connection = socket.socket(socket.AF_UNIX)
try:
    connection.connect({str(path)!r})
except OSError as error:
    print(type(error).__name__)
else:
    print(connection.makefile().readline())
"""
    done = await asyncio.to_thread(
        subprocess.run,
        [sys.executable, "-S", "-c", code],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


async def test_a_socket_that_lies_there_already_is_an_error(scratch: Path) -> None:
    async with served(scratch) as session:
        with pytest.raises(OSError):
            await serving.SessionServer(session.hub, session.path).start()
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(session.path))


async def test_a_connection_that_ends_while_it_is_written_to_ends_once(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is closed when a slow client has taken the rest; asyncio tells of that in the middle of its own write."""
    failed: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: failed.append(context))
    async with served(scratch, GREETING) as session:
        raw = await RawConnection.open(session.path)
        raw.attach()
        await raw.until("ready")
        raw.writer.transport.pause_reading()  # type: ignore[attr-defined]
        (connection,) = session.server.connections
        lost = asyncio.Event()
        monkeypatch.setattr(session.server, "connection_closed", lambda connection: lost.set())
        while not connection.waiting:
            connection.send([b'{"type":"nothing","text":"' + b"x" * 50_000 + b'"}\n'])
            await asyncio.sleep(0)
        connection.finish(encode_line(RefusedMessage("enough")))
        raw.writer.transport.resume_reading()  # type: ignore[attr-defined]
        assert await raw.refused() == "enough"
        async with asyncio.timeout(PATIENCE):
            await lost.wait()
        await asyncio.sleep(0)
        assert not failed, failed
        session.server.connections.clear()
