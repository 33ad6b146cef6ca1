"""What it costs on the wire to open and leave what helps to find one's way (console.md 8.1), measured on a terminal."""

from __future__ import annotations

from shutil import rmtree
from tempfile import mkdtemp

import pytest

from tests.tui.scripted import scripted
from tests.tui.terminals import environment_of, terminal

pytestmark = pytest.mark.pty

ESC = b"\x1b"


def test_a_box_costs_what_it_covers_and_not_the_screen() -> None:
    home = mkdtemp(prefix="rise-", dir="/tmp")  # the path of a socket has to be short
    environment_of(home)
    try:
        with scripted(home), terminal("--wizard", "anna", home=home) as it:
            it.until_screen("ACTS")
            it.still(1.0)
            for name, keys, shows, opens, leaves in (
                ("palette", b":", "esc closes", 11_000, 7_000),
                ("help", b"?", "Stop everything", 20_000, 11_000),
                ("control", b"\x19", "You have control", 3_000, 3_000),
                ("jump", b"\x04", "[m]", 2_500, 2_500),
            ):
                before = it.text
                cost = it.cost(keys)
                it.until_screen(shows)
                assert 200 < cost <= opens, f"{name}: {cost} B"
                cost = it.cost(ESC)
                assert 0 < cost <= leaves, f"leaving {name}: {cost} B"
                it.still()
                assert it.text == before
            it.cost(b":")
            assert it.cost(b"\x1b[B") <= 1_200, "moving in the palette costs two rows"
    finally:
        rmtree(home, ignore_errors=True)
