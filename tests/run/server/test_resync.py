"""A console that cannot keep up: records are left out, it gets the state anew, and its keys work all the while."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.run.client import socket
from rise_engine.run.protocol import messages
from rise_engine.run.protocol.client import LinkLost, Resync
from rise_engine.run.server import attachment
from rise_engine.run.server import server as serving
from tests.patience import PATIENCE

from .serving import GREETING, Follower, RawConnection, Served, served


def events(session: Served, count: int) -> None:
    for number in range(count):
        session.engine.post(Submit(function="raiseEventTopic", behavior=f"/e{number}", source="ros:node"))


@pytest.fixture(autouse=True)
def _little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attachment, "BACKLOG", 20_000)
    monkeypatch.setattr(attachment, "ARRIVAL_BACKLOG", 20_000)
    monkeypatch.setattr(socket, "MAX_WAITING_WITH_RESYNC", 50)
    monkeypatch.setattr(serving, "TASKS_AT_ONCE", 50)


async def flooded(session: Served, console: Follower) -> None:
    """So much at once, again and again, that nobody can keep up."""
    before = console.resyncs
    async with asyncio.timeout(PATIENCE):
        while console.resyncs == before:
            events(session, 500)
            await asyncio.sleep(0)


@pytest.mark.slow
async def test_a_client_that_lay_behind_gets_the_state_anew_and_goes_on(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        console = await Follower(session.client(resync=True)).attach()
        for _ in range(3):
            await flooded(session, console)
            assert (await console.client.send(Submit(function="assignValue", behavior="mood = 3"))).accepted
            await console.until(lambda view: view.seq >= session.hub.view.seq)
            assert console.view == session.hub.view, "nothing is missing, of tasks that were left out either"
        assert console.error is None and console.resyncs >= 3
        await console.close()


async def test_the_stop_works_all_the_while(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        console = await Follower(session.client(resync=True)).attach()
        going = True

        async def flood() -> None:
            while going:
                events(session, 50)
                await asyncio.sleep(0)

        flooding = asyncio.create_task(flood())
        for _ in range(5):
            assert (await console.client.send(Submit(function="stopAll"))).accepted
        await console.until(lambda view: view.stop.latched)
        going = False
        await flooding
        assert console.error is None and console.view.control == "wizard:anna", "it was never cut off"
        await console.close()


async def test_marks_of_tasks_that_were_over_are_not_lost(scratch: Path) -> None:
    """A task that ended long ago changes while nothing is kept for the console."""
    async with served(scratch, GREETING) as session:
        console = await Follower(session.client(resync=True)).attach()
        act = sorted(session.engine.scenario.acts)[0]
        task = (await console.client.send(Submit(function="startCommunicationRobotAct", behavior=act))).task
        assert task is not None
        await console.until(lambda view: task in view.tasks and view.tasks[task].ended is not None)
        (console_here,) = session.server.connections.values()
        assert console_here is not None
        async with asyncio.timeout(PATIENCE):
            while console_here.missed_tasks is None:
                events(session, 500)
                await asyncio.sleep(0)
        session.engine.post(Submit(function="markMistake", behavior=f"{task} late", source="wizard:ben"))
        await console.until(lambda view: view.tasks[task].mark == "late")
        await console.until(lambda view: view.seq >= session.hub.view.seq)
        assert console.resyncs and console.view == session.hub.view
        await console.close()


async def test_a_client_that_wants_every_record_is_cut_off_instead(scratch: Path) -> None:
    """A program is never left without a record that it does not know of."""
    async with served(scratch, GREETING) as session:
        program = await RawConnection.open(session.path)
        program.attach()
        await program.until("ready")
        program.writer.transport.pause_reading()  # type: ignore[attr-defined]
        async with asyncio.timeout(PATIENCE):
            while session.server.connections:
                events(session, 500)
                await asyncio.sleep(0)
        await program.close()


async def test_a_client_that_takes_nothing_at_all_is_dropped_in_the_end(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attachment, "BEHIND_SECONDS", 0.2)
    async with served(scratch, GREETING) as session:
        raw = await RawConnection.open(session.path)
        raw.send(type="attach", version=messages.VERSION, name="ben", role="observer", resync=True)
        await raw.until("ready")
        raw.writer.transport.pause_reading()  # type: ignore[attr-defined]
        async with asyncio.timeout(PATIENCE):
            while session.server.connections:
                events(session, 200)
                await asyncio.sleep(0.01)
        await raw.close()


async def test_what_is_not_taken_is_not_read_without_end(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        client = session.client(resync=True)
        hello = await client.attach()
        for _ in range(40):
            events(session, 200)
            await asyncio.sleep(0)
        seen = 0
        async for batch in client.records():
            assert len(batch) <= 50 + 2 * 1_000, "some lines at most"
            for update in batch:
                if isinstance(update, Resync):
                    hello.view.merge_resync(update.view, update.tasks)
                seen += 1
            if hello.view.seq >= session.hub.view.seq or isinstance(batch[-1], Resync):
                break
        assert seen
        await client.close()
        with pytest.raises(LinkLost):
            await client.send(Submit(function="stopAll"))
