"""What exploring has found stands beside the states, and in the list of what is wrong."""

from __future__ import annotations

import asyncio
import os
import shutil
from asyncio.subprocess import Process
from pathlib import Path
from typing import Any

import pytest

from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.dialogs import PickList
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.page import FindingLine
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.study import (
    ExploredPlace,
    ExploredStudy,
    explore_saved,
    find_explored,
    findings_in_rules,
    read_explored,
)
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.lines import RowList
from tests.tui.editor.conftest import Editor, editor

QUIZ = Path(__file__).parents[2] / "author" / "explore" / "studies" / "quiz"
RULE = "rules/greeting.xml"
STUCK = ExploredPlace(
    "problem",
    "Greeting can get stuck in Nobody",
    RULE,
    14,
    3,
    rule="Greeting",
    state="Nobody",
    way=("the wizard presses b (begin) → Greeting begins in Start, at once to Nobody", "10 s pass in Nobody"),
)
NOT_TAKEN = ExploredPlace(
    "warning", "Greeting never goes to Closed", RULE, 16, 5, rule="Greeting", state="Nobody", way=("x is pressed",)
)
ALIKE = ExploredPlace("warning", "R_Nod may as well fail", "acts/signs.xml", 1, rule="Greeting", act="R_Nod")
IDLE = ExploredPlace("warning", "the key x never does anything", "scenario.toml", 9, key="x")
FOUND = ExploredStudy((STUCK, ALIKE, IDLE), 1_266, True, "14:05")
MENDED = ExploredStudy((), 1_300, True, "14:09")


class Explorers:
    """An explorer that finds what a test says, when the test says, and remembers who asked."""

    def __init__(self, found: ExploredStudy | None) -> None:
        self.found, self.asked, self.ended = found, 0, 0
        self.may_answer = asyncio.Event()
        self.may_answer.set()

    async def __call__(self, folder: str) -> ExploredStudy | None:
        self.asked += 1
        try:
            await self.may_answer.wait()
        except asyncio.CancelledError:
            self.ended += 1
            raise
        return self.found


def bottom(it: Editor) -> str:
    """The line of what is wrong."""
    return it.screen.query_one(FindingLine).text


def shown_rule(it: Editor) -> tuple[str, str]:
    """What is drawn of the rule: the graph's rows, and the line over the state's parts."""
    page = it.screen.opened
    assert isinstance(page, RulePage)
    graph = page.editor.graph
    rows = ["".join(text for text, _ in graph.row_at(index).line) for index in range(graph.count)]
    return "\n".join(rows), page.editor.state_heading.text


def on_a_state(it: Editor, state: str) -> bool:
    return isinstance(it.screen.opened, RulePage) and it.screen.opened.shown_state == state


async def open_list(it: Editor) -> PickList:
    await it.press("f")
    found = await it.shows(PickList)
    await it.until(lambda: found.list.count)
    return found


def texts_of(rows: RowList) -> list[str]:
    return ["".join(text for text, _ in rows.row_at(index).line) for index in range(rows.count)]


async def add_a_state(it: Editor) -> None:
    """A change that is not saved."""
    await it.open("rule", "Gaze")
    await it.press("n")
    await it.type("Added")
    await it.press("enter")
    await it.until(lambda: it.screen.study.draft.changed_files)


# --- what is shown ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_finding_stands_beside_its_state_its_act_and_its_key(study: Path) -> None:
    found = ExploredStudy((STUCK, NOT_TAKEN, ALIKE, IDLE), 1_266, True, "14:05")
    async with editor(study, explorer=Explorers(found)) as it:
        await it.until(lambda: "explored" in bottom(it))
        assert bottom(it).strip() == "explored 1,266 situations: 1 problem and 3 warnings  f all 4"
        assert "explored" not in it.notice, "it is in nobody's way"
        await it.open("rule", "Greeting\0Nobody")
        await it.until(lambda: on_a_state(it, "Nobody"))
        graph, heading = shown_rule(it)
        marked = [row for row in graph.splitlines() if row[0] in "✗▲"]
        assert [row[0] for row in marked] == ["✗", "▲"]
        assert "Nobody" in marked[0] and "W_close" in marked[1]
        assert heading.startswith("── Nobody ──  ✗ explored: Greeting can get stuck")
        assert bottom(it).startswith(" ✗ explored: Greeting can get stuck")
        await it.open("rule", "Gaze")
        assert not any(row[0] in "✗▲" for row in shown_rule(it)[0].splitlines())
        assert bottom(it).startswith(" explored 1,266 situations")
        await it.open("rule", "Greeting")
        await it.until(lambda: on_a_state(it, "Start"))
        assert bottom(it).startswith(" ▲ explored: R_Nod may as well fail"), "what is about the whole rule comes first"
        assert "explored" not in shown_rule(it)[1]
        await it.open("act", "R_Nod")
        assert bottom(it).startswith(" ▲ explored: R_Nod may as well fail")
        await it.open("keys")
        assert bottom(it).startswith(" ▲ explored: the key x never does anything")


