"""The console's side of the link: receives batches of records, sends the wizard's requests (console.md 3.1, 5.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from itertools import count
from pathlib import Path
from time import monotonic
from typing import TypeVar

from rise_engine.base.files import is_locked, wait_until
from rise_engine.kernel.inputs import CheckReport, Note, OutcomeReport, Submit
from rise_engine.run.client.shadow import ShadowClient
from rise_engine.run.protocol.client import AttachReply, Client, ClientUpdate, ControlVerb, EngineGone, LinkLost
from rise_engine.session.folder import JOURNAL, has_ended
from rise_tui.key_labels import key_name, why_blocked
from rise_tui.model.control import Intent
from rise_tui.model.notice import Notice, task_label
from rise_tui.model.store import ALL_PARTS, SentTask, Store, StorePart, parts_of_sent

Answer = TypeVar("Answer")
ChangeCallback = Callable[[frozenset[StorePart] | set[StorePart]], None]

RECORDS_PER_TURN = 64
"""Maximum number of records before the loop handles other events."""
REATTACH_SECONDS = 0.5
"""Seconds between two attempts to attach again after the connection was cut."""

RECLAIM_SECONDS, MAX_RECLAIMS = 0.1, 30
"""Seconds between attempts to reclaim control from the cut connection, and their number."""

RECONNECTED = "the connection is back; keys pressed in between may or may not have arrived: look at the log"
RECONNECTED_STOPPING = "the connection is back; STOP may not have arrived"
DISK_SECONDS = 6.0
"""Seconds to wait for the last records: the engine of a session that is over gives the disk 5 s."""
STOP_NOT_SENT = "STOP was NOT sent: the connection is cut. Use the robot's own switch"


def _has_recorded_end(folder: Path) -> bool:
    """Whether the record of a session that is over has an end when its engine gives up. Blocks."""
    wait_until(lambda: has_ended(folder) or not is_locked(folder / JOURNAL), DISK_SECONDS)
    return has_ended(folder)


class ConsoleSession:
    """One attached session."""

    def __init__(self, client: Client, store: Store) -> None:
        self.client = client
        self.store = store
        self.on_change: ChangeCallback = lambda parts: None
        """Called after every change of the store. The screen repaints at its own pace."""
        self._task_numbers = count(1)
        self._is_closed = False
        self._reclaiming: asyncio.Task[None] | None = None
        """Kept here because the loop holds only a weak reference to a task."""

    @classmethod
    async def attach(cls, client: Client, wizard: str) -> ConsoleSession:
        """Attach to a session. Raises EngineGone."""
        attach_reply = await client.attach()
        return cls(client, Store(attach_reply, wizard, client.now))

    async def receive_records(self) -> None:
        """Receive records until the session ends or its engine has gone. Attach again if only the link was cut."""
        while True:
            try:
                async for batch in self.client.records():
                    await self._apply_batch(batch)
                break
            except LinkLost:
                if self._is_closed or not await self._reattach():
                    return
                if self.store.reclaims_control:
                    self._reclaiming = asyncio.create_task(self._reclaim_control())
            except EngineGone as gone:
                self._note_engine_gone(str(gone), over=self.store.view.ended)
                return
        if self._is_closed:
            return
        await self._check_recorded_end()
        ended = self.store.view.end_reason
        self._note_engine_gone(ended or "it has ended", over=True)

    async def _check_recorded_end(self) -> None:
        """Check on this disk whether the record of a session that is over has an end."""
        attached = self.store.attach_reply
        folder = Path(attached.folder)
        if not (attached.replay or attached.shadow or self.store.view.ended) and (folder / JOURNAL).is_file():
            self.store.end_unrecorded = not await asyncio.to_thread(_has_recorded_end, folder)

    async def _apply_batch(self, batch: Sequence[ClientUpdate]) -> None:
        """Apply records in pieces, so that a key need not wait until a slow console has caught up."""
        for start in range(0, len(batch), RECORDS_PER_TURN):
            if start:
                await asyncio.sleep(0)
            self.on_change(self.store.apply(batch[start : start + RECORDS_PER_TURN]))

    async def _reattach(self) -> bool:
        """Attach again. False: the engine has gone meanwhile."""
        self.store.cut_since = monotonic()
        self.on_change(ALL_PARTS)
        while True:
            try:
                self._adopt_snapshot(await self.client.attach())
            except LinkLost:
                await asyncio.sleep(REATTACH_SECONDS)
            except EngineGone as gone:
                self._note_engine_gone(str(gone), over=False)
                return False
            else:
                self.on_change(ALL_PARTS)
                return True

    def _adopt_snapshot(self, attach_reply: AttachReply) -> None:
        """Take over the new snapshot, which is right. The fate of requests sent meanwhile is unknown."""
        stopping = self.store.stopping
        self.store.reattach(attach_reply)
        again = f"{RECONNECTED_STOPPING}: press {key_name('stop')} again unless it says STOPPED"
        self.store.notice = Notice(again, "fault") if stopping else Notice(RECONNECTED, "wait")

    async def _reclaim_control(self) -> None:
        """Take back the control that was lost with the connection, when the engine has noticed the cut.

        Not in a recovered session, where that would let acts begin.
        """
        store = self.store
        for _ in range(MAX_RECLAIMS):
            if not store.reclaims_control or store.cut_since is not None or store.has_control:
                break
            if store.view.waits_for_wizard:
                break
            if store.view.control is None:
                await self.change_control("take")
                break
            await asyncio.sleep(RECLAIM_SECONDS)
        store.reclaims_control = False

    async def submit(
        self, function: str, behavior: str = "", calling_type: str = "", pressed: float | None = None
    ) -> bool:
        """Request a task; its results arrive as records. Never raises: problems are shown.

        `pressed`: session time of the key. False: the task was not accepted, or that is unknown.
        """
        store = self.store
        if reason := why_blocked(store, "reach"):
            if function == "stopAll" and store.cut_since is not None:
                store.stop_unsent = True
                store.notice = Notice(STOP_NOT_SENT, "fault")
            else:
                store.notice = Notice(f"{task_label(function, behavior)}: not sent, {reason}", "fault")
            self.on_change({"notice", "status"})
            return False
        ref = f"{store.reference_prefix}{next(self._task_numbers)}"
        store.sent[ref] = SentTask(function, behavior, store.now())
        self.on_change(parts_of_sent(function))
        message = Submit(
            function=function,
            behavior=behavior,
            calling_type=calling_type,
            source=store.own_name,
            ref=ref,
            pressed=pressed,
        )
        reply = await self._answer(self.client.send(message))
        if reply is None:
            return False  # it stays `sent` until the next snapshot
        if not reply.accepted or reply.task is None or reply.task in store.view.tasks:
            store.sent.pop(ref, None)
        if reply.accepted and store.attach_reply.shadow:
            store.notice = Notice(f"{task_label(function, behavior)}: {reply.reason}")
        if not reply.accepted:
            store.notice = Notice(f"{task_label(function, behavior)} was rejected: {reply.reason}", "wait")
        self.on_change(parts_of_sent(function) | {"notice"})
        return reply.accepted

    async def _answer(self, request: Awaitable[Answer]) -> Answer | None:
        """Return the engine's answer; None: the connection was cut, or the engine has gone, which the screen then
        shows."""
        try:
            return await request
        except LinkLost:
            return None
        except EngineGone as gone:
            self._note_engine_gone(str(gone), over=False)
            return None

    async def add_note(self, text: str) -> bool:
        """Add a remark to the record. False: it was not accepted, and the reason is shown."""
        reason = await self._send_report(Note(text=text, source=self.store.own_name), "remark")
        if reason:
            self.show_notice(Notice(f"the note was not recorded: {reason}", "wait"))
        return not reason

    async def report(self, reports: Sequence[CheckReport | OutcomeReport]) -> bool:
        """Record the results of checks, and how the session counts. False: not accepted, and the reason is shown."""
        for each in reports:
            if reason := await self._send_report(each, "change"):
                self.show_notice(Notice(f"the session goes on, because this was not recorded: {reason}", "fault"))
                return False
        return True

    async def _send_report(self, message: Note | CheckReport | OutcomeReport, intent: Intent) -> str:
        """Send a message that is not a task. Returns why it was refused, or empty. `intent`: the needed right."""
        if reason := why_blocked(self.store, intent):
            return reason
        reply = await self._answer(self.client.send(message))
        if reply is not None:
            return "" if reply.accepted else reply.reason
        gone = why_blocked(self.store, "reach") if self.store.gone_reason else ""
        return gone or "the connection was cut; it may or may not have arrived"

    async def change_control(self, verb: ControlVerb) -> None:
        """Take, ask for, give or release control. The result arrives as a record."""
        reason = why_blocked(self.store, "remark")
        if not reason:
            reply = await self._answer(self.client.change_control(verb))
            reason = "" if reply is None or reply.accepted else reply.reason  # the next snapshot shows the holder
        if reason:
            self.show_notice(Notice(f"control has not changed: {reason}", "wait"))

    async def take_over_files(self) -> None:
        """Make the session continue with its study's present files. The connection is then cut and opened again."""
        reply = await self._answer(self.client.take_over())
        if reply is not None:  # otherwise the record shows the result
            kept = f"the session keeps its files: {reply.reason}"
            self.show_notice(Notice("the session now uses the changed files" if reply.accepted else kept, "wait"))

    async def toggle_pause(self) -> None:
        """Pause or resume a session that is played to a second wizard."""
        if isinstance(self.client, ShadowClient) and (reason := await self.client.toggle_pause()):
            self.show_notice(Notice(f"it cannot resume: {reason}", "fault"))

    def show_notice(self, notice: Notice) -> None:
        """Show a notice."""
        self.store.notice = notice
        self.on_change({"notice"})

    async def close(self, *, end_session: bool) -> None:
        """Leave. With `end_session` the engine stops the robot and ends."""
        self._is_closed = not end_session  # the end of the records has no meaning then
        await self.client.close(end_session=end_session)
        if end_session:
            await self._check_recorded_end()

    def _note_engine_gone(self, reason: str, *, over: bool) -> None:
        store = self.store
        if self._is_closed:
            return
        if not store.gone_reason or over:
            store.gone_reason, store.ended_in_order = reason or "no reason was given", over
        store.cut_since = None
        store.sent.clear()
        self.on_change(ALL_PARTS)
