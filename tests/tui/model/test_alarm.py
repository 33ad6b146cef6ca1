"""What every wizard must know: in words, with what still works and what to do; the worst first."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rise_engine.kernel.records import RobotRecord, StopRecord
from rise_engine.run.protocol.client import Heartbeat, UnrecordedStop
from rise_tui.actions import BY_ID
from rise_tui.key_labels import key_name
from rise_tui.model.alarms import alarm_lines, current_alarms, degraded_text, group_parts
from rise_tui.model.control import blocked_text
from rise_tui.model.notice import Notice
from rise_tui.model.status import status_line
from rise_tui.model.store import SentTask, Store
from rise_tui.rendering.text import line_width, plain_text
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo

FULL = "no space is left on the disk"


def lose(client: FakeClient, detail: str = "no answer for 3 s", *, at: float | None = None) -> None:
    client.emit(RobotRecord(0, 0.0, "", status="lost", detail=detail), at=at)


def store_after(*happenings: Callable[[FakeClient], object], **options: object) -> Store:
    """What a console knows that attaches after these."""
    client = FakeClient(demo(), **options)  # type: ignore[arg-type]
    for happening in happenings:
        happening(client)
    return Store(client.attach_reply(), "anna", client.now)


def said(store: Store) -> list[str]:
    return [plain_text(line) for line in alarm_lines(current_alarms(store, key_name))]


def test_nothing_is_wrong() -> None:
    assert said(store_after()) == []


def test_a_lost_robot_says_for_how_long_what_was_broken_off_and_what_to_do() -> None:
    def happened(client: FakeClient) -> None:
        task = client.act("Greet")
        lose(client, at=83.0)
        client.end_task(task, "Greet", "ABORTED", "the link is lost")
        client.time = 95.4

    first, second, third = said(store_after(happened))
    assert first == " ✗ ROBOT LOST   for 12 s: no answer for 3 s"
    assert second == "   interrupted: Greet; acts fail until the robot is back; rules and memory go on"
    assert "check the robot and its network" in third and "F9 may not reach it, its own switch will" in third
    assert all(len(line) <= 80 for line in (first, second, third))


def test_an_engine_that_stands_still_is_told_and_nothing_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its connection is whole, and its last state would look alive."""
    clock = [100.0]
    monkeypatch.setattr("rise_tui.model.store.monotonic", lambda: clock[0])
    store = store_after()
    clock[0] += 60.0
    assert said(store) == [], "a replay gives no signs of life"
    store.apply([Heartbeat()])
    clock[0] += 2.5
    assert said(store) == [] and store.blocked_reason("start") is None
    clock[0] += 9.5
    first, second, third = said(store)
    assert first == " ✗ ENGINE SILENT   no sign of life for 12 s"
    assert second == "   keys start nothing until it answers; this is the last known state"
    assert third == "   F9 may not reach the robot: use its own switch"
    assert blocked_text(store.blocked_reason("start"), key_name).startswith("the engine gives no sign of life")
    assert store.blocked_reason("change") is None, "a stop is sent all the same"
    store.sent["1"] = SentTask("stopAll", "", 0.0)
    assert said(store)[1:] == [third, " ■ STOP sent   waiting for the engine"]
    assert "SILENT" in plain_text(status_line(store, 80)) and "STOPPED" not in plain_text(status_line(store, 80))
    store.sent.clear()
    store.apply([RobotRecord(1, 0.0, "", status="connected")])
    assert said(store) == [] and store.blocked_reason("start") is None
    clock[0] += 30.0
    store.reattach(store.attach_reply)
    assert said(store) == [], "after a cut it is heard again first"


def test_acts_that_had_ended_before_are_not_broken_off() -> None:
    def happened(client: FakeClient) -> None:
        client.end_task(client.act("Greet"), "Greet")
        client.time = 90.0
        lose(client)

    assert "Greet" not in said(store_after(happened))[1]


