"""The engine on its own thread, and clients that talk to it by messages."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from rise_engine.kernel.inputs import Note, RobotChanged, Submit
from rise_engine.kernel.records import AnyRecord, ControlRecord, NoteRecord, SessionRecord, StopRecord, TaskRecord
from rise_engine.link import mailbox
from rise_engine.link.client import Client, EngineGone, Journaling
from rise_engine.link.local import EngineHost, LocalClient, start_local
from rise_engine.link.room import copy_of
from rise_engine.scenario.model import Scenario
from rise_engine.view import View

from .samples import GREETING, act, assert_one_ending_each, profile, scenario, speech, start

FAST = 50.0


@asynccontextmanager
async def hosted(which: Scenario | None = None, **more: Any) -> AsyncIterator[EngineHost]:
    host = EngineHost(which or scenario(GREETING), **{"speed": FAST, **more}).start()
    try:
        yield host
    finally:
        host.end("the test is over")
        await asyncio.to_thread(host.join, 10)


def _block_until(true: Callable[[], bool]) -> None:
    """As a console that hangs: nothing else on this thread gets a turn."""
    deadline = time.monotonic() + 10
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.001)


class Follower:
    """A client that folds everything it gets, as a console does."""

    def __init__(self, client: LocalClient) -> None:
        self.client = client
        self.view = View()
        self.records: list[AnyRecord] = []
        self.changed = asyncio.Condition()
        self.task: asyncio.Task[None] | None = None

    async def attach(self) -> Follower:
        hello = await self.client.attach()
        self.view = hello.view
        self.task = asyncio.create_task(self._follow())
        return self

    async def _follow(self) -> None:
        async for batch in self.client.records():
            async with self.changed:
                for record in batch:
                    assert not isinstance(record, Journaling)
                    assert record.seq == self.view.seq + 1, "a gap"
                    self.view.apply(record)
                    self.records.append(record)
                self.changed.notify_all()

    async def until(self, kind: type, **fields: object) -> Any:
        def found() -> Any:
            for record in self.records:
                if isinstance(record, kind) and all(getattr(record, k) == v for k, v in fields.items()):
                    return record
            return None

        async with self.changed:
            await asyncio.wait_for(self.changed.wait_for(lambda: found() is not None), 10)
        return found()


async def test_a_session_through_the_client() -> None:
    client: Client = start_local(scenario(GREETING), seed=3, speed=FAST)
    assert isinstance(client, LocalClient)
    follower = await Follower(client).attach()
    hello = await client.attach()
    assert (hello.mode, hello.robot, hello.seed) == ("debug", "generic", 3)
    assert hello.view.session is not None and hello.view.session.seed == 3
    follower = await Follower(client).attach()
    reply = await client.send(start("Greet"))
    assert reply.accepted and reply.task == 1
    await follower.until(TaskRecord, id=1, status="SUCCEEDED")
    assert client.now() > 1
    rejected = await client.send(start("Gret"))
    assert not rejected.accepted and "Greet" in rejected.reason
    await client.close(end_session=True)
    assert client.host.gone == "the session has ended"
    with pytest.raises(EngineGone, match="ended"):
        await client.send(Note(text="too late"))
    with pytest.raises(EngineGone, match="ended"):
        await client.attach()


async def test_the_stream_ends_when_the_engine_does_and_the_robot_was_stopped() -> None:
    client = start_local(scenario(GREETING), speed=FAST)
    follower = await Follower(client).attach()
    await client.send(start("Greet"))
    other = await Follower(client.host.client()).attach()
    with pytest.raises(PermissionError, match="only who holds control can end the session: wizard:local does"):
        await other.client.close(end_session=True)
    assert (await other.client.control("take")).accepted
    await other.client.close(end_session=True)
    assert follower.task is not None
    await asyncio.wait_for(follower.task, 10)
    assert any(isinstance(record, StopRecord) and record.status == "latched" for record in follower.records)
    last = follower.records[-1]
    assert isinstance(last, SessionRecord) and last.status == "ended"
    assert_one_ending_each(follower.records)
    assert follower.view.ended


async def test_what_a_client_does_stands_in_its_own_name_and_the_holder_alone_acts() -> None:
    async with hosted() as host:
        anna, bob = host.client("anna"), host.client("bob")
        follower = await Follower(anna).attach()
        hello = await bob.attach()
        assert (hello.you, hello.role) == ("wizard:bob", "wizard")
        task = await follower.until(TaskRecord, id=(await anna.send(start("Greet", source="wizard:eve"))).task)
        assert task.source == "wizard:anna"
        reply = await bob.send(start("Greet"))
        assert not reply.accepted and "wizard:anna" in reply.reason
        await bob.control("ask")
        await follower.until(ControlRecord, status="asked", by="wizard:bob")
        await anna.control("give")
        await follower.until(ControlRecord, status="given", holder="wizard:bob")
        assert (await bob.send(start("Greet"))).accepted
        await bob.close()
        await follower.until(ControlRecord, status="released", holder=None)


async def test_the_engine_has_a_thread_of_its_own() -> None:
    async with hosted() as host:
        client = host.client()
        await client.attach()
        names = await host.call(lambda: (threading.current_thread().name, asyncio.get_running_loop()))
        assert names[0] == "rise-engine" != threading.current_thread().name
        assert names[1] is not asyncio.get_running_loop()


async def test_a_client_whose_loop_stalls_does_not_hold_up_the_engine() -> None:
    """The client's whole loop is blocked while the act runs; the engine's own times must show nothing of it."""
    async with hosted() as host:
        follower = await Follower(host.client()).attach()
        await follower.client.send(start("Greet"))
        _block_until(lambda: bool(host.room.view.acts["Greet"].runs))
        assert follower.view.acts["Greet"].runs == 0, "this loop has not run"
        ended = await follower.until(TaskRecord, id=1, status="SUCCEEDED")
        typical = follower.view.acts["Greet"].typical
        assert typical is not None and ended.t < 30


async def test_a_client_that_never_reads_is_cut_off_and_can_attach_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mailbox, "LIMIT", 100)
    async with hosted() as host:
        lazy, busy = host.client(), host.client()
        await lazy.attach()
        follower = await Follower(busy).attach()
        for number in range(300):
            assert (await busy.send(Note(text=str(number)))).accepted
        await follower.until(NoteRecord, text="299")
        with pytest.raises(EngineGone, match="too far behind"):
            async for _ in lazy.records():
                pass
        hello = await lazy.attach()
        assert hello.view.seq >= follower.view.seq
        await busy.send(Note(text="again"))
        batch = await asyncio.wait_for(anext(lazy.records()), 5)
        assert batch[0].seq == hello.view.seq + 1


async def test_several_clients_see_the_same_without_gaps_whenever_they_attach() -> None:
    async with hosted() as host:
        early = await Follower(host.client()).attach()
        await early.client.send(start("Greet"))
        late = []
        for number in range(20):
            late.append(await Follower(host.client()).attach())
            await early.client.send(Note(text=str(number)))
            await asyncio.sleep(0)
        await early.until(TaskRecord, id=1, status="SUCCEEDED")
        await early.client.send(Note(text="last"))
        for follower in (early, *late):
            await follower.until(NoteRecord, text="last")
            assert follower.view == early.view
        await late[0].client.close(end_session=False)
        assert (await early.client.send(Note(text="still there"))).accepted


async def test_the_copy_of_a_view_does_not_change_with_it() -> None:
    async with hosted() as host:
        client = host.client()
        await client.attach()
        await client.send(start("Greet"))
        hello = await client.attach()
        task = hello.view.tasks[1]
        before = (task.status, {key: value.status for key, value in task.actions.items()}, list(hello.view.running))
        follower = await Follower(host.client()).attach()
        await follower.until(TaskRecord, id=1, status="SUCCEEDED")
        assert before == (task.status, {k: v.status for k, v in task.actions.items()}, list(hello.view.running))
        assert task.status == "ACTIVE"
        again = copy_of(follower.view)
        assert again == follower.view and again is not follower.view


def test_a_client_whose_loop_is_closed_is_forgotten() -> None:
    host = EngineHost(scenario(GREETING), speed=FAST).start()

    async def come_and_go() -> None:
        await host.client().attach()

    asyncio.run(come_and_go())

    async def others() -> None:
        follower = await Follower(host.client()).attach()
        for number in range(10):
            await follower.client.send(Note(text=str(number)))
        await follower.until(NoteRecord, text="9")
        assert len(host._mailboxes) == 1
        await follower.client.close(end_session=True)

    asyncio.run(others())
    assert host.join(5)


async def test_an_engine_that_cannot_start_says_why() -> None:
    client = start_local(scenario(GREETING), faults=("Speach=fail",))
    with pytest.raises(EngineGone, match="'Speech'"):
        await client.attach()
    with pytest.raises(EngineGone, match="'Speech'"):
        await client.send(Note(text="hello"))
    await client.close()
    missing = start_local(scenario(GREETING, robot=profile(driver="ros7")), mode="real")
    with pytest.raises(EngineGone, match="'ros7' is not installed"):
        await missing.attach()


async def test_in_debug_mode_the_driver_is_always_simulated() -> None:
    client = start_local(scenario(GREETING, robot=profile(driver="ros7")), mode="debug", speed=FAST)
    hello = await client.attach()
    assert hello.view.robot is None or "simulated" in hello.view.robot.detail
    await client.close(end_session=True)


async def test_mode_real_on_a_simulated_robot_says_so() -> None:
    async with hosted(mode="real") as host:
        follower = await Follower(host.client()).attach()
        await follower.client.send(Note(text="x"))
        hello = await follower.client.attach()
        assert hello.mode == "real"
        assert hello.view.robot is not None and "nothing leaves this machine" in hello.view.robot.detail


async def test_a_failing_engine_ends_with_a_sentence_and_keeps_its_traceback_in_the_log(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = EngineHost(scenario(GREETING), speed=FAST).start()
    client = host.client()
    follower = await Follower(client).attach()

    def fails(fact: object) -> Any:
        raise AssertionError("a mistake in the kernel")

    def break_it() -> None:
        assert host._engine is not None
        monkeypatch.setattr(host._engine._kernel, "handle", fails)

    with caplog.at_level(logging.CRITICAL):
        await host.call(break_it)
        with pytest.raises(EngineGone, match="a mistake in the kernel"):
            await client.send(start("Greet"))
    assert follower.task is not None
    with pytest.raises(EngineGone, match="a mistake in the kernel"):
        await asyncio.wait_for(follower.task, 10)
    assert host.join(5)


async def test_clients_may_not_send_what_only_robots_may() -> None:
    async with hosted() as host:
        client = host.client()
        await client.attach()
        with pytest.raises(TypeError, match="Submit and Note"):
            await client.send(RobotChanged(status="lost"))  # type: ignore[arg-type]


async def test_stop_all_goes_through_while_clients_flood() -> None:
    many = scenario(act("Long", *(speech(str(n), wait=(str(n - 1),) if n else ()) for n in range(50))))
    async with hosted(many) as host:
        clients = [host.client() for _ in range(10)]
        for client in clients:
            await client.attach()
        follower = await Follower(host.client(role="observer")).attach()
        assert (await clients[0].send(start("Long"))).accepted

        async def flood(client: LocalClient) -> None:
            for number in range(100):
                await client.send(Note(text=str(number)))

        floods = [asyncio.create_task(flood(client)) for client in clients]
        reply = await asyncio.wait_for(follower.client.send(Submit(function="stopAll")), 5)
        assert reply.accepted
        await follower.until(StopRecord, status="latched")
        await asyncio.gather(*floods)
        assert_one_ending_each(follower.records)


def test_another_robot_needs_another_reading_of_the_scenario() -> None:
    with pytest.raises(ValueError, match="read it again"):
        start_local(scenario(GREETING), robot="pepper")
