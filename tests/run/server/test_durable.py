"""With a journal: what a client is told is on the disk, and a disk that fails is told to everybody."""

from __future__ import annotations

import asyncio
import errno
import threading
from pathlib import Path

from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.run.server.server import MAX_UNANSWERED
from rise_engine.session.folder import JOURNAL
from tests.patience import PATIENCE

from .serving import Follower, RawConnection, served


class SlowDisk(Disk):
    """Synchronises when it is let, and fails when it is told to."""

    def __init__(self) -> None:
        self.let = threading.Event()
        self.let.set()
        self.full = False

    def sync(self, descriptor: int) -> None:
        self.let.wait(PATIENCE)
        if self.full:
            raise OSError(errno.ENOSPC, "full")
        super().sync(descriptor)


async def test_what_was_accepted_is_on_the_disk(scratch: Path) -> None:
    async with served(scratch, disk=Disk()) as session:
        follower = await Follower(session.client()).attach()
        await follower.until(lambda view: view.control == "wizard:anna")
        for number in range(50):
            assert (await follower.client.send(Note(text=f"note {number}"))).accepted
            assert f"note {number}".encode() in (session.folder / JOURNAL).read_bytes()


async def test_nobody_is_told_what_could_still_be_lost(scratch: Path) -> None:
    disk = SlowDisk()
    async with served(scratch, disk=disk) as session:
        watching = await Follower(session.client("watch", "observer")).attach()
        await watching.until(lambda view: view.session)
        wizard = await RawConnection.open(session.path)
        wizard.attach("anna", "wizard")
        await wizard.until("ready")
        await watching.until(lambda view: view.control)
        seq = watching.view.seq
        disk.let.clear()
        for id in range(MAX_UNANSWERED + 1):
            wizard.send(type="send", id=id, message={"input": "note", "text": "x"})
        reply = await wizard.until("reply")
        assert (reply["id"], reply["accepted"]) == (MAX_UNANSWERED, False) and "not answered" in reply["reason"]
        wizard.send(type="send", id=999, message={"input": "submit", "function": "stopAll"})
        late = await Follower(session.client("late", "observer")).attach()
        assert watching.view.seq == late.view.seq == seq
        disk.let.set()
        assert [(await wizard.until("reply"))["id"] for _ in range(MAX_UNANSWERED + 1)] == [*range(MAX_UNANSWERED), 999]
        await late.until(lambda view: view.stop.status == "latched")
        await watching.until(lambda view: view.seq >= late.view.seq)
        assert late.view == watching.view
        await wizard.close()


async def test_a_client_that_leaves_before_its_answer_hurts_nobody(scratch: Path) -> None:
    disk = SlowDisk()
    async with served(scratch, disk=disk) as session:
        watching = await Follower(session.client("watch", "observer")).attach()
        await watching.until(lambda view: view.session)
        for _ in range(20):
            seq = watching.view.seq
            asker = await RawConnection.open(session.path)
            asker.attach("asker")
            await asker.until("ready")
            disk.let.clear()
            asker.send(type="send", id=1, message={"input": "note", "text": "x"})
            await asker.close()
            disk.let.set()
            await watching.until(lambda view, seq=seq: view.seq > seq)
        assert watching.error is None
        await watching.close()


async def test_many_that_send_at_once_get_every_record_once(scratch: Path) -> None:
    """`Follower` finds gaps and repetitions."""
    async with served(scratch, disk=Disk()) as session:
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


async def test_a_disk_that_fails_is_told_to_everybody(scratch: Path) -> None:
    disk = SlowDisk()
    async with served(scratch, disk=disk) as session:
        follower = await Follower(session.client()).attach()
        await follower.until(lambda view: view.control)
        disk.full = True
        first = asyncio.create_task(follower.client.send(Note(text="first")))
        await follower.until(lambda view: follower.journaling)
        assert "full" in follower.journaling[-1].trouble
        reply = await follower.client.send(Submit(function="raiseEventTopic", behavior="/x"))
        assert not reply.accepted and "full" in reply.reason
        other = await Follower(session.client("bob", "observer")).attach()
        assert "full" in other.hello.journaling.trouble
        assert not (await follower.client.change_control("release")).accepted
        await other.close()
        disk.full = False
        assert (await first).accepted
        assert (await follower.client.change_control("release")).accepted
        await follower.until(lambda view: view.control is None)
        assert not follower.journaling[-1].trouble
