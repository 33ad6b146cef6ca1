"""What it costs on the wire to open and leave what helps to find one's way (console.md 8.1), measured on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from shutil import rmtree
from tempfile import mkdtemp

import pytest

from tests.console.scripted import scripted
from tests.console.terminals import Terminal, environment_of, terminal

pytestmark = pytest.mark.pty

ESC = b"\x1b"


@pytest.fixture
def console() -> Iterator[Terminal]:
    home = mkdtemp(prefix="rise-", dir="/tmp")  # the path of a socket has to be short
    environment_of(home)
    try:
        with scripted(home), terminal("--wizard", "anna", home=home) as it:
            it.until_screen("ACTS")
            it.still(1.0)
            yield it
    finally:
        rmtree(home, ignore_errors=True)


@pytest.mark.parametrize(
    ("name", "keys", "shows", "opens", "leaves"),
    [
        ("palette", b":", "esc closes", 11_000, 7_000),
        ("help", b"?", "Stop everything", 20_000, 11_000),
        ("control", b"\x19", "You have control", 3_000, 3_000),
        ("jump", b"\x04", "[m]", 2_500, 2_500),
    ],
)
def test_a_box_costs_what_it_covers_and_not_the_screen(
    console: Terminal, name: str, keys: bytes, shows: str, opens: int, leaves: int
) -> None:
    before = console.text
    cost = console.cost(keys)
    console.until_screen(shows)
    assert 200 < cost <= opens, f"{name}: {cost} B"
    cost = console.cost(ESC)
    assert 0 < cost <= leaves, f"leaving {name}: {cost} B"
    console.still()
    assert console.text == before


def test_moving_in_the_palette_costs_two_rows(console: Terminal) -> None:
    console.cost(b":")
    assert console.cost(b"\x1b[B") <= 1_200
