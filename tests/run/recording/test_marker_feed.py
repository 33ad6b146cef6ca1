"""What leaves a running session as markers, with which times, and how that ends."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.errors import AdapterError
from rise_engine.base.files import Disk
from rise_engine.kernel.records import AnyRecord
from rise_engine.ports.outlet import OutletPlan
from rise_engine.run.client import EngineGone, connect
from rise_engine.run.recording import marker_feed
from rise_engine.run.recording.marker_feed import MarkerFeed, MarkerStream
from tests.patience import PATIENCE
from tests.run.server.conftest import scratch as scratch
from tests.run.server.serving import GREETING, Served, served


@pytest.fixture(autouse=True)
def no_lingering(monkeypatch: pytest.MonkeyPatch) -> None:
    """An outlet of a test has whatever it was sent."""
    monkeypatch.setattr(marker_feed, "LINGER_SECONDS", 0.0)
    monkeypatch.setattr(marker_feed, "SHORT_LINGER_SECONDS", 0.0)


class Outlet:
    """Keeps what it is sent."""

    def __init__(self, *, consumers: bool = True) -> None:
        self.stream: MarkerStream | None = None
        self.consumers, self.closed = consumers, False
        self.sent: list[tuple[str, float]] = []
        self.feed: MarkerFeed | None = None
        self._changed = asyncio.Event()

    def __call__(self, stream: MarkerStream) -> Outlet:
        assert self.stream is None, "it is opened once"
        self.stream = stream
        self._changed.set()
        return self

    def send(self, text: str, at: float) -> None:
        assert not self.closed
        self.sent.append((text, at))
        self._changed.set()

    def has_consumers(self) -> bool:
        return self.consumers

    def close(self) -> None:
        self.closed = True

    async def until(self, true: Callable[[], object]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not true():
                self._changed.clear()
                await self._changed.wait()

    @property
    def texts(self) -> list[str]:
        return [text for text, _ in self.sent]


@asynccontextmanager
async def following(
    session: Served, outlet: Outlet, finish: asyncio.Event | None = None, **plan: Any
) -> AsyncIterator[asyncio.Task[None]]:
    """The markers of a session go to an outlet, which is open."""
    feed = outlet.feed = MarkerFeed(OutletPlan(str(session.path), **plan), outlet)
    task = asyncio.create_task(feed.run(finish or asyncio.Event()))
    opened = asyncio.create_task(outlet.until(lambda: outlet.stream is not None))
    try:
        await asyncio.wait((task, opened), return_when=asyncio.FIRST_COMPLETED)
        yield task
    finally:
        for each in (task, opened):
            each.cancel()
            with suppress(asyncio.CancelledError, Exception):
                await each


async def eventually(true: Callable[[], object]) -> None:
    """Wait for something of which nobody tells."""
    async with asyncio.timeout(PATIENCE):
        for _ in count():
            if true():
                return
            await asyncio.sleep(0.01)


async def end(session: Served) -> None:
    ended = asyncio.Event()
    session.engine.on_ended(ended.set)
    session.engine.end("over")
    await asyncio.wait_for(ended.wait(), PATIENCE)
    await session.server.close()


@pytest.mark.parametrize("speed", [1.0, 50.0])
async def test_a_stamp_is_the_moment_itself_on_the_clock_of_this_computer(scratch: Path, speed: float) -> None:
    loop, outlet = asyncio.get_running_loop(), Outlet()
    async with served(scratch, GREETING, speed=speed, disk=Disk()) as session, following(session, outlet):
        before = loop.time()
        async with connect(session.path, "seer") as program:
            await program.raise_event("/seen")
            after = loop.time()
            record = program.view.unhandled[-1]
            await outlet.until(lambda: "event/seen" in outlet.texts)
        (at,) = (at for text, at in outlet.sent if text == "event/seen")
        # A clock of floats is good to far less than this.
        assert before - 1e-6 <= at <= after + 1e-6
        assert at == pytest.approx(session.engine.clock.origin + record.t / speed, abs=1e-6)  # type: ignore[attr-defined]


async def test_markers_wait_for_somebody_who_receives_them(scratch: Path) -> None:
    outlet = Outlet(consumers=False)
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet):
        async with connect(session.path, "seer") as program:
            for number in range(50):
                await program.raise_event(f"/e{number}")
            stamps = [record.t for record in program.view.unhandled]
        assert outlet.sent == []
        outlet.consumers = True
        await outlet.until(lambda: len([each for each in outlet.texts if each.startswith("event/")]) == 50)
        events = [(text, at) for text, at in outlet.sent if text.startswith("event/")]
        assert [text for text, _ in events] == [f"event/e{number}" for number in range(50)]
        assert [later[1] - first[1] for first, later in pairwise(events)] == pytest.approx(
            [(later - first) / 50 for first, later in pairwise(stamps)], abs=1e-6
        )


async def test_it_ends_with_the_session(scratch: Path) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet) as task:
        await end(session)
        await asyncio.wait_for(task, PATIENCE)
        assert outlet.texts[-1] == "session/ended" and outlet.closed


async def test_it_ends_when_it_is_told_to_and_the_session_goes_on(scratch: Path) -> None:
    outlet, finish = Outlet(), asyncio.Event()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet, finish) as task:
        async with connect(session.path, "seer") as program:
            await program.mark_sync(7, "sound")
            finish.set()
            await asyncio.wait_for(task, PATIENCE)
            assert outlet.texts[-1] == "sync/7" and outlet.closed
            await program.raise_event("/still_there")
        await eventually(lambda: session.hub.clients == {})


async def test_markers_for_nobody_are_said_at_the_end(scratch: Path, caplog: pytest.LogCaptureFixture) -> None:
    outlet, finish = Outlet(consumers=False), asyncio.Event()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet, finish) as task:
        async with connect(session.path, "seer") as program:
            await program.raise_event("/a")
        finish.set()
        await asyncio.wait_for(task, PATIENCE)
    assert re.search("[1-9] markers? were sent, but no program received the stream", caplog.text)


async def test_an_engine_that_goes_without_a_word(scratch: Path) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet) as task:
        session.server.hub.engine.failure = RuntimeError("out of order")
        await session.server.close()
        with pytest.raises(EngineGone, match="out of order"):
            await asyncio.wait_for(task, PATIENCE)
        assert outlet.closed


async def test_a_connection_that_is_cut_is_made_anew(scratch: Path, caplog: pytest.LogCaptureFixture) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet):
        async with connect(session.path, "seer") as program:
            await program.raise_event("/before")
            await outlet.until(lambda: "event/before" in outlet.texts)
            connections = session.server.connections
            (watching,) = (each for each in connections if each.client and each.client.name == "observer:lsl")
            watching.abort()
            await eventually(lambda: "observer:lsl" not in session.hub.clients)
            await program.raise_event("/between")
            await eventually(lambda: "observer:lsl" in session.hub.clients)
            await program.raise_event("/after")
            await outlet.until(lambda: "event/after" in outlet.texts)
        assert [text for text in outlet.texts if text.startswith("event/")] == ["event/before", "event/after"]
        assert "the connection was cut" in caplog.text


async def test_what_was_before_is_not_sent_and_that_is_said(scratch: Path, caplog: pytest.LogCaptureFixture) -> None:
    outlet = Outlet()
    caplog.set_level(logging.INFO)
    async with served(scratch, GREETING, disk=Disk()) as session:
        async with connect(session.path, "seer") as program:
            await program.raise_event("/before")
            async with following(session, outlet):
                await program.raise_event("/after")
                await outlet.until(lambda: "event/after" in outlet.texts)
        assert "event/before" not in outlet.texts
        assert "earlier events are not sent" in caplog.text
        assert "sending markers of" in caplog.text and "seen on this computer" in caplog.text


async def test_the_stream_says_what_it_belongs_to(scratch: Path) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet):
        stream = outlet.stream
        assert stream is not None
        assert (stream.name, stream.type) == ("rise", "Markers")
        assert stream.source_id == f"rise/{session.folder.name}"
        told = stream.description
        assert told["session"] == session.folder.name and told["mode"] == "debug" and told["format"] == "short"
        assert told["scenario_hash"] == session.engine.scenario.hash
        assert float(told["session_start"]) == pytest.approx(session.engine.clock.origin, abs=1e-5)  # type: ignore[attr-defined]


async def test_whole_records_keep_what_is_private(scratch: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Also what was private before the stream began, and is not in the memory any more."""
    outlet = Outlet()
    private = "person_name"
    async with served(scratch, GREETING, disk=Disk()) as session:
        assert private in session.engine.scenario.private
        async with connect(session.path, "anna", role="wizard") as wizard:
            await wizard.set(private, "Zelda Quux")
            await wizard.set(private, "Somebody")
            async with following(session, outlet, payload="json"):
                await wizard.set(private, "Ottokar")
                await wizard.submit("say", "Hello Ottokar, where is Zelda? asks anna")
                await wizard.add_note("Ottokar is tired")
                await wizard.raise_event("/done")
                await outlet.until(lambda: any('"/done"' in text for text in outlet.texts))
    records = [json.loads(text) for text in outlet.texts]
    told = "\n".join(outlet.texts)
    assert not any(name in told for name in ("Zelda", "Quux", "Ottokar", "Somebody", "anna", "tired"))
    said = next(each for each in records if each["kind"] == "task" and each["function"] == "say")
    assert said["behavior"] == "Hello {person_name}, where is {person_name}? asks W1" and said["source"] == "wizard:W1"
    assert all(each["wall"] == "" for each in records)
    assert "in clear text" in caplog.text


