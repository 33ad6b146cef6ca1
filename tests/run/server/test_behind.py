"""A client that cannot keep up: it is cut, attaches anew, and has lost nothing."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.run.client import socket
from rise_engine.run.protocol.client import LinkLost
from rise_engine.run.server import connection
from rise_engine.run.server import server as serving
from tests.patience import PATIENCE

from .serving import GREETING, Follower, RawConnection, Served, served


def events(session: Served, count: int) -> None:
    for number in range(count):
        session.engine.post(Submit(function="raiseEventTopic", behavior=f"/e{number}", source="ros:node"))


@pytest.fixture(autouse=True)
def _little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 20_000)
    monkeypatch.setattr(socket, "MAX_WAITING_RECORDS", 2_000)
    monkeypatch.setattr(serving, "TASKS_AT_ONCE", 50)


async def cut_off(session: Served) -> None:
    """So much at once, again and again, that nobody can keep up."""
    async with asyncio.timeout(PATIENCE):
        while session.server.connections:
            events(session, 500)
            await asyncio.sleep(0)


@pytest.mark.slow
async def test_a_client_that_lay_behind_is_cut_and_comes_back_to_the_whole_state(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        console = await Follower(session.client()).attach()
        act = sorted(session.engine.scenario.acts)[0]
        task = (await console.client.send(Submit(function="startCommunicationRobotAct", behavior=act))).task
        assert task is not None
        await console.until(lambda view: task in view.tasks and view.tasks[task].ended is not None)
        for mark in ("late", "wrong", "late"):
            await cut_off(session)
            assert isinstance(await console.over(), LinkLost)
            # A task that ended long ago changes while the client is away.
            session.engine.post(Submit(function="markMistake", behavior=f"{task} {mark}", source="wizard:ben"))
            await console.attach()
            assert (await console.client.send(Submit(function="stopAll"))).accepted
            await console.until(lambda view: view.seq >= session.hub.view.seq)
            assert console.view.tasks[task].mark == mark
            assert console.view == session.hub.view
        await console.close()


async def test_what_happens_while_a_client_takes_the_state_is_not_lost(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        events(session, 300)
        raw = await RawConnection.open(session.path)
        raw.writer.transport.pause_reading()  # type: ignore[attr-defined]
        raw.attach()
        while not any(each.client for each in session.server.connections):
            events(session, 1)
            await asyncio.sleep(0)
        events(session, 3_000)  # far more than a client may leave waiting later
        await asyncio.sleep(0)
        newest = session.hub.view.seq
        raw.writer.transport.resume_reading()  # type: ignore[attr-defined]
        seq = (await raw.until("hello"))["state"]["seq"]
        await raw.until("ready")
        while seq < newest:
            for record in (await raw.until("records"))["records"]:
                assert record["seq"] == seq + 1, "a gap"
                seq += 1
        await raw.close()


async def test_a_client_that_takes_nothing_is_cut(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "STALL_SECONDS", 0.1)
    monkeypatch.setattr(serving, "HEARTBEAT_SECONDS", 0.05)
    monkeypatch.setattr(connection, "BACKLOG", 10**9)
    async with served(scratch, GREETING) as session:
        raw = await RawConnection.open(session.path)
        raw.attach()
        await raw.until("ready")
        raw.writer.transport.pause_reading()  # type: ignore[attr-defined]
        async with asyncio.timeout(PATIENCE):
            while session.server.connections:
                events(session, 500)
                await asyncio.sleep(0.01)
        await raw.close()


async def test_what_is_not_taken_is_not_kept_without_end(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 10**9)
    async with served(scratch, GREETING) as session:
        client = session.client()
        await client.attach()
        for _ in range(40):
            events(session, 200)
            await asyncio.sleep(0)
        with pytest.raises(LinkLost, match="too far behind"):
            async for batch in client.records():
                assert len(batch) <= 4_000
                events(session, 3_000)
        with pytest.raises(LinkLost):
            await client.send(Submit(function="stopAll"))
        await client.close()
