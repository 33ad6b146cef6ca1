"""Keys as terminals send them: real bytes, in the encodings and pieces in which they come."""

from __future__ import annotations

import os
from collections.abc import Iterator
from time import monotonic, sleep

import pytest

from tests.tui.scripted import ScriptedEngine, scripted_console
from tests.tui.terminals import Terminal

pytestmark = pytest.mark.pty

ACT = "startCommunicationRobotAct"
Both = tuple[Terminal, ScriptedEngine]

STOPS = {
    "xterm, rxvt, linux, tmux": b"\x1b[20~",
    "kitty": b"\x1b[20;1~",
    "kitty with num lock": b"\x1b[20;129~",
    "ctrl+g": b"\x07",
    "ctrl+g in kitty": b"\x1b[103;5u",
    "ctrl+g as xterm may send it": b"\x1b[27;5;103~",
}
LOCKS = b"\x1f"
"""What terminals send for ctrl+_, which locks the console, and for ctrl+/."""
CONFUSED = {
    "ctrl+h is backspace": b"\x08",
    "backspace": b"\x7f",
    "ctrl+i is tab": b"\t",
    "alt+1": b"\x1b1",
    "alt+g": b"\x1bg",
    "alt+enter": b"\x1b\r",
    "ctrl+shift+g in kitty": b"\x1b[103;6u",
    "ctrl+space": b"\x00",
    "ctrl+/": LOCKS,
}
GARBAGE = {
    "no UTF-8": b"\xff\xfe\xc3\x28\xa0",
    "half a character": b"\xe2\x82",
    "a character beyond Unicode": b"\x1b[99999999u",
    "a mouse report from nowhere": b"\x1b[<0;9999;-5M",
    "a mouse report without numbers": b"\x1b[<;;M",
    "an old mouse report": b"\x1b[M\x00\xff\x7f",
    "an unknown sequence": b"\x1b[?9999;42$y\x1b]11;rgb:0000/0000/0000\x07",
    "a sequence without an end": b"\x1b[1;2;3;4;5;6;7;8;9;10;11;12;13;14;15;16;17",
}


@pytest.fixture(scope="module")
def shared() -> Iterator[Both]:
    with scripted_console() as both:
        yield both


@pytest.fixture
def both(shared: Both) -> Both:
    """What was pressed before has been through. A stop works at any time; nothing waits for it."""
    it, engine = shared
    it.still()
    engine.fake.sent.clear()
    return shared


@pytest.fixture
def rested(both: Both) -> Both:
    """Nothing of what was pressed before has an effect any more."""
    both[0].still(0.5)  # longer than a paste silences the keys, and than a key's debounce time
    return both


def stop(it: Terminal, engine: ScriptedEngine, keys: bytes = STOPS["ctrl+g"]) -> None:
    before = engine.asked("stopAll")  # the engine may have it before this thread goes on
    it.press(keys)
    engine.until_sent("stopAll", times=before + 1)


@pytest.mark.parametrize("keys", STOPS.values(), ids=STOPS)
def test_stop_stops(keys: bytes, shared: Both) -> None:
    stop(*shared, keys)


@pytest.mark.parametrize("keys", [STOPS["ctrl+g"], STOPS["xterm, rxvt, linux, tmux"]], ids=["ctrl+g", "F9"])
@pytest.mark.parametrize(
    "where", [b":", b"?", b"\x0f", b"/", b"\x14"], ids=["palette", "help", "note", "filter", "say"]
)
def test_stop_stops_wherever_one_is(where: bytes, keys: bytes, both: Both) -> None:
    it, engine = both
    it.cost(where)
    it.press(b"g")  # typed, not pressed
    it.still()
    stop(it, engine, keys)
    it.press(b"\x1b")
    it.still()
    assert engine.asked(ACT, "Greet") == 0


@pytest.mark.parametrize("keys", CONFUSED.values(), ids=CONFUSED)
def test_what_terminals_confuse_starts_nothing(keys: bytes, both: Both) -> None:
    it, engine = both
    it.press(keys)
    it.still()
    stop(it, engine)
    assert [function for function, _ in engine.fake.asked() if function != "stopAll"] == []
    if keys == LOCKS:
        it.press(keys)
        it.until_screen("SAFE")
        it.press(b"\x18")
        it.until_screen("LIVE")


def test_a_key_alone_starts_its_act_once(rested: Both) -> None:
    it, engine = rested
    it.press(b"g")
    engine.until_sent(ACT, "Greet")
    it.still()
    stop(it, engine)  # all that was pressed before has been through
    assert engine.asked(ACT, "Greet") == 1


def test_escape_and_a_letter_in_two_pieces_are_two_keys(both: Both) -> None:
    it, engine = both
    it.press(b"\x1b")
    it.still(0.5)
    it.press(b"g")
    engine.until_sent(ACT, "Greet")


def test_a_function_key_in_two_pieces_is_one_key(both: Both) -> None:
    it, engine = both
    for _ in range(20):
        began = monotonic()
        os.write(it.master, b"\x1b[2")
        sleep(0.02)  # less than a terminal's user could wait, and more than one read
        os.write(it.master, b"0~")
        if monotonic() - began < 0.05:  # on a busy machine the second piece may be so late that it is another key
            break
        it.still(0.5)
    engine.until_sent("stopAll")


@pytest.mark.parametrize(
    "block", [b"\x1b[200~gpm.\r\x1b[201~", b"gpm.", b"g\rp\rm", b"gg"], ids=["bracketed", "bare", "lines", "one twice"]
)
def test_a_pasted_block_starts_nothing(block: bytes, rested: Both) -> None:
    it, engine = rested
    it.press(block)
    if b"\x1b" not in block:
        it.until_screen("several keys at once")
    it.still()
    stop(it, engine)
    assert [function for function, _ in engine.fake.asked() if function != "stopAll"] == []


def test_a_key_held_down_counts_once(rested: Both) -> None:
    it, engine = rested
    slowest, last = 0.0, monotonic()
    for _ in range(25):
        os.write(it.master, b"g")
        it.read(0.033)
        slowest, last = max(slowest, monotonic() - last), monotonic()
    engine.until_sent(ACT, "Greet")
    it.still(0.6)
    stop(it, engine)
    if slowest < 0.15:  # no keyboard repeats as slowly as this machine did then
        assert engine.asked(ACT, "Greet") == 1


@pytest.mark.parametrize("data", GARBAGE.values(), ids=GARBAGE)
def test_garbage_does_nothing_and_the_next_key_works(data: bytes, both: Both) -> None:
    it, engine = both
    it.press(data)
    it.still(0.5)
    assert it.process.poll() is None
    stop(it, engine)
    it.press(b"\x1b")
    it.still()
    assert [function for function, _ in engine.fake.asked() if function != "stopAll"] == []


def test_clicks_and_the_wheel_arrive(both: Both) -> None:
    it, engine = both
    place = next(y for y, line in enumerate(it.lines, 1) if "F9/^G STOP" in line)
    it.press(b"\x1b[<0;4;%dM\x1b[<0;4;%dm" % (place, place))
    engine.until_sent("stopAll")
    it.press(b"\x1b[<64;60;10M\x1b[<65;60;10M\x1b[<35;1;1M")
    it.still()
    stop(it, engine)
