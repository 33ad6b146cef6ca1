"""The participant's cue: marked, counted, answered; and the filler that bridges the time."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import CueRecord
from rise_tui.model.cue import CueClock, counts_tenths, cue_line, filler_due, seconds_since_cue
from rise_tui.rendering.text import plain_text
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

FILLER = "startCommunicationRobotAct", "Filler"

# --- pure -----------------------------------------------------------------------------------------------------------


def cue(answered: float | None = None, filled: float | None = None, has_spoken: bool = True) -> CueClock:
    return CueClock(100.0, answered, has_spoken, filled)


@pytest.mark.parametrize(
    ("since", "shown", "brief", "role"),
    [
        (0.0, "◔ cue 0.0 s", "◔ cue 0.0 s", "plain"),
        (0.94, "◔ cue 0.9 s", "◔ cue 0.9 s", "plain"),
        (1.0, "◑ cue 1.0 s", "◑ cue 1.0 s", "wait"),
        (1.94, "◑ cue 1.9 s", "◑ cue 1.9 s", "wait"),
        (2.0, " ● cue 2.0 s ! ", "cue 2.0 s !", "call"),
        (12.3, " ● cue 12 s ! ", "cue 12 s !", "call"),
        (59.9, " ● cue 59 s ! ", "cue 59 s !", "call"),
    ],
)
def test_how_long_the_participant_has_waited(since: float, shown: str, brief: str, role: str) -> None:
    line = cue_line(cue(), 100.0 + since)
    assert plain_text(line) == shown and {each for _, each in line} == {role}
    assert plain_text(cue_line(cue(), 100.0 + since, short=True)) == brief


def test_an_answer_shows_for_a_while_how_long_it_took() -> None:
    assert plain_text(cue_line(cue(answered=101.3), 101.3)) == "✓ answered 1.3 s"
    assert plain_text(cue_line(cue(answered=101.3), 106.0, short=True)) == "✓ 1.3 s"
    assert cue_line(cue(answered=101.3), 106.4) == ()
    assert cue_line(cue(answered=101.3, has_spoken=False), 106.0) == (("✗ not said", "fault"),)


def test_nothing_is_counted_without_a_cue_after_its_answer_and_when_nobody_answers_at_all() -> None:
    assert cue_line(None, 5.0) == cue_line(cue(), 160.0) == ()
    assert (
        seconds_since_cue(None, 5.0) is None
        and seconds_since_cue(cue(101.0), 102.0) is None
        and seconds_since_cue(cue(), 101.5) == 1.5
    )


@pytest.mark.parametrize(
    ("of", "now", "expected"),
    [(cue(), 100.5, True), (cue(), 109.9, True), (cue(), 110.1, False), (cue(101.0), 101.5, False), (None, 1.0, False)],
)
def test_only_what_counts_tenths_ticks(of: CueClock | None, now: float, expected: bool) -> None:
    assert counts_tenths(of, now) is expected


@pytest.mark.parametrize(
    ("of", "now", "offer_after", "due"),
    [
        (cue(), 101.4, 1.5, None),
        (cue(), 101.5, 1.5, 1.5),
        (cue(), 105.0, 0.0, None),  # 0: never
        (cue(answered=101.0), 105.0, 1.5, None),
        (cue(filled=102.0), 103.0, 1.5, None),  # a filler bridges some time
        (cue(filled=102.0), 104.0, 1.5, 4.0),  # and then the next one is due
        (cue(), 161.0, 1.5, None),
        (None, 1.0, 1.5, None),
    ],
)
def test_when_a_filler_is_due(of: CueClock | None, now: float, offer_after: float, due: float | None) -> None:
    assert filler_due(of, now, offer_after) == due


# --- on the screen --------------------------------------------------------------------------------------------------


def mark(it: Console, status: str = "marked") -> None:
    it.client.emit(CueRecord(0, 0.0, "", status, "wizard:anna"))  # type: ignore[arg-type]


@pytest.mark.slow
async def test_space_marks_the_cue_and_the_status_line_counts_until_the_answer() -> None:
    async with console() as it:

        def line() -> str:
            return it.bars.status_line.text

        await it.press("underscore")
        await it.until(lambda: "not now, no cue is open" in it.notice)
        assert it.client.asked() == []
        it.client.time = 90.0
        for _ in range(6):  # held down
            await it.pilot.press("space")
            await it.pilot.pause(0.03)
        await it.pilot.pause(0.1)
        assert it.client.asked() == [("markCue", "")]
        pressed = it.client.sent[-1].pressed
        assert pressed is not None and 89.7 < pressed <= 90.0
        it.client.sent.clear()
        mark(it)
        await it.until(lambda: "◔ cue 0.0 s" in line())
        assert "Filler" not in it.notice
        it.client.time += 1.4
        await it.until(lambda: "◑ cue 1.4 s" in line())
        it.client.time += 1.0
        await it.until(lambda: "● cue 2.4 s !" in line())
        await it.until(lambda: "no answer for 2.4 s:  , says Filler" in it.notice, "it is offered when it is due")
        await it.pilot.pause(0.3)
        assert it.client.asked() == [], "and never said by the console"
        await it.press("ctrl+x")
        await it.until(lambda: "SAFE" in it.notice and "says Filler" not in it.notice)
        await it.press("ctrl+x")
        await it.until(lambda: "says Filler" in it.notice)
        mark(it, "answered")
        await it.until(lambda: "✓ answered 2.4 s" in line() and "Filler" not in it.notice)
        it.client.time += 6
        await it.until(lambda: "answered" not in line())
        mark(it)
        await it.until(lambda: "cue 0.0 s" in line())
        await it.press("underscore")  # takes it back
        await it.sent("undoCue", "")
        mark(it, "undone")
        await it.until(lambda: "cue 0" not in line())
        await it.until(lambda: ", Filler" in it.bars.key_hints.text)
        await it.press("comma")
        await it.sent("nextFiller", "")
        assert it.client.sent[-1].pressed is not None


@pytest.mark.slow
async def test_the_status_line_counts_until_the_robot_is_heard_or_says_that_it_was_not() -> None:
    async with console() as it:

        def line() -> str:
            return it.bars.status_line.text

        def answer() -> int:
            mark(it)
            it.client.time += 1.0
            task = it.client.act("Greet")
            it.client.emit(CueRecord(0, 0.0, "", "answered", "wizard:anna", task=task, since=1.0))
            return task

        task = answer()
        it.client.action(task, "Greet", "2", "Animation", "started")
        it.client.action(task, "Greet", "2", "Animation", "accepted")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        await it.until(lambda: "says" not in line() and "◑ cue 1.0 s" in line())
        it.client.time += 0.7
        await it.until(lambda: "◑ cue 1.7 s" in line(), "a nod is no answer: the time goes on")
        assert "answered" not in line()
        it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
        await it.until(lambda: "✓ answered 1.7 s" in line())
        it.client.end_task(task, "Greet")
        it.client.time += 6
        task = answer()
        await it.until(lambda: "◑ cue 1.0 s" in line())
        it.client.time += 20
        await it.until(lambda: "● cue 21 s !" in line())
        it.client.end_task(task, "Greet", "ABORTED", "no voice")
        await it.until(lambda: "✗ not said" in line())


@pytest.mark.slow
async def test_the_cue_moves_nothing_else_in_the_status_line() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40), (200, 50)):
            await it.pilot.resize_terminal(*size)
            await it.until(lambda: "LIVE" in it.bars.status_line.text and "cue" not in it.bars.status_line.text)
            before = it.bars.status_line.text
            mark(it)
            it.client.time += 0.4
            await it.until(lambda: "cue 0.4 s" in it.bars.status_line.text)
            after = it.bars.status_line.text
            for word in ("DEBUG", "REC", "LIVE", "anna"):
                assert before.index(word) == after.index(word)
            mark(it, "undone")


@pytest.mark.slow
async def test_without_fillers_none_is_named_and_a_cue_that_a_rule_waits_for_is_held_back_in_safe() -> None:
    client = FakeClient(replace(demo(), act_settings={}))
    async with console(client=client) as it:
        await it.until(lambda: "space cue" in it.bars.key_hints.text)
        assert ", " not in it.bars.key_hints.text
        await it.press("comma")
        await it.until(lambda: "this scenario has no filler" in it.notice)
        assert client.asked() == []
        it.screen.input.switch_safe()
        await it.press("space")
        await it.sent("markCue", "")
    async with console(client=FakeClient(replace(demo(), topics=frozenset({"cue"})))) as it:
        it.screen.input.switch_safe()
        await it.press("space")
        await it.until(lambda: "cue not" in it.notice or "cue: not now" in it.notice)
        assert it.client.asked() == []
