"""What the console costs on the wire (console.md 8.1), counted at a terminal. Bytes only: no test here measures time.

The engine's clock stands still except where a test lets it go, so that every byte has its cause.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from time import monotonic

import pytest

from rise_engine.kernel.records import MemoryRecord
from tests.patience import PATIENCE
from tests.tui.scripted import ScriptedEngine, scripted_console
from tests.tui.terminals import Terminal

pytestmark = pytest.mark.pty

FOCUS, PANE, LOG_LINE, ROW, CURSOR = 2_000, 5_000, 2_500, 300, 400
"""`PANE`: the focus goes to a pane that another one had covered."""
CLOCK = 110
"""A second, while nothing but the clock moves."""
DIALOG = 30_000
"""Opening or closing what covers much of the screen."""
SMALL, USUAL = (80, 24), (120, 40)
F2, DOWN, UP, ESCAPE = b"\x1bOQ", b"\x1b[B", b"\x1b[A", b"\x1b"


@pytest.fixture(scope="module", params=[SMALL, USUAL], ids=["80x24", "120x40"])
def shared(request: pytest.FixtureRequest) -> Iterator[tuple[Terminal, ScriptedEngine]]:
    with scripted_console(request.param) as both:
        yield both


def caused(it: Terminal, engine: ScriptedEngine, what: object, shown: str) -> int:
    """Bytes that a deed of the engine costs."""
    it.still()
    before = it.count
    engine.do(what)  # type: ignore[arg-type]
    it.until_screen(shown)
    it.still()
    return it.count - before


def test_nothing_is_written_while_nothing_happens(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, _ = shared
    end = monotonic() + PATIENCE
    while it.still(2.5):  # what was begun before may come late; what comes again and again never ends
        assert monotonic() < end, "it paints although nothing happens"


def test_a_change_of_focus(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, _ = shared
    for _ in range(5):  # once through all panes
        assert 0 < it.cost(b"\t") <= PANE
    for _ in range(3):
        assert 0 < it.cost(F2) <= FOCUS


def test_a_move_of_the_cursor_also_the_first(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, _ = shared
    it.cost(b"\t")
    it.cost(F2)  # from a pane to the acts
    for key in (DOWN, DOWN, UP, UP):
        assert 0 < it.cost(key) <= CURSOR


def test_a_line_of_the_log(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, engine = shared
    show(it, "LOG")
    for number in range(3):
        name = f"/event{number}"
        cost = caused(it, engine, lambda fake, name=name: fake.task("raiseEventTopic", name, "SUCCEEDED"), name)
        assert 0 < cost <= LOG_LINE


def test_a_row_that_changes(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, engine = shared
    show(it, "MEMORY")

    def change(value: str) -> int:
        record = MemoryRecord(0, 0.0, "", "side", value, None, "rule:x", created=False)
        return caused(it, engine, lambda fake: fake.emit(record), value)

    change("first")  # its source and age change as well
    for value in ("north", "south"):
        assert 0 < change(value) <= ROW


BOXES = {
    "palette": (b":", "esc closes", 5_000, 5_000),
    "help": (b"?", "search keys, actions and words", 10_000, 8_000),
    "control": (b"\x19", "You have control", 2_000, 2_500),
    "jump": (b"\x04", "[m]", 2_500, 2_500),
}
"""A key, what it shows, and what opening and leaving it may cost."""


@pytest.mark.parametrize(("key", "shows", "opens", "leaves"), BOXES.values(), ids=BOXES)
def test_a_box_costs_what_it_covers_and_not_the_screen(
    key: bytes, shows: str, opens: int, leaves: int, shared: tuple[Terminal, ScriptedEngine]
) -> None:
    it, _ = shared
    before = it.text
    assert 200 < it.cost(key) <= opens
    it.until_screen(shows)
    assert 0 < it.cost(ESCAPE) <= leaves
    assert it.text == before


@pytest.mark.parametrize("key", [b"\x14", b"\x0f", b"/"], ids=["say", "note", "filter"])
def test_a_line_that_is_typed_into(key: bytes, shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, _ = shared
    assert 0 < it.cost(key) <= DIALOG
    assert 0 < it.cost(ESCAPE) <= DIALOG


def test_a_move_in_the_palette_costs_two_rows(shared: tuple[Terminal, ScriptedEngine]) -> None:
    it, _ = shared
    it.cost(b":")
    assert 0 < it.cost(DOWN) <= 1_200
    it.cost(ESCAPE)


def test_the_clock() -> None:
    with scripted_console(USUAL, speed=1.0) as (it, _):
        it.still(0.1)
        before, seen = it.count, set[str]()
        while len(seen) < 4:
            it.read(0.2)
            seen |= set(re.findall(r"\d\d:\d\d:\d\d", it.lines[0]))
        first, *_, last = (sum(int(part) * unit for part, unit in zip(each.split(":"), (3600, 60, 1), strict=True))
                           for each in sorted(seen))  # fmt: skip
        assert it.count - before <= CLOCK * (last - first + 2), "of the clock's own seconds, not of this machine's"


def show(it: Terminal, title: str) -> None:
    """Bring a pane to the front, by its title in the bar."""
    for _ in range(6):
        if re.search(rf"(^|[ ▕│▌]){title}( |$)", it.text, re.MULTILINE):
            return
        it.cost(b"\t")
    raise AssertionError(f"{title} is in no bar:\n{it.text}")
