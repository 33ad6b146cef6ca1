"""State plus records is the live state, whenever somebody attaches, and every end of a connection is told truly."""

from __future__ import annotations

import asyncio
import os
import socket
from pathlib import Path
from random import Random

import msgspec
import pytest

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import Client, EngineGone, JournalStatus, LinkLost
from rise_engine.run.protocol.messages import TasksMessage as TasksMessage
from rise_engine.run.protocol.messages import (
    ViewWithoutTasks,
    decode_server_message,
    encode_line,
    with_tasks,
    without_tasks,
)
from rise_engine.run.server import connection as connection_module
from rise_engine.run.server import server as serving
from tests.patience import PATIENCE

from .serving import FAST, GREETING, Follower, RawConnection, Served, served


def act(name: str, calling_type: str = "") -> Submit:
    return Submit(function="startCommunicationRobotAct", behavior=name, calling_type=calling_type)


async def sees(follower: Follower, text: str, served: Served) -> None:
    """Wait until `follower` has everything up to a remark that is made now."""
    done = asyncio.Event()
    served.hub.subscribe(lambda update: done.set() if getattr(update, "text", "") == text else None)
    assert (await follower.client.send(Note(text=text))).accepted
    await asyncio.wait_for(done.wait(), PATIENCE)
    seq = served.hub.view.seq
    await follower.until(lambda view: view.seq >= seq)


