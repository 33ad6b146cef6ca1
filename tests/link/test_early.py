"""Answers that leave on the journal's thread: not before they are durable, in order, and each of them once."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import pytest

from rise_engine.kernel.inputs import Note
from rise_engine.link import early as link_early
from rise_engine.link import server as serving
from rise_engine.link.early import Early
from rise_engine.session.disk import Disk

from .serving import Follower, Served, served

NOTE = {"input": "note", "text": "x"}


class Held(Disk):
    """Synchronises when it is let; says when it waits for that."""

    def __init__(self) -> None:
        self.let = threading.Event()
        self.let.set()
        self.waits = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def hold(self) -> None:
        self.waits.clear()
        self.let.clear()

    def sync(self, descriptor: int) -> None:
        if not self.let.is_set():
            self._loop.call_soon_threadsafe(self.waits.set)
            assert self.let.wait(20)
        super().sync(descriptor)


class Asker:
    """A program that asks, on a thread of its own: it gets its answer while the engine's loop stands still."""

    def __init__(self, session: Served) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(str(session.path))
        self._file = self._socket.makefile("rb")

    def send(self, **message: Any) -> None:
        self._socket.sendall(json.dumps(message).encode() + b"\n")

    def read(self) -> dict[str, Any]:
        value: dict[str, Any] = json.loads(self._file.readline())
        return value

    def attach(self) -> None:
        self.send(type="attach", version=1, name="asker", role="node")
        while self.read()["type"] != "ready":
            pass

    def answered(self) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """The records that come before the next answer, and that."""
        records: list[dict[str, Any]] = []
        while (message := self.read())["type"] != "reply":
            if message["type"] == "records":
                records += message["records"]
        return records, message

    def close(self) -> None:
        self._file.close()
        self._socket.close()


async def asked(session: Served, disk: Held) -> Asker:
    """Somebody who has asked for something; the disk has it and takes its time."""
    asker = await asyncio.to_thread(Asker, session)
    await asyncio.to_thread(asker.attach)
    asker.send(type="send", id=0, message=NOTE)
    assert (await asyncio.to_thread(asker.answered))[1]["id"] == 0
    await nothing_waits(session)
    disk.hold()
    asker.send(type="send", id=1, message=NOTE)
    async with asyncio.timeout(10):
        await disk.waits.wait()
    return asker


def stand_still(until: Callable[[], bool]) -> None:
    """Hold the loop up, so that whatever happens is done by others."""
    end = monotonic() + 10
    while not until():
        assert monotonic() < end
        sleep(0.001)


async def nothing_waits(session: Served) -> None:
    """Until the loop knows of what was answered early."""
    for _ in range(10_000):
        if all(peer._clear for peer in session.server.peers):
            return
        await asyncio.sleep(0.001)
    raise TimeoutError


async def test_an_answer_needs_no_turn_of_the_loop(place: Path) -> None:
    disk = Held()
    async with served(place, disk=disk) as session:
        watching = await Follower(session.client("bob", "observer")).attach()
        await watching.until(lambda view: view.session)
        asker = await asked(session, disk)
        seq = watching.view.seq
        got: list[tuple[list[dict[str, Any]], dict[str, Any]]] = []
        reading = threading.Thread(target=lambda: got.append(asker.answered()))
        reading.start()
        disk.let.set()
        reading.join(10)  # on the loop, which does nothing meanwhile
        [(records, answer)] = got
        assert answer["accepted"] and [record["seq"] for record in records] == [seq + 1]
        assert watching.view.seq == seq

        await watching.until(lambda view: view.seq == seq + 1)
        asker.send(type="send", id=2, message=NOTE)
        records, answer = await asyncio.to_thread(asker.answered)
        assert (answer["id"], [record["seq"] for record in records]) == (2, [seq + 2])  # and nothing a second time
        asker.close()
        await watching.close()


async def test_nothing_leaves_before_it_is_durable(place: Path) -> None:
    disk = Held()
    async with served(place, disk=disk) as session:
        asker = await asked(session, disk)
        asker.send(type="control", id=2, verb="take")  # refused at once
        records, answer = await asyncio.to_thread(asker.answered)
        assert not records and (answer["id"], answer["accepted"]) == (2, False)
        disk.let.set()
        records, answer = await asyncio.to_thread(asker.answered)
        assert len(records) == 1 and (answer["id"], answer["accepted"]) == (1, True)
        asker.close()