async def test_short_markers_know_what_was_private_before(scratch: Path) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, connect(session.path, "camera") as program:
        await program.set("person_name", "Zelda")
        await program.set("person_name", None)
        async with following(session, outlet):
            await program.raise_event("/seen/Zelda")
            await outlet.until(lambda: any(text.startswith("event/seen") for text in outlet.texts))
        assert "event/seen/{person_name}" in outlet.texts


async def test_without_its_record_nobody_knows_what_is_private(scratch: Path) -> None:
    async with served(scratch, GREETING) as session, connect(session.path, "seer") as program:  # which keeps none
        await program.add_note("something to know")
        with pytest.raises(AdapterError, match="the private values of this session cannot be found"):
            await MarkerFeed(OutletPlan(str(session.path)), Outlet()).run(asyncio.Event())


async def test_a_stream_that_cannot_be_made_is_said_and_the_session_goes_on(scratch: Path) -> None:
    def refuse(stream: MarkerStream) -> Outlet:
        raise AdapterError("no library")

    async with served(scratch, GREETING, disk=Disk()) as session:
        with pytest.raises(AdapterError, match="no library"):
            await MarkerFeed(OutletPlan(str(session.path)), refuse).run(asyncio.Event())
        await eventually(lambda: session.hub.clients == {})
        assert not session.engine.ended