async def test_an_engine_that_stands_still_is_told(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its backlog still takes connections, and nobody answers."""
    monkeypatch.setattr("rise_engine.run.client.socket.ATTACH_SECONDS", 0.01)
    with socket.socket(socket.AF_UNIX) as silent:
        silent.bind(str(scratch / "x.sock"))
        silent.listen()
        client = SocketClient(scratch / "x.sock", "anna")
        with pytest.raises(EngineGone, match="gives no sign of life: look at the robot"):
            await client.attach()


async def test_who_was_attached_keeps_trying_while_the_engine_stands_still(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may go on, and then the stop key must reach it."""
    async with served(scratch, GREETING) as session:
        client = session.client()
        await client.attach()
        with monkeypatch.context() as patch:
            patch.setattr("rise_engine.run.client.socket.ATTACH_SECONDS", 0.0)
            with pytest.raises(LinkLost, match="gives no sign of life: look at the robot"):
                await client.attach()
        await client.attach()
        assert (await client.send(Submit(function="stopAll"))).accepted


def test_the_state_on_the_wire_has_every_field_of_a_view() -> None:
    assert set(ViewWithoutTasks.__struct_fields__) == set(SessionView.__struct_fields__) - {"tasks"}


async def test_early_and_late_clients_have_the_same_view(scratch: Path) -> None:
    async with served(scratch, GREETING) as session:
        client: Client = session.client()
        early = await Follower(client).attach()
        hello = early.hello
        assert (hello.you, hello.role, hello.mode, hello.seed) == ("wizard:anna", "wizard", "debug", 1)
        assert hello.scenario == session.engine.scenario and hello.folder == str(session.folder)
        await early.until(lambda view: view.control == "wizard:anna")
        assert (await client.send(Submit(function="startInteractionRule", behavior="Greeting"))).accepted
        late: list[Follower] = []
        for number in range(8):
            late.append(await Follower(session.client(f"late{number}", "observer")).attach())
            assert (
                await client.send(Submit(function="assignValue", behavior=f"person_near = {number % 2 == 0}".lower()))
            ).accepted
            assert (await client.send(act("R_Smile", "None"))).accepted
            await client.send(Submit(function="raiseEventTopic", behavior="/H_greets"))
            await client.send(Submit(function="raiseEventTopic", behavior=f"/nobody/{number}"))
        await early.until(lambda view: len([task for task in view.tasks.values() if task.status == "SUCCEEDED"]) > 25)
        last = await Follower(session.client("last", "observer")).attach()
        # Quiet, so that nothing comes between the comparisons:
        await client.send(Submit(function="stopAll"))
        await early.until(lambda view: view.stop.status == "latched" and not view.running)
        await sees(early, "the end", session)
        seq = session.hub.view.seq
        for follower in (early, *late, last):
            await follower.until(lambda view: view.seq >= seq)
            assert follower.view == early.view == session.hub.view
            for known in follower.view.acts.values():
                assert known.last is None or known.last is follower.view.tasks[known.last.id]
        assert 0 < client.now() - session.engine.clock.now() + 0.5 * FAST < FAST


async def test_many_tasks_come_in_pieces(scratch: Path) -> None:
    async with served(scratch) as session:
        early = await Follower(session.client("program", "node")).attach()
        for number in range(5 * serving.TASKS_AT_ONCE + 3):
            await early.client.send(Submit(function="raiseEventTopic", behavior=f"/e{number}"))
        late = await Follower(session.client("late", "observer")).attach()
        assert len(late.view.tasks) == 5 * serving.TASKS_AT_ONCE + 3
        assert list(late.view.tasks) == list(early.view.tasks)
        await sees(early, "the end", session)
        await late.until(lambda view: view.seq >= early.view.seq)
        assert late.view == early.view


def test_what_no_file_can_hold_crosses_the_socket() -> None:
    task = TaskView(1, "raiseEventTopic", "/\udcff", "None", "file", "SUCCEEDED", "", 1.0)
    message = decode_server_message(encode_line(TasksMessage([task])))
    assert isinstance(message, TasksMessage) and message.tasks[0].behavior == "/\\udcff"
    view = SessionView(memory={})
    encoded = msgspec.json.encode(without_tasks(view))
    assert with_tasks(msgspec.json.decode(encoded, type=ViewWithoutTasks), []) == view


async def test_how_recording_stands_comes_among_the_records(scratch: Path) -> None:
    async with served(scratch) as session:
        follower = await Follower(session.client()).attach()
        trouble = JournalStatus(7, 2.0, "the disk is full")
        assert session.engine.on_journal_status is not None
        session.engine.on_journal_status(trouble)
        await sees(follower, "x", session)
        assert follower.journaling == [trouble]


async def test_the_end_of_the_session_ends_the_stream_and_nothing_else_does(scratch: Path) -> None:
    async with served(scratch) as session:
        anna, bob = Follower(session.client()), Follower(session.client("bob"))
        await anna.attach()
        await bob.attach()
        await bob.close()
        assert (await anna.client.send(Note(text="still there"))).accepted
        ending = asyncio.create_task(anna.client.close(end_session=True))
        await asyncio.wait_for(_ended(session), PATIENCE)
        await session.server.close()
        await ending
        assert await anna.over() is None and anna.view.ended
        with pytest.raises(EngineGone):
            await anna.client.send(Note(text="too late"))
    with pytest.raises(EngineGone, match="no session runs"):
        await session.client().attach()
    with pytest.raises(EngineGone, match="no session lablinking is running"):
        await type(session.client())("lablinking", "anna").attach()


async def _ended(session: Served) -> None:
    done = asyncio.Event()
    session.engine.on_ended(done.set)
    await done.wait()


async def test_a_failed_engine_is_no_ordinary_end(scratch: Path) -> None:
    async with served(scratch) as session:
        follower = await Follower(session.client()).attach()
        session.engine.failure = AssertionError("a mistake in the kernel")
        await session.server.close()
        error = await follower.over()
        assert isinstance(error, EngineGone) and not isinstance(error, LinkLost)
        assert "a mistake in the kernel" in str(error)
        session.engine.failure = None


async def test_a_cut_connection_and_an_engine_that_has_gone_are_different_errors(scratch: Path) -> None:
    async with served(scratch) as session:
        first, second = await Follower(session.client()).attach(), await Follower(session.client("bob")).attach()
        waiting = asyncio.create_task(first.client.send(Note(text="x")))
        await waiting
        for connection in tuple(session.server.connections):
            connection.abort()
        assert isinstance(await first.over(), LinkLost)
        with pytest.raises(LinkLost):
            await first.client.send(Note(text="y"))
        await first.attach()
        await sees(first, "back again", session)
        session.lock.close()  # as the death of the process does
        for connection in tuple(session.server.connections):
            connection.abort()
        session.server._server.close()  # type: ignore[union-attr]
        error = await first.over()
        assert isinstance(error, EngineGone) and not isinstance(error, LinkLost) and "no longer exists" in str(error)
        await second.over()


async def test_a_client_that_does_not_read_is_dropped_and_can_attach_again(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_module, "LINGER_SECONDS", 0.05)
    async with served(scratch) as session:
        lazy = await RawConnection.open(session.path)
        lazy.attach("lazy", "wizard")
        busy = await Follower(session.client("busy", "observer")).attach()
        await lazy.until("ready")
        await busy.until(lambda view: view.control == "wizard:lazy")
        lazy.writer.transport.pause_reading()  # type: ignore[attr-defined]
        text = "x" * 10_000
        async with asyncio.timeout(PATIENCE):
            while "wizard:lazy" in session.hub.clients:
                assert (await busy.client.send(Note(text=text))).accepted
                assert all(each.waiting < 1_000_000 for each in session.server.connections), "too much is kept"
        await busy.until(lambda view: view.control is None)
        again = await Follower(session.client("lazy")).attach()
        await sees(busy, "the end", session)
        await again.until(lambda view: view.seq >= busy.view.seq)
        assert again.view == busy.view and busy.error is None
        lazy.writer.transport.abort()


async def test_the_state_is_not_waited_for_without_end(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_module, "STALL_SECONDS", 0.1)
    monkeypatch.setattr(serving, "HEARTBEAT_SECONDS", 0.05)
    async with served(scratch) as session:
        program = session.client("program", "node")
        await program.attach()
        for _ in range(20):
            await program.send(Submit(function="raiseEventTopic", behavior="/" + "e" * 60_000))
        slow = await RawConnection.open(session.path)
        slow.writer.transport.pause_reading()  # type: ignore[attr-defined]
        gone = asyncio.Event()
        leave = session.hub.detach
        monkeypatch.setattr(session.hub, "detach", lambda client: (leave(client), gone.set()))
        slow.attach("slow")
        await asyncio.wait_for(gone.wait(), PATIENCE)
        assert list(session.hub.clients) == ["node:program"]
        slow.writer.transport.abort()


async def test_the_name_of_the_session_is_enough(scratch: Path) -> None:
    async with served(scratch) as session:
        from rise_engine.run.client.socket import SocketClient

        for name in (session.name, "lablinking"):
            client = SocketClient(name, f"anna{os.getpid()}")
            assert (await client.attach()).you == f"wizard:anna{os.getpid()}"
            await client.close()


async def test_the_engine_sends_its_scenario_whatever_became_of_the_copy(scratch: Path) -> None:
    async with served(scratch) as session:
        (session.folder / "scenario" / "memory.json").write_text('{"WorkingMemory": []}')
        follower = await Follower(session.client()).attach()
        assert follower.hello.scenario == session.engine.scenario


async def test_a_client_that_has_the_scenario_is_not_sent_it_again(scratch: Path) -> None:
    async with served(scratch) as session:
        raw = await RawConnection.open(session.path)
        raw.attach()
        types = [(await raw.read())["type"]]
        while types[-1] != "ready":
            types.append((await raw.read())["type"])
        assert types[0] == "hello" and "scenario" not in types
        await raw.close()


async def test_a_copy_of_the_scenario_that_was_changed_is_not_believed(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read by clients that the engine cannot tell what it runs."""
    monkeypatch.setattr(serving, "encode_scenario", _cannot)
    async with served(scratch) as session:
        follower = await Follower(session.client()).attach()
        assert follower.hello.scenario.acts == session.engine.scenario.acts
        memory = session.folder / "scenario" / "memory.json"
        memory.write_text('{"WorkingMemory": []}')
        with pytest.raises(EngineGone, match="cannot be read"):
            await session.client("bea").attach()


def _cannot(scenario: object) -> bytes:
    raise UnicodeEncodeError("utf-8", "\udcff", 0, 1, "surrogates not allowed")


async def test_an_engine_of_another_release_may_describe_what_it_runs_otherwise(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "encode_scenario", lambda scenario: b'{"title":"Greeting","stages":[]}')
    async with served(scratch) as session:
        follower = await Follower(session.client()).attach()
        assert follower.hello.scenario.rules == session.engine.scenario.rules


@pytest.mark.parametrize("seed", range(3))
async def test_a_client_that_attaches_while_much_happens_sees_the_same(
    scratch: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Acts that begin, wait and are stopped, an act that is cancelled, tasks that the view forgets, portions of two."""
    monkeypatch.setattr("rise_engine.kernel.view.MAX_ENDED_TASKS", 40)
    monkeypatch.setattr("rise_engine.kernel.view.FORGET_AT_ONCE", 7)
    monkeypatch.setattr(serving, "TASKS_AT_ONCE", 2)
    chance = Random(seed)
    async with served(scratch, GREETING) as session:
        early = await Follower(session.client("early", "node")).attach()
        send = early.client.send
        acts = sorted(session.engine.scenario.acts)
        late: list[Follower] = []
        for step in range(120):
            match chance.randrange(8):
                case 0 | 1 | 2:
                    await send(act(chance.choice(acts), chance.choice(["None", "Blocking"])))
                case 3:
                    await send(Submit(function="stopCommunicationRobotAct", behavior=chance.choice(acts)))
                case 4 if early.view.running:
                    await send(Submit(function="cancelTask", behavior=str(chance.choice(early.view.running))))
                case 5:
                    await send(Submit(function=chance.choice(["stopAll", "releaseStop", "releaseStop"])))
                case 6:
                    await send(Submit(function="startInteractionRule", behavior="Greeting"))
                case _:
                    await send(Submit(function="assignValue", behavior=f"person_near = {step % 3 > 0}".lower()))
            if step % 8 == 0:
                attaching = asyncio.create_task(Follower(session.client(f"late{step}", "observer")).attach())
                for _ in range(chance.randrange(30)):
                    await send(Submit(function="raiseEventTopic", behavior="/H_greets"))
                late.append(await attaching)
        await send(Submit(function="stopAll"))
        await early.until(lambda view: view.stop.status == "latched" and not view.running)
        await sees(early, "the end", session)
        view = session.hub.view
        assert 40 <= len(view.tasks) <= 60, "some were forgotten"
        assert view.forgotten == max(view.tasks) - len(view.tasks)
        for follower in late:
            await follower.until(lambda view: view.seq >= session.hub.view.seq)
            assert follower.view == session.hub.view