@pytest.mark.parametrize("room", [1 << 20, 10], ids=["all of it", "a part of it"])
async def test_what_else_there_is_comes_after_what_has_left(
    place: Path, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    """`room`: bytes that the socket takes from the journal's thread."""
    monkeypatch.setattr(serving, "PULSE_SECONDS", 3600.0)
    monkeypatch.setattr(link_early, "os", SimpleNamespace(write=lambda to, data: os.write(to, data[:room])))
    disk = Held()
    async with served(place, disk=disk) as session:
        asker = await asked(session, disk)
        assert session.server._early is not None
        early = session.server._early[1]
        disk.let.set()
        stand_still(lambda: early._sent is not None)
        session.server._beat()
        session.server._pulse.cancel()
        got = [await asyncio.to_thread(asker.read) for _ in range(3)]
        assert [message["type"] for message in got] == ["records", "reply", "pulse"]
        asker.close()


async def test_whoever_has_gone_meanwhile_hurts_nobody(place: Path) -> None:
    disk = Held()
    async with served(place, disk=disk) as session:
        watching = await Follower(session.client("bob", "observer")).attach()
        await watching.until(lambda view: view.session)
        for _ in range(20):
            seq = watching.view.seq
            asker = await asked(session, disk)
            asker.close()
            disk.let.set()
            await watching.until(lambda view, seq=seq: view.seq > seq)
        assert watching.error is None
        await watching.close()


async def test_many_who_ask_at_once_get_every_record_once(place: Path) -> None:
    """`Follower` finds gaps and repetitions."""
    async with served(place, disk=Disk()) as session:
        followers = [await Follower(session.client(f"n{number}", "node")).attach() for number in range(5)]

        async def ask(follower: Follower) -> None:
            for number in range(100):
                assert (await follower.client.send(Note(text=f"{follower.hello.you} {number}"))).accepted
                if number % 7 == 0:
                    await asyncio.sleep(0)

        await asyncio.gather(*map(ask, followers))
        last = max(follower.view.seq for follower in followers)
        for follower in followers:
            await follower.until(lambda view: view.seq >= last)
            await follower.close()


async def test_a_part_that_found_no_room_is_followed_by_the_rest(place: Path) -> None:
    """A client whose socket is nearly full."""
    left, right = socket.socketpair()
    left.setblocking(False)
    right.setblocking(False)
    left.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4608)
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_unix_connection(asyncio.Protocol, sock=left)
    data = bytes(range(256)) * 1000
    early = Early(transport, 1, 1, data)
    await asyncio.to_thread(early.send)
    assert 0 < early._sent < len(data)
    assert early.left() and early.finish() and early.finish()
    transport.write(b"next")
    got = b""
    while not got.endswith(b"next"):
        got += await loop.sock_recv(right, 65_536)
    assert got == data + b"next"
    transport.close()
    right.close()


@pytest.mark.parametrize("why", ["full", "gone"])
async def test_what_the_thread_could_not_send_is_sent_by_the_loop(place: Path, why: str) -> None:
    left, right = socket.socketpair()
    left.setblocking(False)
    right.setblocking(False)
    loop = asyncio.get_running_loop()
    filled = 0
    with suppress(BlockingIOError):
        while why == "full":
            filled += left.send(b"x" * 4096)
    transport, _ = await loop.create_unix_connection(asyncio.Protocol, sock=left)
    early = Early(transport, 1, 1, b"answer")
    if why == "gone":
        right.close()
    early.send()
    assert early.left() and early.finish()
    if why == "full":
        got = b""
        while len(got) < filled + 6:
            got += await loop.sock_recv(right, 65_536)
        assert got.endswith(b"xanswer")
    transport.abort()
    right.close()


async def test_what_the_loop_has_taken_back_never_leaves(place: Path) -> None:
    left, right = socket.socketpair()
    left.setblocking(False)
    right.setblocking(False)
    transport, _ = await asyncio.get_running_loop().create_unix_connection(asyncio.Protocol, sock=left)
    early = Early(transport, 1, 1, b"answer")
    assert not early.left() and not early.left()
    early.send()
    with pytest.raises(BlockingIOError):
        right.recv(1)
    early.close()
    transport.abort()
    right.close()