def test_free_speech_is_broken_off_too() -> None:
    def happened(client: FakeClient) -> None:
        client.task("say", "One moment please", "ABORTED")
        lose(client, at=client.time)

    store = store_after(happened)
    assert "interrupted: the say line" in said(store)[1]


def test_in_a_replay_nobody_is_told_to_do_anything() -> None:
    told = said(store_after(lose, you="observer:replay", role="observer", replay=True))
    assert "this is a replay" in told[2] and "switch" not in told[2]


def test_a_robot_that_is_back_is_no_alarm() -> None:
    back = RobotRecord(0, 0.0, "", status="connected", detail="")
    assert said(store_after(lose, lambda client: client.emit(back))) == []


def test_a_degraded_robot_is_said_in_words_and_is_no_red_alarm() -> None:
    record = RobotRecord(0, 0.0, "", status="degraded", detail="no server for gaze")
    store = store_after(lambda client: client.emit(record))
    assert current_alarms(store, key_name) == []
    assert degraded_text(store) == "◐ robot degraded since 00:01:23: no server for gaze"


def stopped(client: FakeClient) -> None:
    client.stop("latched", ("pepper/speech",), ("pepper/base",))


def both(client: FakeClient) -> None:
    client.stop("latched", ("pepper/speech",), ("pepper/base",), unstoppable=("pepper/lamp",))


ESTOP = "estop:/estop_pressed"


def pressed(client: FakeClient) -> None:
    client.stop("requested", source=ESTOP, held_by=(ESTOP,))
    client.stop("latched", ("pepper/speech",), source="", held_by=(ESTOP,))


def full(client: FakeClient) -> None:
    client.journal(trouble=FULL)


@pytest.mark.parametrize(
    ("happenings", "heads"),
    [
        ((lose, full, stopped), ["STOPPED", "NOT CONFIRMED  pepper: base", "NOT RECORDING"]),
        ((lose, full), ["NOT RECORDING", "the session is paused", "ROBOT LOST"]),
        ((lose, stopped), ["STOPPED", "NOT CONFIRMED", "ROBOT LOST   for 0 s: no answer for 3 s"]),
        (
            (lose, both),
            ["STOPPED", "NOT CONFIRMED  pepper: base", "CANNOT BE STOPPED  pepper: lamp", "ROBOT LOST"],
        ),
        (
            (both,),
            [
                "STOPPED",
                "confirmed      pepper: speech   look at the robot; F9 asks again",
                "NOT CONFIRMED  pepper: base",
                "CANNOT BE STOPPED  pepper: lamp",
            ],
        ),
        ((lambda client: client.stop("latched"),), ["STOPPED", "confirmed      no part"]),
        ((full,), ["NOT RECORDING   no space", "the session is paused", "F9 still stops the robot"]),
        ((stopped,), ["STOPPED", "confirmed      pepper: speech   look at the robot; F9 asks again", "NOT CONFIRMED"]),
        (
            (pressed,),
            [
                "STOPPED   the emergency stop at /estop_pressed has not been let go",
                "by the emergency stop",
                "every part has confirmed",
            ],
        ),
        ((lambda client: client.stop("requested"),), ["STOP requested", "waiting for the robot", "use its own switch"]),
    ],
)
def test_of_several_the_worst_is_first_and_the_others_are_named(
    happenings: tuple[Callable[[FakeClient], object], ...], heads: list[str]
) -> None:
    told = said(store_after(*happenings))
    for line, head in zip(told, heads, strict=True):
        assert head in line, told


def test_who_cannot_release_a_stop_is_told_why_and_then_that_it_can_be() -> None:
    client = FakeClient(demo())
    pressed(client)
    store = Store(client.attach_reply(), "anna", client.now)
    assert BY_ID["release"].obstacle(store) == "the emergency stop at /estop_pressed has not been let go"
    store.apply([StopRecord(99, 1.0, "", status="let-go", source=ESTOP)])
    assert store.notice is not None and store.notice.text.startswith(
        "the emergency stop at /estop_pressed is no longer"
    )
    assert BY_ID["release"].obstacle(store) is None and store.view.stop.confirmed == ("pepper/speech",)


