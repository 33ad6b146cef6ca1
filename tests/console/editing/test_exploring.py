"""What exploring has found stands beside the states, and in the list of what is wrong."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

import pytest

from rise_tui.editing.exploring import explore_saved
from rise_tui.editing.finding_list import WayList
from rise_tui.editing.model.explored import ExploredPlace, ExploredStudy, explored_line, read_explored
from tests.console.editing.conftest import editor

QUIZ = Path(__file__).parents[2] / "explore" / "studies" / "quiz"
STUCK = ExploredPlace(
    "problem",
    "Greeting can come to a stand in Nobody",
    "rules/greeting.xml",
    14,
    "Greeting",
    "Nobody",
    ("the wizard presses b (begin) → Greeting begins in Start", "10 s pass → nothing comes of it"),
)
IDLE = ExploredPlace("warning", "the key x never does anything", "scenario.toml", 9)
FOUND = ExploredStudy((STUCK, IDLE), 1_266, True, "14:05")


class Explorers:
    """An explorer that finds what a test says, and remembers how often it was asked."""

    def __init__(self, found: ExploredStudy | None) -> None:
        self.found, self.asked = found, 0

    async def __call__(self, folder: str) -> ExploredStudy | None:
        self.asked += 1
        return self.found


async def test_what_was_found_is_said_and_stands_beside_its_state(study: Path) -> None:
    async with editor(study, explorer=Explorers(FOUND)) as found:
        await found.until(lambda: "explored" in found.notice)
        assert found.notice.strip() == "! explored 1,266 situations: 1 problem and 1 warning (f shows them)"
        assert "explored" not in found.screen.findings.text
        await found.open("rule", "Greeting")
        await found.until(lambda: "✗ explored: Greeting can come to a stand" in found.screen.findings.text)
        await found.open("rule", "Gaze")
        await found.until(lambda: "explored" not in found.screen.findings.text)


async def test_the_list_shows_it_and_the_way_there(study: Path) -> None:
    async with editor(study, explorer=Explorers(FOUND)) as found:
        await found.until(lambda: "explored" in found.notice)
        await found.press("f", "tab")
        await found.until(lambda: isinstance(found.pilot.app.screen, WayList))
        way = found.pilot.app.screen
        assert isinstance(way, WayList)
        assert way.list.count == len(STUCK.way)
        await found.press("escape", "f", "enter")
        await found.until(lambda: found.screen.opened is not None and found.screen.opened.KIND == "rule")


async def test_after_a_change_it_says_of_when_it_is_and_after_saving_it_is_explored_anew(study: Path) -> None:
    explorer = Explorers(FOUND)
    async with editor(study, explorer=explorer) as found:
        await found.until(lambda: "explored" in found.notice)
        await found.open("rule", "Greeting")
        await found.press("r")
        await found.type("X")
        await found.press("enter")
        await found.until(lambda: found.screen.study.draft.changed_files)
        renamed = found.screen.opened
        assert renamed is not None
        explorer.found = ExploredStudy((), 1_300, True, "14:09")
        await found.press("ctrl+o", "enter")
        await found.until(lambda: explorer.asked == 2)
        await found.until(lambda: found.screen.explored.at == "14:09")


async def test_nothing_to_say_says_nothing(study: Path) -> None:
    explorer = Explorers(None)
    async with editor(study, explorer=explorer) as found:
        await found.until(lambda: explorer.asked)
        await found.press("f")
        assert "explored" not in found.notice


def test_what_is_stale_says_so() -> None:
    assert explored_line([STUCK], stale="14:05")[0][0] == " ✗ explored (as saved at 14:05): "
    assert explored_line([], stale="14:05") == ()


@pytest.mark.parametrize("document", [b"", b"{", b"{}", b'{"explored": {"findings": 3}}'])
def test_an_answer_that_is_none(document: bytes) -> None:
    assert read_explored(document, "14:05") is None


@pytest.mark.slow
async def test_a_process_of_its_own_explores_what_is_saved(tmp_path: Path) -> None:
    folder = tmp_path / "quiz"
    shutil.copytree(QUIZ, folder)
    found = await explore_saved(str(folder))
    assert found is not None
    assert found.complete
    assert found.findings[0].text.startswith("Praise can come to a stand")
    assert found.findings[0].way[0].startswith("the wizard presses b")


@pytest.mark.slow
async def test_whoever_waits_no_more_ends_the_process(tmp_path: Path) -> None:
    task = asyncio.ensure_future(explore_saved(str(QUIZ)))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
