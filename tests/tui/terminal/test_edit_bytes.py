"""The editor at a terminal: what a letter costs on the wire, and that a lost terminal loses no change."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.tui.terminals import press_keys, terminal

pytestmark = pytest.mark.pty

LETTER, CURSOR = 300, 1_500
"""Bytes: the echo of a letter, and a cursor that goes to another act, beside which all that it does is shown anew."""
STUDY = Path(__file__).parents[3] / "scenarios" / "greeting"
UP, DOWN, ENTER, TAB = b"\x1b[A", b"\x1b[B", b"\r", b"\t"


def test_a_letter_and_a_cursor_cost_little_and_a_hang_up_loses_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    shutil.copytree(STUDY, folder)
    before = {each: each.read_bytes() for each in folder.rglob("*.*")}
    with terminal("edit", str(folder), size=(80, 24)) as it:
        it.until_screen("ACTS")
        it.still()
        for _ in range(3):
            assert 0 < it.cost(DOWN) <= CURSOR
        press_keys(it, b"/", b"R_Greeting", ENTER, b"\x1b[H", ENTER)
        it.until_screen("waits for")
        press_keys(it, DOWN, TAB)
        for _ in range(8):
            if "What is said" in it.text:
                break
            press_keys(it, DOWN)
        press_keys(it, ENTER)
        it.until_screen("as it was")
        press_keys(it, b"x")  # what was said about the value before gives way
        for letter in (b"y", b"z", b"a"):
            assert 0 < it.cost(letter) <= LETTER
        press_keys(it, ENTER)
        it.until_screen("1 change unsaved")
        it.process.kill()
        it.process.wait()
        assert {each: each.read_bytes() for each in before} == before
        with terminal("edit", str(folder), home=it.home, size=(120, 40)) as again:
            again.until_screen("Unsaved changes")
            again.press(b"t")
            again.until_screen("1 change unsaved")
            again.press(b"\x03")
            again.until_screen("Leave the editor?")
            again.press(b"l")
            assert again.ended() == 0


def test_a_letter_in_a_text_costs_little(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    shutil.copytree(STUDY.parent / "lablinking", folder)
    with terminal("edit", str(folder), size=(120, 40)) as it:
        it.until_screen("ACTS")
        it.still()
        for _ in range(3):
            assert 0 < it.cost(DOWN) <= CURSOR
        press_keys(it, b"\x1b[F", UP, UP, UP, UP, ENTER)
        it.until_screen("TEXTS")
        press_keys(it, ENTER)
        it.until_screen("as it was")
        press_keys(it, b"\x1b[200~Noch ein Satz, der nicht mehr in eine Zeile passt, sondern zwei braucht.\x1b[201~")
        it.until_screen("sondern")
        for letter in (b"y", b"z", b"a"):
            assert 0 < it.cost(letter) <= LETTER
