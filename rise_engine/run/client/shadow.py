"""A recorded session, replayed to a second wizard, who sees its cues and presses keys that have no effect.

It implements the same `Client` as a running session. From the first wizard's first key after a cue, their reaction and
its consequences are hidden. They appear when the second wizard has answered or the cue is over: by the next cue, by its
removal, or by the end. So both wizards decide with the same knowledge: what the robot did up to the cue. The first
wizard's later judgements (marks, notes, outcome) are never shown.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, is_locked
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import (
    AnyRecord,
    CheckRecord,
    ControlRecord,
    CueRecord,
    MistakeRecord,
    NoteRecord,
    OutcomeRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.kernel.view import SessionView
from rise_engine.kernel.wizard_marks import MARKS
from rise_engine.run.protocol.client import (
    AttachReply,
    ClientInput,
    ClientUpdate,
    ControlVerb,
    EngineGone,
    Reply,
    ShadowStatus,
)
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL, read_info
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.scenario_copies import load_session_scenario
from rise_engine.session.shadow import (
    Shadow,
    ShadowCue,
    ShadowEnd,
    ShadowKey,
    ShadowLine,
    ShadowMark,
    ShadowNote,
    ShadowPause,
    ShadowPlay,
    ShadowWriter,
)
from rise_engine.study.labels import refuse_relabelled

BATCH = 500
"""Maximum number of records in one batch, so that a console can paint in between."""
MIN_WAIT = 0.001
"""In seconds: the shortest wait that a clock can measure."""
_ABOUT_CUES = frozenset({"markCue", "undoCue"})
_PEOPLE = ("wizard:", "observer:")
_PAUSED = "paused: nothing is kept before it goes on"
_NOT_HERE = Reply(False, "this is a shadow of a session: there is nothing to take control of, or to report")


def start_time(folder: Path, text: str) -> float:
    """Return the session time of `--at`: seconds (`12.5`) or a mark (`mark`: the first one; `mark3`: number 3).

    :raises SessionError: there is no such time or mark; the text names the existing ones.
    """
    if not text.startswith("mark"):
        try:
            seconds = float(text)
        except ValueError:
            seconds = -1.0
        if not 0 <= seconds < float("inf"):
            raise SessionError(f"`{text}` is not a time: seconds of the session (12.5), `mark`, or `mark2`")
        return seconds
    marks = {
        record.number: record.t
        for record in reversed(list(read_journal(folder / JOURNAL).read_records()))
        if isinstance(record, SyncRecord)
    }
    if not marks:
        raise SessionError("the session has no mark for recordings: give seconds, or begin at its beginning")
    wanted = text.removeprefix("mark")
    number = min(marks, key=lambda each: marks[each]) if not wanted else int(wanted) if wanted.isdecimal() else -1
    if number not in marks:
        known = ", ".join(f"mark{each}" for each in sorted(marks))
        raise SessionError(f"the session has no `{text}`; it has {known}")
    return marks[number]


class ShadowClient:
    """An implementation of `rise_engine.run.protocol.client.Client` over a session's folder. It begins paused."""

    def __init__(
        self,
        folder: Path,
        wizard: str,
        *,
        at: float = 0.0,
        speed: float = 1.0,
        resume: Shadow | None = None,
    ) -> None:
        """:param folder: the session's.
        :param wizard: the second wizard's name.
        :param at: session time at which playing starts; earlier records are known from the start.
        :param speed: session seconds in a second.
        :param resume: continue this shadow where it stopped, with its own `at` and `speed`.
        """
        self._folder, self._wizard, self._resume = folder, wizard, resume
        self._at, self._again = (at, 0) if resume is None else resume.resume_at
        self._speed = speed if resume is None else resume.header.speed
        self._writer: ShadowWriter | None = None
        self._scenario: Scenario | None = None
        self._records: list[AnyRecord] = []
        self._next = 0
        """Index of the first record that was not handled yet."""
        self._own: list[ClientUpdate] = []
        """Updates that this console itself causes."""
        self._held: list[AnyRecord] = []
        self._holds = False
        self._cue: CueRecord | None = None
        """The cue that waits for this wizard's answer."""
        self._cues = self._shown = 0
        self._base, self._since = self._at, 0.0
        """Session time at the last start or pause, and the clock's time then."""
        self._paused = True
        self._over = False
        self._wake = asyncio.Event()
        self._closed = False
        self._trouble = ""
        """Why the last line was not stored."""
        self._writing = asyncio.Lock()
        self._pending: set[asyncio.Task[bool]] = set()

    @property
    def path(self) -> Path | None:
        """The file that stores the keys, once it is open."""
        return self._writer.path if self._writer is not None else None

    # --- the beginning --------------------------------------------------------------------------------------------

    async def attach(self) -> AttachReply:
        try:
            return await asyncio.to_thread(self._open)
        except SessionError as error:
            raise EngineGone(str(error)) from None

    def _open(self) -> AttachReply:
        refuse_relabelled(self._folder)
        info = read_info(self._folder)
        if is_locked(self._folder / JOURNAL):
            raise SessionError("the session still runs: its cues can be played when it has ended")
        records = list(read_journal(self._folder / JOURNAL).read_records())
        scenario = load_session_scenario(self._folder, info, [])
        marked = [each for each in records if isinstance(each, CueRecord) and each.status == "marked"]
        ahead = [each for each in marked if self._is_unplayed(each)]
        if not marked:
            raise SessionError("the session has no cue: there is nothing for a second wizard to judge")
        if not ahead:
            raise SessionError(f"after {self._at:g} s the session has no cue: there is nothing to judge any more")
        view = SessionView()
        while self._next < len(records) and not self._is_unplayed(records[self._next]):
            if not _is_hidden(records[self._next]):
                view.apply(records[self._next])
            self._next += 1
        view.control = you = f"wizard:{self._wizard}"
        self._shown, self._cues = len(marked) - len(ahead), len(marked)
        self._records, self._scenario = records, scenario
        if self._resume is not None:  # otherwise nothing needs to be stored before the start
            self._writer = ShadowWriter.resume(self._resume.path)
        return AttachReply(
            scenario, info.mode, info.robot, info.seed, view, you=you, folder=str(self._folder), shadow=True
        )

    def _is_unplayed(self, record: AnyRecord) -> bool:
        """Return whether a record still has to be played: by its time, or from the cue that is repeated."""
        return record.seq >= self._again if self._again else record.t >= self._at

    # --- records --------------------------------------------------------------------------------------------------

    async def records(self) -> AsyncIterator[Sequence[ClientUpdate]]:
        yield [self._status]
        while not self._closed:
            self._wake.clear()
            batch = self._due()
            if batch:
                yield batch
                await asyncio.sleep(0)
                continue
            if self._over:
                return
            wait = None
            if not self._paused and self._next < len(self._records):
                wait = max(MIN_WAIT, (self._records[self._next].t - self.now()) / self._speed)
            try:
                await asyncio.wait_for(self._wake.wait(), wait)
            except TimeoutError:
                continue

    def _due(self) -> list[ClientUpdate]:
        """Return the updates that became visible since the last call."""
        batch: list[ClientUpdate] = list(self._own)
        self._own.clear()
        if not self._holds:
            batch += self._held
            self._held.clear()
        while not self._paused and len(batch) < BATCH and self._next < len(self._records):
            record = self._records[self._next]
            if record.t > self.now():
                break
            self._next += 1
            batch += self._take(record)
        if self._next == len(self._records) and not self._over and not self._paused:
            self._base = self.now()
            self._over, self._cue, self._holds = True, None, False
            batch += self._held
            self._held.clear()
            self._write_soon(ShadowEnd(round(self._base, 6)))
        return batch

    def _take(self, record: AnyRecord) -> list[ClientUpdate]:
        """Handle a record that is due; return the updates that become visible by it."""
        if isinstance(record, CueRecord) and record.status in ("marked", "undone"):
            released: list[ClientUpdate] = [*self._held, record]
            self._held.clear()
            self._holds, self._cue = False, None
            if record.status == "marked":
                self._cue, self._shown = record, self._shown + 1
                self._write_soon(ShadowCue(record.t, record.seq))
                released.append(self._status)
            return released
        if self._cue is not None and _is_first_sign(record):
            self._holds = True
        if _is_hidden(record):
            return []
        if self._holds:
            self._held.append(record)
            return []
        return [record]

    @property
    def _status(self) -> ShadowStatus:
        return ShadowStatus(self._paused, self._shown, self._cues, self._writer is not None)

    def now(self) -> float:
        if self._paused or self._over:
            return self._base
        return self._base + (time.monotonic() - self._since) * self._speed

    async def toggle_pause(self) -> str:
        """Pause or continue; return why that is impossible, or empty."""
        if self._over:
            return "the session is over"
        if self._paused:
            if not await self._write(ShadowPlay(round(self._base, 6))):
                return self._trouble
            self._since, self._paused = time.monotonic(), False
        else:
            self._halt()
            await self._write(ShadowPause(round(self._base, 6)))
        self._notify(self._status)
        return ""

    def _halt(self) -> None:
        self._base, self._paused = self.now(), True

    def _notify(self, update: ClientUpdate) -> None:
        self._own.append(update)
        self._wake.set()

    # --- keys -----------------------------------------------------------------------------------------------------

    async def send(self, message: ClientInput) -> Reply:
        if self._over or self._closed:
            return Reply(False, "the session is over")
        if self._paused:
            return Reply(False, _PAUSED)
        if isinstance(message, Note):
            kept = await self._write(ShadowNote(round(self.now(), 6), message.text))
            return Reply(kept, "" if kept else self._trouble)
        if not isinstance(message, Submit):
            return _NOT_HERE
        return await (self._mark(message) if message.function == "markMistake" else self._keep(message))

    async def _keep(self, message: Submit) -> Reply:
        at = self.now() if message.pressed is None else min(message.pressed, self.now())
        cue = self._cue if self._cue is not None and at >= self._cue.t else None
        key = ShadowKey(
            t=round(at, 6),
            function=message.function,
            behavior=message.behavior,
            calling_type=message.calling_type,
            cue=cue.seq if cue is not None else None,
            filler=self._is_filler(message),
        )
        if key.answers:  # before it is on the disk: later records do not belong to this cue
            self._cue = None
        if not await self._write(key):
            self._cue = self._cue or cue
            return Reply(False, self._trouble)
        if key.answers and self._cue is None:
            self._holds = False
            self._wake.set()
        since = f"{at - cue.t:.1f} s after the cue; " if cue is not None else ""
        return Reply(True, f"{since}kept, and sent nowhere")

    def _is_filler(self, message: Submit) -> bool:
        if message.function == "nextFiller":
            return True
        is_act = message.function == "startCommunicationRobotAct"
        return is_act and self._scenario is not None and self._scenario.settings_of(message.behavior).filler

    async def _mark(self, message: Submit) -> Reply:
        number, _, mark = message.behavior.partition(" ")
        found = next((each for each in MARKS if each == mark), None)
        if not number.isdecimal() or found is None:
            return Reply(False, f"write the task's id and one of {', '.join(MARKS)}, as in `17 late`")
        at = round(self.now(), 6)
        if not await self._write(ShadowMark(at, int(number), found)):
            return Reply(False, self._trouble)
        seen = self._records[self._next - 1].seq if self._next else 0
        self._notify(MistakeRecord(seen, at, "", int(number), "", found, f"wizard:{self._wizard}"))
        return Reply(True, "kept, and sent nowhere")

    async def _write(self, line: ShadowLine) -> bool:
        """Write a line; if that fails, pause, so that no key is lost. Return whether it is on the disk."""
        async with self._writing:
            if self._closed:
                return False
            try:
                await asyncio.to_thread(self._append, line)
            except (OSError, SessionError) as error:
                reason = error_message(error) if isinstance(error, OSError) else str(error)
                self._trouble = f"NOT KEPT, and paused: {reason}"
                self._halt()
                self._notify(self._status)
                return False
        return True

    def _append(self, line: ShadowLine) -> None:
        if self._writer is None:
            self._writer = ShadowWriter.begin(self._folder, self._wizard, speed=self._speed)
        self._writer.append(line)

    def _write_soon(self, line: ShadowLine) -> None:
        """Write a line in the background, in the order of the calls."""
        writing = asyncio.get_running_loop().create_task(self._write(line))
        self._pending.add(writing)
        writing.add_done_callback(self._pending.discard)

    async def change_control(self, verb: ControlVerb) -> Reply:
        return _NOT_HERE

    async def take_over(self) -> Reply:
        return _NOT_HERE

    async def close(self, *, end_session: bool = False) -> None:
        """Leave; the shadow can be resumed. `end_session` has no effect: no session runs."""
        if self._closed:
            return
        if not self._paused and not self._over:
            self._halt()
            await self._write(ShadowPause(round(self._base, 6)))
        await asyncio.gather(*self._pending)
        self._closed = True
        self._wake.set()
        async with self._writing:
            if self._writer is not None:
                await asyncio.to_thread(self._writer.close)


def _is_first_sign(record: AnyRecord) -> bool:
    """Return whether a record is the first sign of a wizard's decision. Every later record may follow from it."""
    if isinstance(record, TaskRecord):
        return record.source.startswith("wizard:") and record.function not in _ABOUT_CUES
    return False


def _is_hidden(record: AnyRecord) -> bool:
    """Return whether a record is never shown: judgements of the session by people, and changes of control."""
    match record:
        case ControlRecord() | MistakeRecord() | OutcomeRecord():
            return True
        case NoteRecord() | CheckRecord():
            return record.source.startswith(_PEOPLE)
        case TaskRecord():
            return record.function == "markMistake"
        case _:
            return False