async def test_of_too_many_that_wait_the_oldest_are_given_up(
    scratch: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(marker_feed, "MAX_WAITING", 10)
    outlet, finish = Outlet(consumers=False), asyncio.Event()
    async with served(scratch, GREETING, disk=Disk()) as session, following(session, outlet, finish) as task:
        async with connect(session.path, "seer") as program:
            for number in range(25):
                await program.raise_event(f"/e{number}")
        await eventually(lambda: outlet.feed is not None and outlet.feed.seq >= session.hub.view.seq)
        outlet.consumers = True
        finish.set()
        await asyncio.wait_for(task, PATIENCE)
    assert outlet.texts == [f"event/e{number}" for number in range(15, 25)]
    given_up = re.search(r"(\d+) markers were sent, but no program received", caplog.text)
    assert given_up is not None and int(given_up[1]) >= 15  # with what came when the session began


async def test_the_feed_is_an_observer_that_records_nothing(scratch: Path) -> None:
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, connect(session.path, "seer") as program:
        await program.add_note("the session has begun")
        before = session.hub.view.seq
        async with following(session, outlet):
            roles = {client.name: client.role for client in session.hub.clients.values()}
        assert roles == {"node:seer": "node", "observer:lsl": "observer"}
        await eventually(lambda: "observer:lsl" not in session.hub.clients)
        assert session.hub.view.seq == before


async def test_what_happens_while_the_record_is_read_is_sent(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The state goes on meanwhile; what it has then is not over, but still to come."""
    begun, go_on, read = threading.Event(), threading.Event(), marker_feed._records_before

    def read_slowly(folder: Path | None) -> list[AnyRecord]:
        begun.set()
        assert go_on.wait(PATIENCE)
        return read(folder)

    monkeypatch.setattr(marker_feed, "_records_before", read_slowly)
    outlet = Outlet()
    async with served(scratch, GREETING, disk=Disk()) as session, connect(session.path, "seer") as program:
        await program.add_note("there is a record to read")
        feed = asyncio.create_task(MarkerFeed(OutletPlan(str(session.path)), outlet).run(asyncio.Event()))
        assert await asyncio.to_thread(begun.wait, PATIENCE)
        task = await program.start("R_Nod")
        await program.wait_until(
            lambda view: any(a.confirmed is not None for a in view.tasks[task].actions.values()), PATIENCE
        )
        go_on.set()
        await program.wait_for_task(task, PATIENCE)
        await outlet.until(lambda: "act/R_Nod/succeeded" in outlet.texts)
        feed.cancel()
    acts = [text for text in outlet.texts if text.startswith("act/")]
    assert acts == [f"act/R_Nod/{word}" for word in ("accepted", "by-program", "started", "robot", "succeeded")]
