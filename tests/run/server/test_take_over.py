"""Changed files are taken over into a session that runs: recorded, kept, replayed, recovered; or refused, and then
nothing has happened."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ScenarioRecord
from rise_engine.privacy.sharing import share_session
from rise_engine.run.protocol.client import LinkLost, Reply
from rise_engine.run.server.take_over import ScenarioTakeover
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_header
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import recover
from rise_engine.session.replay import compare_replay
from rise_engine.session.scenario_copies import copy_folders

from .serving import GREETING, Follower, Served, served

NOD = Submit(function="startCommunicationRobotAct", behavior="R_Greeting")


@asynccontextmanager
async def serving_copy(scratch: Path, *, speed: float = 10.0) -> AsyncIterator[tuple[Served, Path]]:
    """A session of a study whose files the test may change. Quicker, a busy machine would miss an action's deadline."""
    study = scratch / "study"
    shutil.copytree(GREETING, study)
    async with served(scratch, study, speed=speed, disk=Disk()) as session:
        takeover = ScenarioTakeover(session.engine, session.folder, {}, session.server.scenario_changed)
        session.hub.take_over = takeover.begin
        yield session, study


def change(study: Path, before: str = "Hello", after: str = "Good evening") -> None:
    acts = study / "acts/greeting.xml"
    text = acts.read_text("utf-8")
    assert before in text
    acts.write_text(text.replace(before, after), "utf-8")


def with_header(folder: Path) -> Path:
    """A session that has ended, with the first line that `rise-engine serve` writes."""
    journal = folder / JOURNAL
    journal.write_bytes(encode_header("rise-tui test") + journal.read_bytes())
    return folder


async def take_over(session: Served) -> Reply:
    client = session.client("editor", "node")
    await client.attach()
    try:
        return await client.take_over()
    finally:
        await client.close()


async def say_something(follower: Follower) -> None:
    reply = await follower.client.send(NOD)
    assert reply.accepted
    await follower.until(lambda view: not view.running and not view.waiting and (reply.task or 0) in view.tasks)


async def test_changed_files_are_taken_over_recorded_kept_and_replayed(scratch: Path) -> None:
    async with serving_copy(scratch) as (session, study):
        anna = await Follower(session.client()).attach()
        before = anna.hello.scenario
        await say_something(anna)
        change(study)
        reply = await take_over(session)
        assert reply == Reply(True), reply
        assert session.engine.scenario.hash != before.hash
        assert [path.name for path in copy_folders(session.folder)] == ["scenario", "scenario.2"]
        await anna.over()
        assert isinstance(anna.error, LinkLost) and "attach again" in str(anna.error)
        again = await Follower(anna.client).attach()
        assert again.hello.scenario.hash == session.engine.scenario.hash  # as the session's own copy has it
        assert again.hello.view.remarks[-1].text == "the session goes on with changed files: act R_Greeting changed"
        await say_something(again)
        change(study, "Good evening", "Good night")
        assert (await take_over(session)).accepted
    folder = with_header(session.folder)
    records = list(read_journal(folder / JOURNAL).read_records())
    first, second = (record for record in records if isinstance(record, ScenarioRecord))
    assert (first.was, first.hash, second.was) == (before.hash, second.was, first.hash)
    assert first.source == "node:editor" and first.changes == ("act R_Greeting changed",)
    comparison = compare_replay(folder)
    assert comparison.identical and comparison.records == len(records), comparison.difference
    shutil.move(folder / "scenario.3", folder / "gone")
    with pytest.raises(SessionError, match="the files that this session has taken over are missing"):
        compare_replay(folder)


async def test_a_session_that_took_over_files_is_recovered_with_them_and_shared_with_them(scratch: Path) -> None:
    async with serving_copy(scratch) as (session, study):
        anna = await Follower(session.client()).attach()
        await say_something(anna)
        change(study)
        assert (await take_over(session)).accepted
        hash = session.engine.scenario.hash
        torn = scratch / "torn"
        shutil.copytree(session.folder, torn)
    recovered = recover(torn)
    assert recovered.scenario.hash == hash and recovered.kernel.scenario.hash == hash
    shared = scratch / "shared"
    share_session(with_header(session.folder), shared, level="shared")
    assert (shared / "scenario.2/acts/greeting.xml").is_file() and compare_replay(shared).identical


async def test_what_cannot_be_taken_over_is_refused_and_nothing_is_kept(scratch: Path) -> None:
    async with serving_copy(scratch, speed=1.0) as (session, study):
        anna = await Follower(session.client()).attach()
        hash = session.engine.scenario.hash
        reply = await take_over(session)
        assert reply.reason == "the files have not changed since the session read them"
        change(study, "</Dialog>", "</Dialogue>")
        reply = await take_over(session)
        assert not reply.accepted and reply.reason.startswith("the changed files have errors: acts/greeting.xml:")
        change(study, "</Dialogue>", "</Dialog>")
        change(study)
        assert (await anna.client.send(NOD)).accepted
        reply = await take_over(session)
        assert reply.reason == "an act runs or waits; wait until the robot has finished"
        watcher = session.client("bob", "observer")
        await watcher.attach()
        assert (await watcher.take_over()).reason == "an observer cannot take over changed files"
        await watcher.close()
        assert session.engine.scenario.hash == hash and anna.error is None
        assert [path.name for path in copy_folders(session.folder)] == ["scenario"]
        both = await asyncio.gather(take_over(session), take_over(session))
        assert not any(reply.accepted for reply in both)