@pytest.mark.slow
async def test_the_list_leads_to_the_state_the_act_the_key_and_shows_every_step(study: Path) -> None:
    async with editor(study, explorer=Explorers(FOUND)) as it:
        await it.until(lambda: it.screen.explored.at)
        for down, opened in enumerate((("rule", "Greeting", "Nobody"), ("act", "R_Nod", ""), ("keys", "", ""))):
            await open_list(it)
            await it.press(*["down"] * down, "enter")
            await it.until(lambda: it.screen.opened is not None)

            def shown() -> tuple[str, str, str]:
                page = it.screen.page
                return page.KIND, page.shown_name, page.shown_state

            await it.until(lambda opened=opened: shown() == opened)  # type: ignore[misc]
        await it.go_home()
        listed = await open_list(it)
        assert "tab step by step" in str(listed.query_one("#box").border_subtitle)
        await it.press("down")
        assert "tab" not in str(listed.query_one("#box").border_subtitle)
        await it.press("tab")
        assert it.pilot.app.screen is listed
        await it.press("up", "tab")
        way = await it.shows(DetailScreen)
        await it.until(lambda: way.list.count)
        text = " ".join(" ".join(texts_of(way.list)).split())
        assert text == f"{STUCK.text} HOW A SESSION GETS THERE 1. {STUCK.way[0]} 2. {STUCK.way[1]}"
        await it.press("escape")
        again = await it.shows(PickList)
        assert again is not listed and again.list.current_id == "0"


@pytest.mark.slow
async def test_the_list_has_it_after_what_the_check_has_found(study: Path) -> None:
    text = (study / RULE).read_text()
    (study / RULE).write_text(text.replace('eventTopic="/W_close"', 'eventTopic="/W_clse"', 1))
    async with editor(study, explorer=Explorers(FOUND)) as it:
        await it.until(lambda: it.screen.explored.at)
        listed = await open_list(it)
        checked = len(it.screen.study.draft.findings)
        assert checked
        assert ["explored:" in text for text in texts_of(listed.list)] == [False] * checked + [True] * 3
        assert listed.query_one("#box").border_title == " What is wrong · explored 1,266 situations "


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (MENDED, "explored 1,300 situations: no problem found"),
        (None, "could not be explored: `rise-engine explore` says why"),
    ],
)
async def test_what_is_said_when_nothing_was_found(study: Path, found: ExploredStudy | None, said: str) -> None:
    async with editor(study, explorer=Explorers(found)) as it:
        await it.until(lambda: said in bottom(it))


# --- of when it is ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_it_says_of_when_it_is_until_the_change_is_undone_or_it_is_explored_again(study: Path) -> None:
    explorer = Explorers(FOUND)
    async with editor(study, explorer=explorer) as it:
        await it.until(lambda: it.screen.explored.at)
        await add_a_state(it)
        await it.open("rule", "Greeting\0Nobody")
        await it.until(lambda: "explored (as saved at 14:05): Greeting can get stuck" in shown_rule(it)[1])
        listed = await open_list(it)
        assert listed.query_one("#box").border_title == (
            " What is wrong · explored 1,266 situations (as saved at 14:05) "
        )
        await it.press("escape", "ctrl+u")
        await it.until(lambda: "explored: Greeting can get stuck" in shown_rule(it)[1])
        await add_a_state(it)
        explorer.found = MENDED
        explorer.may_answer.clear()
        await it.press("ctrl+o", "enter")
        await it.until(lambda: explorer.asked == 2)
        await it.until(lambda: not it.screen.study.busy and "saved" in it.notice)
        await it.open("rule", "Greeting\0Nobody")
        await it.until(lambda: "exploring again (as saved at 14:05): Greeting can" in shown_rule(it)[1])
        explorer.may_answer.set()
        await it.until(lambda: "explor" not in shown_rule(it)[1])
        assert it.screen.explored.at == "14:09"
        assert "saved" in it.notice


