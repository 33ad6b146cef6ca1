"""A trial on the screen: the study's keys, time, a step back, what happened and why."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from textual.pilot import Pilot

from rise_engine.author.trial.trial import Trial
from rise_engine.author.trial.trial_history import history_lines
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_tui.editor.model.trial_rows import (
    GO_ON,
    begin,
    clock_text,
    head_lines,
    history_rows,
    play_again,
    trial_rows,
)
from rise_tui.editor.trial_view import TrialView
from rise_tui.rendering.text import line_width, plain_text
from tests.tui.editor.pages import PageApp, settle

SCENARIOS = Path(__file__).parents[3] / "scenarios"
RULE = "Table setting"


@cache
def lablinking() -> Scenario:
    scenario = load(str(SCENARIOS / "lablinking")).scenario
    assert scenario is not None
    return scenario


def begun() -> Trial:
    trial = Trial(lablinking())
    begin(trial, RULE)
    return trial


def rows_of(trial: Trial, width: int = 78) -> list[str]:
    rows = trial_rows(trial, RULE, width)
    assert all(line_width(row.line) <= width for row in rows)
    return [plain_text(row.line).rstrip() for row in rows]


def test_it_says_where_the_rule_stands_and_what_it_waits_for() -> None:
    trial = begun()
    first, second = (plain_text(line) for line in head_lines(trial, RULE, 80))
    assert "no robot, no record" in first and first.rstrip().endswith("00:00")
    assert second.startswith(" Table setting  in Welcome   from Start")
    rows = rows_of(trial)
    assert rows[0].strip() == "let time pass until something waits"
    assert "says “Hello, and welcome!" in rows[1]
    assert rows[3].strip().startswith("1 R_Welcome ended → After the welcome")
    trial.go_on()
    rows = rows_of(trial)
    assert rows[0].strip() == "nothing happens by itself: it waits for you"
    ids = [row.id for row in trial_rows(trial, RULE, 78)]
    assert ids[0] == GO_ON and f"way:0:{RULE}" in ids and "key:n" in ids
    assert any(row.strip().startswith("1 next → Task 1, introduction") and row.endswith("key n") for row in rows)
    assert ids.index("key:n") < rows.index(" OTHER KEYS OF THE STUDY")


def test_it_begins_with_the_key_of_the_study_or_in_the_state_that_is_asked_for() -> None:
    assert begun().steps[0].key == "t"
    trial = Trial(lablinking())
    begin(trial, RULE, "Task 1, step 2")
    assert "in Task 1, step 2" in plain_text(head_lines(trial, RULE, 80)[1])
    begin(trial, "no such rule")
    assert len(trial.steps) == 1


def test_what_happened_is_told_with_its_time_and_its_key() -> None:
    trial = begun()
    trial.go_on()
    rows = [plain_text(row.line) for row in history_rows(history_lines(trial), 60)]
    assert rows[0].startswith(" 00:00 key t")
    assert any("Welcome → After the welcome" in row for row in rows)
    assert max(map(len, rows)) <= 60
    assert clock_text(3725) == "1:02:05"


def test_what_was_done_is_done_again_when_the_study_has_changed() -> None:
    trial = begun()
    trial.go_on()
    trial.set_value("step = 3")
    trial.pass_time(2)
    again = Trial(replace(lablinking(), title="another"))
    play_again(trial.steps, again)
    assert [(step.kind, step.key, step.seconds) for step in again.steps] == [
        (step.kind, step.key, step.seconds) for step in trial.steps
    ]
    assert (again.now, again.memory["step"]) == (trial.now, 3)


@asynccontextmanager
async def played(size: tuple[int, int] = (80, 24)) -> AsyncIterator[tuple[Pilot[Any], TrialView]]:
    view = TrialView()
    async with PageApp(view).run_test(size=size) as pilot:
        view.play(lablinking(), RULE)
        await settle(pilot)
        view.rows.focus()
        yield pilot, view


@pytest.mark.slow
async def test_keys_play_the_study() -> None:
    async with played() as (pilot, view):

        async def press(key: str) -> str:
            await pilot.press(key)
            await settle(pilot)
            return view.head.text

        assert "in Welcome" in view.head.text
        assert "in After the welcome" in await press("enter")
        assert "in Task 1, introduction" in await press("n")
        assert "in After the welcome" in await press("left")
        assert view.trial is not None and len(view.trial.steps) == 2
        for key in ("down", "down"):
            await press(key)
        assert view.rows.current_id == f"way:1:{RULE}"
        assert "in Welcome" in await press("enter"), "the way's key was pressed"
        assert view.rows.cursor == 0, "the next enter lets time go on"
        assert "from Start" in await press("home")
        assert len(view.trial.steps) == 1


@pytest.mark.slow
async def test_a_value_is_set_and_the_steps_are_kept() -> None:
    kept: list[Trial] = []

    class Keeping(PageApp):
        def on_trial_view_keep_asked(self, event: TrialView.KeepAsked) -> None:
            kept.append(event.trial)

    view = TrialView()
    async with Keeping(view).run_test(size=(120, 40)) as pilot:
        view.play(lablinking(), RULE)
        await settle(pilot)
        view.rows.focus()
        index = next(at for at in range(view.rows.count) if view.rows.row_at(at).id == "set:study_finished")
        view.rows.move_cursor(index)
        await pilot.press("enter")
        await pilot.pause()
        assert view.value_bar.is_open and view.value_bar.text == "study_finished = false"
        await pilot.press(*["backspace"] * 5, *"true", "enter")
        await settle(pilot)
        assert view.trial is not None and view.trial.memory["study_finished"] is True
        await pilot.press("ctrl+k")
        await pilot.pause()
        assert kept == [view.trial]
        changed = replace(lablinking(), hash="another")
        view.play_changed(changed)
        await settle(pilot)
        assert view.trial.scenario.hash == "another" and view.trial.memory["study_finished"] is True
