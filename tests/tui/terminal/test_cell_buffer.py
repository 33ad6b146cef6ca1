"""Only cells that differ are written; what a terminal shows is the same as if all had been."""

from __future__ import annotations

from random import Random

import pyte
import pytest
from rich.console import Console
from rich.control import Control
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from rise_tui.rendering.cell_buffer import GAP, Cell, CellBuffer, CellRun, cells_of, strip_of

RED, BLUE = Style(color="red"), Style(color="blue")


def strip(*pieces: tuple[str, Style | None]) -> Strip:
    return Strip([Segment(text, style) for text, style in pieces])


def plain(text: str) -> Strip:
    return strip((text, None))


def written(runs: list[CellRun]) -> list[tuple[int, str]]:
    return [(run.x, run.strip.text) for run in runs]


def frame_with(text: str) -> CellBuffer:
    frame = CellBuffer()
    frame.resize(len(text), 1)
    frame.put(0, 0, plain(text))
    return frame


def test_the_first_time_everything_is_written_and_the_second_time_nothing() -> None:
    frame = CellBuffer()
    frame.resize(5, 1)
    assert written(frame.put(0, 0, plain("hello"))) == [(0, "hello")]
    assert frame.put(0, 0, plain("hello")) == []


def test_a_changed_piece_is_written_alone_also_when_only_its_colour_changed() -> None:
    frame = frame_with("ready   3.0 s")
    assert written(frame.put(8, 0, plain("3.1 s"))) == [(10, "1")]
    assert written(frame.put(0, 0, strip(("ready", RED)))) == [(0, "ready")]
    assert frame.put(0, 0, strip(("ready", Style(color="red")))) == []


def test_near_changes_are_written_as_one_and_far_ones_apart() -> None:
    row = "a" + "." * (GAP - 1) + "b" + "." * (GAP + 1) + "c"
    frame = frame_with(row)
    changed = row.replace("a", "A").replace("b", "B").replace("c", "C")
    assert written(frame.put(0, 0, plain(changed))) == [(0, changed[: GAP + 1]), (len(row) - 1, "C")]


def test_another_size_and_forgetting_write_all_again() -> None:
    frame = frame_with("hello")
    frame.resize(5, 1)
    assert frame.put(0, 0, plain("hello")) == []
    frame.forget()
    frame.resize(5, 1)
    assert written(frame.put(0, 0, plain("hello"))) == [(0, "hello")]
    frame.resize(6, 1)
    assert written(frame.put(0, 0, plain("hello"))) == [(0, "hello")]


def test_what_lies_outside_is_left_out() -> None:
    frame = frame_with("abc")
    assert frame.put(0, 1, plain("x")) == [] and frame.put(0, -1, plain("x")) == []
    assert written(frame.put(2, 0, plain("xyz"))) == [(2, "x")]


@pytest.mark.parametrize(("before", "after"), [("字宇", "宇宇"), ("ab宇", "字宇"), ("字宇", "ab宇")])
def test_wide_characters_are_written_whole(before: str, after: str) -> None:
    frame = CellBuffer()
    frame.resize(4, 1)
    frame.put(0, 0, plain(before))
    assert written(frame.put(0, 0, plain(after))) == [(0, after[:-1])]


def test_cells_and_back() -> None:
    line = strip(("e\u0301 字", RED), ("b", BLUE))
    assert [text for text, _ in cells_of(line)] == ["e\u0301", " ", "字", "\0字", "b"]
    assert strip_of(cells_of(line)).text == line.text
    assert [segment.style for segment in strip_of(cells_of(line))] == [RED, BLUE]


@pytest.mark.parametrize("seed", range(20))
def test_a_terminal_shows_what_a_repaint_would(seed: int) -> None:
    chance, width, height = Random(seed), 40, 6
    frame, screen = CellBuffer(), pyte.Screen(width, height)
    stream, console = pyte.Stream(screen), Console(color_system="truecolor", force_terminal=True)
    frame.resize(width, height)
    rows: list[list[Cell]] = [[(" ", None)] * width for _ in range(height)]  # what should be there, cell by cell
    for y in range(height):
        for run in frame.put(0, y, strip_of(rows[y])):
            stream.feed(Control.move_to(run.x, run.y).segment.text + run.strip.render(console))
    for _ in range(60):
        y, x = chance.randrange(height), chance.randrange(width)
        text = "".join(chance.choice("ab .") for _ in range(chance.randrange(1, width - x + 1)))
        style = chance.choice([None, RED, BLUE])
        rows[y][x : x + len(text)] = [(letter, style) for letter in text]
        for run in frame.put(x, y, strip((text, style))):
            stream.feed(Control.move_to(run.x, run.y).segment.text + run.strip.render(console))
        assert [line.rstrip() for line in screen.display] == [
            "".join(letter for letter, _ in row).rstrip() for row in rows
        ]
        colours = [[screen.buffer[line][column].fg for column in range(width)] for line in range(height)]
        names = {None: "default", RED: "red", BLUE: "blue"}
        assert colours == [[names[style] for _, style in row] for row in rows]