@pytest.mark.slow
async def test_what_somebody_else_has_saved_is_explored_and_errors_are_not(study: Path) -> None:
    explorer = Explorers(FOUND)
    text = (study / RULE).read_text()
    wrong = text.replace('target="Nobody"', 'target="Nobod"', 1)
    (study / RULE).write_text(wrong)
    async with editor(study, explorer=explorer) as it:
        assert it.screen.study.draft.checked.errors
        await it.press("down")
        assert explorer.asked == 0
        assert "explored" not in bottom(it)
        (study / RULE).write_text(text)
        it.screen.check_disk_changes()
        await it.until(lambda: it.screen.explored.at and explorer.asked == 1)
        (study / RULE).write_text(f"{text}\n")
        it.screen.check_disk_changes()
        await it.until(lambda: explorer.asked == 2)
        (study / RULE).write_text(wrong)
        it.screen.check_disk_changes()
        await it.until(lambda: it.screen.study.draft.checked.errors)
        await it.until(lambda: "read again" in it.notice)
        await it.open("rule", "Greeting\0Nobody")
        await it.until(lambda: "explored (as saved at 14:05): Greeting can" in shown_rule(it)[1])
        assert explorer.asked == 2


async def test_the_next_save_and_the_end_of_the_editor_end_it(study: Path) -> None:
    explorer = Explorers(FOUND)
    explorer.may_answer.clear()
    async with editor(study, explorer=explorer) as it:
        await it.until(lambda: explorer.asked == 1)
        await add_a_state(it)
        await it.press("ctrl+o", "enter")
        await it.until(lambda: explorer.asked == 2 and explorer.ended == 1)
    assert explorer.ended == 2


def draft_with(study: Path, old: str, new: str) -> StudyDraft:
    text = (study / RULE).read_text()
    assert old in text
    (study / RULE).write_text(text.replace(old, new, 1))
    return draft_of(Workspace(study))


def test_a_place_is_found_by_names_when_its_lines_have_moved(study: Path) -> None:
    draft = draft_with(study, "<!-- The main rule", "\n\n\n<!-- The main rule")
    assert not FOUND.is_of(draft)
    places = [(each.severity, each.location.line, each.location.column) for each in findings_in_rules(FOUND, draft)]
    assert places == [("error", 17, 3)]
    assert find_explored(draft, STUCK) == ("rule", "Greeting\0Nobody")


def test_what_is_not_there_any_more_has_no_place(study: Path) -> None:
    draft = draft_with(study, 'name="Greeting"', 'name="Welcome"')
    assert findings_in_rules(FOUND, draft) == []
    assert find_explored(draft, STUCK) is None


# --- the process ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("document", [b"", b"{", b"{}", b'{"explored": {"findings": 3}}'])
def test_an_answer_that_is_none(document: bytes) -> None:
    assert read_explored(document, "14:05") is None


@pytest.mark.slow
async def test_a_process_of_its_own_explores_what_is_saved(tmp_path: Path) -> None:
    folder = tmp_path / "quiz"
    shutil.copytree(QUIZ, folder)
    found = await explore_saved(str(folder), after=0)
    assert found is not None
    assert found.complete
    assert found.findings[0].text.startswith("Praise can get stuck")
    assert found.findings[0].way[0].startswith("the wizard presses b")


@pytest.mark.slow
async def test_whoever_waits_no_more_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: asyncio.Queue[Process] = asyncio.Queue()
    begin = asyncio.create_subprocess_exec

    async def begin_and_tell(*arguments: Any, **options: Any) -> Process:
        process = await begin(*arguments, **options)
        begun.put_nowait(process)
        return process

    monkeypatch.setattr(asyncio, "create_subprocess_exec", begin_and_tell)
    task = asyncio.ensure_future(explore_saved(str(QUIZ), after=0))
    process = await begun.get()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)