def test_the_last_line_names_all_the_others() -> None:
    last = said(store_after(lose, full, stopped))[2]
    assert "NOT RECORDING" in last and "ROBOT LOST" in last


def test_a_stop_that_could_not_be_recorded_is_told_all_the_same() -> None:
    stop = UnrecordedStop("engine, because the session ends")
    store = store_after(lambda client: client.journal(trouble=FULL, stop=stop))
    told = said(store)
    assert told[0] == " ■ STOP   sent to the robot by engine, because the session ends; not recorded yet"
    assert "waiting for the robot to confirm" in told[1] and FULL in told[2]
    answer = UnrecordedStop("wizard:anna", True, ("mila/grasp",), ("mila/base (no answer)",), ("mila/face", "mila/say"))
    told = said(store_after(lambda client: client.journal(trouble=FULL, stop=answer)))
    assert "sent to the robot by anna" in told[0]
    assert told[1].strip() == "NOT CONFIRMED  mila: base (no answer)"
    assert told[2].strip() == "CANNOT BE STOPPED  mila: face, say"
    assert FULL in told[3]


def test_a_gone_engine_hides_everything_else_and_says_how_to_come_back() -> None:
    store = store_after(lose, full)
    store.gone_reason = "its process no longer exists"
    told = said(store)
    assert "ENGINE GONE" in told[0] and "not even F9" in told[1] and "recovers" in told[2]
    store.ended_in_order = True
    assert "SESSION ENDED" in said(store)[0] and "LOST" not in "".join(said(store))


def test_everything_fits_in_80_columns() -> None:
    made = [
        store_after(*some) for some in ((lose,), (full,), (stopped,), (pressed,), (lose, full), (lose, stopped, full))
    ]
    gone = store_after()
    gone.gone_reason = "the engine was killed"
    for store in (*made, gone):
        assert all(line_width(line) <= 80 for line in alarm_lines(current_alarms(store, key_name))), said(store)


def test_parts_of_several_robots() -> None:
    assert group_parts(("pepper/arms", "pepper/gaze", "lamp")) == "pepper: arms, gaze; lamp"


# --- on the screen --------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_lost_robot_stays_on_the_screen_until_it_is_back_and_a_degraded_one_takes_one_line() -> None:
    async with console(size=(80, 24)) as it:
        alarm, line = it.bars.alarm_bar, it.bars.attention_bar
        for size in ((80, 24), (200, 50), (120, 40)):
            await it.pilot.resize_terminal(*size)
            lose(it.client)
            await it.until(lambda: "ROBOT LOST   for 0 s" in alarm.text and alarm.display)
            height = alarm.region.height
            it.client.time += 4
            await it.until(lambda: "ROBOT LOST   for 4 s" in alarm.text)
            await it.press("down", "escape")
            it.screen.session.show_notice(Notice("something else"))
            await it.until(lambda: "something else" in it.notice)
            assert "ROBOT LOST" in alarm.text, "it is no notice that a key takes away"
            assert alarm.display and alarm.region.height == height == 3
            it.client.journal(trouble=FULL)
            await it.until(lambda: "NOT RECORDING" in alarm.text)
            assert alarm.region.height == 3
            it.client.journal()
            it.client.emit(RobotRecord(0, 0.0, "", status="connected", detail=""))
            await it.until(lambda: not alarm.display)
        it.client.emit(RobotRecord(0, 0.0, "", status="degraded", detail="no server for gaze"))
        await it.until(lambda: "no server for gaze" in line.text and line.region.height == 1)
        it.client.control_record("asked", "wizard:ben", "wizard:anna")
        await it.until(lambda: line.region.height == 2)
        assert line.text.splitlines()[0].strip() == "ben asks for control: F8 to answer"
        assert not alarm.display
