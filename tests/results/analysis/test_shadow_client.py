"""A session's cues, played to a second wizard: what they see and when, and what is kept of what they press."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Coroutine, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import CheckReport, Note, Submit
from rise_engine.kernel.records import (
    AnyRecord,
    ControlRecord,
    CueRecord,
    MistakeRecord,
    NoteRecord,
    OutcomeRecord,
    Record,
    TaskRecord,
)
from rise_engine.run.client.shadow import ShadowClient, _is_first_sign, _is_hidden, start_time
from rise_engine.run.protocol.client import AttachReply, EngineGone, Reply, ShadowStatus
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.shadow import (
    Shadow,
    ShadowCue,
    ShadowEnd,
    ShadowHeader,
    ShadowKey,
    ShadowMark,
    ShadowNote,
    ShadowPause,
    ShadowPlay,
    ShadowWriter,
    read_shadow,
    read_shadows,
    unfinished_shadow,
)
from tests.chance import examples
from tests.results.analysis.cues import ACT, CUES, Intent, cue_numbers, make_session
from tests.virtual_time import VirtualLoop, monotonic


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_session(tmp_path)


class Sitting:
    """A second wizard before a console, in time that passes when nothing is left to do."""

    def __init__(self, client: ShadowClient) -> None:
        self.client = client
        self.seen: list[tuple[float, Record]] = []
        """When what was shown."""
        self.status: ShadowStatus | None = None

    async def begin(self, *, play: bool = True) -> AttachReply:
        reply = await self.client.attach()
        self.task = asyncio.ensure_future(self._watch())
        if play:
            assert await self.client.toggle_pause() == ""
        return reply

    async def _watch(self) -> None:
        async for batch in self.client.records():
            for update in batch:
                if isinstance(update, ShadowStatus):
                    self.status = update
                elif isinstance(update, Record):
                    self.seen.append((self.client.now(), update))

    async def until(self, at: float) -> None:
        """Wait for this session time."""
        while self.client.now() < at - 1e-6:  # noqa: ASYNC110  # time passes when nothing is left to do
            await asyncio.sleep(at - self.client.now())

    async def press(self, at: float, behavior: str, function: str = ACT) -> Reply:
        await self.until(at)
        return await self.client.send(Submit(function=function, behavior=behavior, pressed=at))

    def tasks(self) -> list[str]:
        """What was started, as far as it was shown."""
        first = {each.id: each for _, each in reversed(self.seen) if isinstance(each, TaskRecord)}
        return [first[id].behavior for id in sorted(first) if first[id].function != "markCue"]

    def shown_at(self, behavior: str) -> float:
        return next(at for at, each in self.seen if isinstance(each, TaskRecord) and each.behavior == behavior)


def in_virtual_time(work: Coroutine[Any, Any, None]) -> None:
    loop = VirtualLoop()
    try:
        loop.run_until_complete(work)
    finally:
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()


def kept(folder: Path) -> Shadow:
    (found,), problems = read_shadows(folder)
    assert not problems and not found.problems
    return found


def test_what_the_first_wizard_did_is_seen_when_the_second_has_answered(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.until(5)
        assert ben.tasks() == ["Task"]  # Praise was at 2.2 s
        assert [each.status for _, each in ben.seen if isinstance(each, CueRecord)] == ["marked"]
        reply = await ben.press(6, "Repeat")
        assert (reply.accepted, reply.reason) == (True, "5.0 s after the cue; kept, and sent nowhere")
        await ben.until(7)
        assert ben.tasks() == ["Task", "Praise"]
        assert ben.shown_at("Praise") >= 6 - 1e-6
        await ben.client.close()

    in_virtual_time(judge())


def test_who_answers_first_sees_the_other_answer_at_its_time(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.press(1.5, "Praise")
        await ben.until(3)
        assert 2.2 - 1e-6 <= ben.shown_at("Praise") < 4
        await ben.client.close()

    in_virtual_time(judge())


def test_the_next_cue_shows_what_was_held_back(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.until(9.9)
        assert "Praise" not in ben.tasks()
        await ben.until(10.1)
        assert ben.tasks() == ["Task", "Praise"]
        await ben.press(12, "Hm")  # a filler answers nothing
        await ben.until(13)
        assert "Repeat" not in ben.tasks()
        await ben.press(14, "", "nextFiller")
        assert "Repeat" not in ben.tasks()
        await ben.press(15, "Hint")
        await ben.until(15.5)
        assert ben.tasks()[-2:] == ["Hm", "Repeat"]
        await ben.client.close()

    in_virtual_time(judge())
    numbers = cue_numbers(folder)
    keys = [each for each in kept(folder).lines if isinstance(each, ShadowKey)]
    assert [(each.behavior, each.cue, each.filler, each.answers) for each in keys] == [
        ("Hm", numbers[1], True, False),
        ("", numbers[1], True, False),
        ("Hint", numbers[1], False, True),
    ]


def test_everything_is_kept_and_nothing_is_said_of_what_the_first_one_thought(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        reply = await ben.begin()
        assert reply.shadow and not reply.replay
        assert (reply.you, reply.view.control) == ("wizard:ben", "wizard:ben")
        await ben.press(2, "Praise")
        await ben.press(22, "/next", "raiseEventTopic")
        assert (await ben.client.send(Note(text="unclear"))).accepted
        await ben.press(41, "Mine, Maria", "say")
        await ben.press(46, "12 wrong", "markMistake")
        await ben.task
        assert ben.status == ShadowStatus(False, 5, 5)
        hidden = (ControlRecord, OutcomeRecord, NoteRecord)
        assert not [each for _, each in ben.seen if isinstance(each, hidden)]
        marks = [each for _, each in ben.seen if isinstance(each, MistakeRecord)]
        assert [(each.task, each.mark, each.source) for each in marks] == [(12, "wrong", "wizard:ben")]
        assert not (await ben.press(50, "Praise")).accepted
        await ben.client.close()

    in_virtual_time(judge())
    one, two, three, four, five = cue_numbers(folder)
    # While a thread writes a line, the clock goes on as the machine's does.
    lines = tuple(
        replace(line, t=float(int(line.t + 0.001))) for line in kept(folder).lines if not isinstance(line, ShadowHeader)
    )
    assert lines == (
        ShadowPlay(0.0),
        ShadowCue(1.0, one),
        ShadowKey(t=2.0, function=ACT, behavior="Praise", cue=one),
        ShadowCue(10.0, two),
        ShadowCue(20.0, three),
        ShadowKey(t=22.0, function="raiseEventTopic", behavior="/next", cue=three),
        ShadowNote(22.0, "unclear"),
        ShadowCue(30.0, four),
        ShadowCue(40.0, five),
        ShadowKey(t=41.0, function="say", behavior="Mine, Maria", cue=five),
        ShadowMark(46.0, 12, "wrong"),
        ShadowEnd(50.0),
    )
    found = kept(folder)
    assert found.complete and found.header.wizard == "ben"
    assert found.path.stat().st_mode & 0o777 == 0o600
    assert found.path.parent.stat().st_mode & 0o777 == 0o700
    assert {path: path.read_bytes() for path in before} == before


def test_a_pause_stops_the_time_and_keeps_nothing(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin(play=False)
        await asyncio.sleep(100)
        assert ben.client.now() == 0 and not ben.seen
        assert ben.status == ShadowStatus(True, 0, 5, kept=False)
        assert not (folder / "shadow").exists()
        reply = await ben.client.send(Submit(function=ACT, behavior="Praise"))
        assert not reply.accepted and "paused" in reply.reason
        assert await ben.client.toggle_pause() == ""
        await ben.until(1.5)
        await ben.client.toggle_pause()
        await asyncio.sleep(100)
        assert ben.client.now() == pytest.approx(1.5)
        assert ben.status == ShadowStatus(True, 1, 5)
        await ben.client.toggle_pause()
        await ben.press(2, "Praise")
        await ben.client.close()

    in_virtual_time(judge())
    assert [type(each) for each in kept(folder).lines] == [
        *(ShadowPlay, ShadowCue, ShadowPause, ShadowPlay, ShadowKey, ShadowPause)
    ]


def test_twice_as_fast_the_same_session_times_are_kept(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben", speed=2))
        began = monotonic()
        await ben.begin()
        await ben.task
        assert 24.5 < monotonic() - began < 45, "half of 50 s, and what the disk's thread took"
        await ben.client.close()

    in_virtual_time(judge())
    assert kept(folder).header.speed == 2


# --- begun in the middle, ended in the middle -------------------------------------------------------------------------


def test_begun_later_what_was_before_is_known(folder: Path) -> None:
    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben", at=9.0))
        reply = await ben.begin(play=False)
        assert [task.behavior for task in reply.view.tasks.values()] == ["Task", "", "Praise"]
        assert ben.client.now() == 9.0
        await asyncio.sleep(0)
        assert ben.status == ShadowStatus(True, 1, 5, kept=False)
        await ben.client.close()

    in_virtual_time(judge())
    assert not (folder / "shadow").exists()


def test_gone_on_with_an_unanswered_cue_is_shown_again(folder: Path) -> None:
    async def leave() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.press(2, "Praise")
        await ben.until(12)  # the second cue is open, and what anna did about it is held back
        await ben.client.close()

    async def go_on() -> None:
        left = unfinished_shadow(folder, "ben")
        assert left is not None
        assert left.resume_at == (10.0, cue_numbers(folder)[1])
        assert unfinished_shadow(folder, "carl") is None
        ben = Sitting(ShadowClient(folder, "ben", resume=left))
        reply = await ben.begin()
        assert [task.behavior for task in reply.view.tasks.values()][-2:] == ["Praise", ""]
        assert ben.client.now() == 10.0
        await ben.press(13, "Hint")
        await ben.until(14)
        assert ben.tasks()[-1] == "Repeat"
        await ben.client.close()

    in_virtual_time(leave())
    first = kept(folder).path.read_bytes()
    in_virtual_time(go_on())
    found = kept(folder)
    assert found.path.read_bytes().startswith(first)
    assert 14 - 1e-3 <= found.resume_at[0] < 20
    assert found.resume_at[1] == 0


def test_begun_anew_it_is_another_file(folder: Path) -> None:
    async def leave() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.client.close()

    in_virtual_time(leave())
    in_virtual_time(leave())
    assert [each.path.name for each in read_shadows(folder)[0]] == ["1.jsonl", "2.jsonl"]


def test_a_line_that_was_torn_costs_that_line_alone(folder: Path) -> None:
    writer = ShadowWriter.begin(folder, "ben")
    writer.append(ShadowPlay(0.0))
    writer.close()
    with writer.path.open("ab") as file:
        file.write(b'{"kind":"cue","t":1.')
    again = ShadowWriter.resume(writer.path)
    again.append(ShadowPlay(1.0))
    with pytest.raises(SessionError, match="is being written by another console"):
        ShadowWriter.resume(writer.path)
    again.close()
    again.close()
    found = read_shadow(writer.path)
    assert found.lines == (ShadowPlay(0.0), ShadowPlay(1.0))
    assert len(found.problems) == 1 and "1.jsonl:3: cannot be read" in found.problems[0]


def test_a_disk_that_is_full_from_the_start_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = FullDisk()
    disk.full = True
    monkeypatch.setattr("rise_engine.session.shadow.Disk", lambda: disk)

    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin(play=False)
        said = await ben.client.toggle_pause()
        assert said == f"NOT KEPT, and paused: no shadow can be kept in {folder}: the disk is full"
        await ben.client.close()

    in_virtual_time(judge())
    assert list((folder / "shadow").iterdir()) == []


class FullDisk(Disk):
    full = False

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        if self.full:
            raise OSError(28, "No space left on device")
        super().write(descriptor, data, offset)


def test_when_the_disk_is_full_it_stands_still(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = FullDisk()
    monkeypatch.setattr("rise_engine.session.shadow.Disk", lambda: disk)

    async def judge() -> None:
        ben = Sitting(ShadowClient(folder, "ben"))
        await ben.begin()
        await ben.until(1.5)
        disk.full = True
        reply = await ben.press(2, "Praise")
        assert (reply.accepted, reply.reason) == (False, "NOT KEPT, and paused: the disk is full")
        stood = ben.client.now()
        await asyncio.sleep(5)
        assert ben.client.now() == stood >= 2
        assert ben.status is not None and ben.status.paused
        assert await ben.client.toggle_pause() == "NOT KEPT, and paused: the disk is full"
        disk.full = False
        assert await ben.client.toggle_pause() == ""
        assert (await ben.press(3, "Praise")).accepted
        await ben.client.close()

    in_virtual_time(judge())
    assert [each.cue for each in kept(folder).lines if isinstance(each, ShadowKey)] == [cue_numbers(folder)[0]]


# --- what cannot be ---------------------------------------------------------------------------------------------------


async def test_a_session_without_cues_is_none_for_a_shadow(tmp_path: Path) -> None:
    folder = make_session(tmp_path, [(1.0, "act", "Praise")])
    with pytest.raises(EngineGone, match="the session has no cue"):
        await ShadowClient(folder, "ben").attach()
    assert not (folder / "shadow").exists()


async def test_after_the_last_cue_there_is_nothing_to_judge(folder: Path) -> None:
    with pytest.raises(EngineGone, match="after 45 s the session has no cue"):
        await ShadowClient(folder, "ben", at=45).attach()
    assert not (folder / "shadow").exists()


async def test_nothing_else_is_reported_or_controlled(folder: Path) -> None:
    client = ShadowClient(folder, "ben")
    await client.attach()
    await client.toggle_pause()
    assert not (await client.send(CheckReport(id="x", result="passed"))).accepted
    assert not (await client.change_control("take")).accepted
    await client.close()
    await client.close(end_session=True)


def test_a_time_can_be_a_mark(tmp_path: Path) -> None:
    folder = make_session(tmp_path, [(0.5, "sync", "1"), *CUES, (45.0, "sync", "2")])
    assert [start_time(folder, text) for text in ("0", "12.5", "mark", "mark2")] == [0, 12.5, 0.5, 45]
    with pytest.raises(SessionError, match="has no `mark7`; it has mark1, mark2"):
        start_time(folder, "mark7")
    for wrong in ("-1", "soon", "nan", "inf"):
        with pytest.raises(SessionError, match="is not a time"):
            start_time(folder, wrong)
    (folder / "other").mkdir()
    without = make_session(tmp_path / "two")
    with pytest.raises(SessionError, match="no mark for recordings"):
        start_time(without, "mark")


def test_what_does_not_say_who_judges_is_no_shadow(folder: Path) -> None:
    (folder / "shadow").mkdir(mode=0o700)
    (folder / "shadow" / "1.jsonl").write_text('{"kind":"play","t":0}\n')
    (folder / "shadow" / "notes.jsonl").write_text("not ours\n")
    shadows, problems = read_shadows(folder)
    assert not shadows
    assert len(problems) == 1 and "does not say who judges" in problems[0]
    assert (folder / JOURNAL).exists()


# --- whatever the two wizards do --------------------------------------------------------------------------------------


WHAT = st.sampled_from(
    [("cue", ""), ("cue", ""), ("act", "Praise"), ("act", "Hm"), ("event", "/next"), ("say", "Hello"), ("undo", "")]
)


@st.composite
def scripts(draw: st.DrawFn) -> list[Intent]:
    """A cue, and then anything, half seconds apart."""
    times = draw(st.lists(st.integers(2, 40), unique=True, max_size=12).map(sorted))
    deeds = [(1.0, "cue", ""), *((at * 0.5 + 0.5, *draw(WHAT)) for at in times)]
    is_open, kept = False, []
    for at, what, which in deeds:
        if what == "undo" and not is_open:
            continue  # it would be refused, and is then a deed like any other
        is_open = what == "cue" or (is_open and which == "Hm")
        kept.append((at, what, which))
    return kept


@pytest.mark.slow
@settings(max_examples=examples(25))
@given(scripts(), st.lists(st.integers(1, 90), unique=True, max_size=8).map(sorted))
def test_nothing_too_early_and_nothing_lost(deeds: list[Intent], presses: list[int]) -> None:
    """`presses`: when the second wizard presses the key of an act, in quarters of a second (and a little later)."""
    with tempfile.TemporaryDirectory() as root:
        folder = make_session(Path(root), deeds, seconds=25.0)
        loop = VirtualLoop()
        try:
            loop.run_until_complete(_judge(folder, [each / 4 + 0.11 for each in presses]))
        finally:
            loop.run_until_complete(loop.shutdown_default_executor())
            loop.close()


async def _judge(folder: Path, presses: list[float]) -> None:
    client = ShadowClient(folder, "ben")
    await client.attach()
    await client.toggle_pause()
    told: list[tuple[float, AnyRecord]] = []
    """When what was shown."""

    async def watch() -> None:
        async for batch in client.records():
            told.extend((client.now(), each) for each in batch if isinstance(each, Record))

    watching = asyncio.ensure_future(watch())
    for at in presses:
        while client.now() < at - 1e-6:  # noqa: ASYNC110  # time passes when nothing is left to do
            await asyncio.sleep(at - client.now())
        await client.send(Submit(function=ACT, behavior="Repeat", pressed=at))
    await watching
    await client.close()

    records = list(read_journal(folder / JOURNAL).read_records())
    seen = [each for _, each in told]
    assert seen == [each for each in records if not _is_hidden(each)]  # all of it, in order, and nothing else
    for at, each in told:
        assert at >= _may_be_told(each, records, presses) - 1e-6, each
    (found,), problems = read_shadows(folder)
    assert not problems and found.complete
    assert [each.cue for each in found.lines if isinstance(each, ShadowCue)] == cue_numbers(folder)
    answers = [each.cue for each in found.lines if isinstance(each, ShadowKey) and each.answers]
    assert len(answers) == len(set(answers))  # one answer to a cue


def _may_be_told(record: AnyRecord, records: Sequence[AnyRecord], presses: list[float]) -> float:
    """From when on: a deed of the first wizard not before the cue that it may be about was answered, or over."""
    turns = [each for each in records if isinstance(each, CueRecord) and each.status in ("marked", "undone")]
    before = [each for each in turns if each.seq < record.seq]
    if not _is_first_sign(record) or not before or before[-1].status == "undone":
        return record.t
    cue = before[-1]
    over = min((each.t for each in turns if each.seq > cue.seq), default=records[-1].t)
    answered = min((at for at in presses if at >= cue.t), default=over)
    return max(record.t, min(over, answered))
