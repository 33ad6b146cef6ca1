"""The trial run on the screen: the rule in its graph, the possible actions, the events and their reasons.

The study's own keys have their effects of a session. Everything else has a key that no study can have
(`rise_engine.scenario.keys.CONSOLE_KEYS`): Enter, ←, Home, Space, ctrl+k.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message

from rise_engine.author.drawing.state_graph import GraphLayout, lay_out_graph
from rise_engine.author.trial.trial import Trial
from rise_engine.author.trial.trial_history import history_lines
from rise_engine.scenario.model import Rule, Scenario
from rise_tui.editor.model.trial_rows import (
    GO_ON,
    begin,
    find_running_rule,
    head_lines,
    history_rows,
    key_of,
    play_again,
    trial_rows,
)
from rise_tui.model.states import HERE, GraphPosition, draw_state_graph
from rise_tui.rendering.text import ListRow
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import RowList, RowView, StaticLines

ROWS_AHEAD = 3
"""Rows of the graph below the present state that should be visible with it."""


class TrialView(Vertical):
    """Runs a scenario (`play`) in a thread. Its rows are made again after each step."""

    DEFAULT_CSS = """
    TrialView { height: 1fr; width: 1fr; }
    TrialView #trial-head { height: 2; }
    TrialView #trial-graph { height: 1fr; min-height: 3; }
    TrialView #trial-rows { height: 2fr; min-height: 4; }
    TrialView #trial-happened { height: 1fr; min-height: 3; }
    TrialView.-beside #trial-graph { display: none; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "carry_on", show=False),
        Binding("space", "cue", show=False),
        Binding("ctrl+k", "keep", show=False),
    ]

    @dataclass
    class KeepAsked(Message):
        """Save the steps as a test of the study."""

        trial: Trial

    @dataclass
    class Played(Message):
        """A step was made or taken back. `problem`: why not, or a remark."""

        problem: str

    def __init__(self) -> None:
        super().__init__(id="trial")
        self.trial: Trial | None = None
        self._scenario: Scenario | None = None
        self._rule, self._state = "", ""
        self._turn = asyncio.Lock()
        self._layout: tuple[Rule, int, GraphLayout] | None = None
        self.head = StaticLines(id="trial-head")
        self.heading = StaticLines()
        self.graph = RowList(id="trial-graph")
        self.graph.can_focus = False
        self.rows, self.lines = RowList(id="trial-rows"), RowList(id="trial-happened")
        self.value_bar = PromptBar("set ", "key = value; enter sets it, esc leaves")

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.graph
        yield self.rows
        yield self.heading
        yield self.lines
        yield self.value_bar

    # --- running ---

    def play(self, scenario: Scenario, rule: str, state: str = "") -> None:
        """Begin with a rule, in the named state or its first."""
        self._scenario, self._rule, self._state = scenario, rule, state
        self._queue_job(lambda: self._begin(scenario))

    def play_changed(self, scenario: Scenario) -> None:
        """Repeat the steps in the changed study."""
        before = self.trial
        if before is None or self._scenario is None or scenario.hash == self._scenario.hash:
            return
        self._scenario = scenario

        def again() -> None:
            trial = Trial(scenario)
            play_again(before.steps, trial)
            self.trial = trial

        self._queue_job(again)

    def _begin(self, scenario: Scenario) -> None:
        trial = Trial(scenario)
        begin(trial, self._rule, self._state)
        self.trial = trial

    def _queue_job(self, work: Callable[[], object]) -> None:
        """Do one job after the other in a thread, because a rule in a loop takes long."""
        self.run_worker(self._do(work), group="trial")

    async def _do(self, work: Callable[[], object]) -> None:
        async with self._turn:
            await asyncio.to_thread(work)
            self.redraw()
            self.rows.move_cursor(0, by_wizard=False)
            self.post_message(self.Played(self.trial.problem if self.trial is not None else ""))

    def _with_trial(self, work: Callable[[Trial], object]) -> None:
        trial = self.trial
        if trial is not None:
            self._queue_job(lambda: work(trial))

    # --- drawing ---

    def redraw(self) -> None:
        """Show the state of the trial run."""
        trial, width = self.trial, self.rows.row_width
        if trial is None or width <= 0:
            return
        self.head.show(*head_lines(trial, self._rule, width))
        self._draw_graph(trial)
        self.rows.show(trial_rows(trial, self._rule, width))
        self.heading.show(((" WHAT HAPPENED, AND WHY", "strong"),))
        rows = history_rows(history_lines(trial), self.lines.row_width)
        self.lines.show(rows or [ListRow("", ((" nothing yet", "muted"),), selectable=False)])
        self.lines.scroll_to(y=max(0, len(rows) - self.lines.size.height), animate=False)

    def _draw_graph(self, trial: Trial) -> None:
        width = self.graph.row_width
        running = find_running_rule(trial, self._rule)
        rule = trial.scenario.rules.get(running.name if running is not None else self._rule)
        if rule is None or width <= 0:
            return
        if self._layout is None or self._layout[:2] != (rule, width):
            self._layout = (rule, width, lay_out_graph(rule, width))
        position = GraphPosition()
        if running is not None:
            taken = None if running.transition is None else (running.previous or "", running.transition)
            position = GraphPosition(running.state, taken)
        rows = draw_state_graph(self._layout[2], position)
        self.graph.show(rows)
        here = next((index for index, row in enumerate(rows) if row.id.startswith(f"{HERE}:")), 0)
        top, height = self.graph.scroll_offset.y, self.graph.size.height
        if not top <= here <= here + ROWS_AHEAD < top + height:
            self.graph.scroll_to(y=max(0, here - max(0, (height - ROWS_AHEAD) // 2)), animate=False)

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self.redraw()

    def hints(self) -> tuple[tuple[str, str], ...]:
        """The keys of the trial run."""
        if self.value_bar.is_open:
            return (("enter", "sets it"), ("esc", "as it was"))
        return (
            ("enter", "continue, or do this"), ("←", "a step back"), ("^K", "save as a test"),
            ("home", "from the start"), ("space", "the cue"),
        )  # fmt: skip

    # --- keys ---

    def on_key(self, event: events.Key) -> None:
        """Handle a key of the study before a list takes it."""
        trial = self.trial
        if trial is None or self.value_bar.is_open:
            return
        if event.key in ("left", "home") and self.rows.has_focus:
            event.stop()
            event.prevent_default()
            (self.action_back if event.key == "left" else self.action_restart)()
            return
        key = key_of(trial.scenario, event.key)
        if key is not None:
            event.stop()
            event.prevent_default()
            self._with_trial(lambda trial: trial.press(key))

    def action_carry_on(self) -> None:
        trial = self.trial
        if trial is None or self.value_bar.is_open:
            return
        kind, _, rest = (self.rows.current_id if self.rows.has_focus else GO_ON).partition(":")
        match kind:
            case "way":
                number, _, rule = rest.partition(":")
                self._take_transition(trial, rule, int(number))
            case "key":
                key = trial.scenario.keys[rest]
                self._with_trial(lambda trial: trial.press(key))
            case "event":
                self._with_trial(lambda trial: trial.raise_event(rest))
            case "set":
                self._ask_value(trial, rest)
            case _:
                self._with_trial(lambda trial: trial.go_on())

    def _take_transition(self, trial: Trial, rule: str, number: int) -> None:
        """Make the rule take a transition: press its key, raise its event, or let time pass."""
        running = find_running_rule(trial, rule)
        transition = (
            next((transition for transition in running.transitions if transition.index == number), None)
            if running is not None
            else None
        )
        if transition is None:
            return
        if transition.keys:
            key = transition.keys[0]
            self._with_trial(lambda trial: trial.press(key))
        elif transition.event:
            event = transition.event
            self._with_trial(lambda trial: trial.raise_event(event))
        else:
            self._with_trial(lambda trial: trial.go_on())

    def _ask_value(self, trial: Trial, key: str) -> None:
        value: Any = trial.memory.get(key)
        written = (
            repr(value) if isinstance(value, str) else {True: "true", False: "false", None: "null"}.get(value, value)
        )
        self.value_bar.open(f"{key} = {written}" if key in trial.memory else f"{key} = ")

    @on(PromptBar.Accepted)
    def _value_given(self, event: PromptBar.Accepted) -> None:
        event.stop()
        text = self.value_bar.text.strip()
        self.value_bar.close()
        self.rows.focus()
        if text:
            self._with_trial(lambda trial: trial.set_value(text))

    @on(PromptBar.Cancelled)
    def _value_left(self, event: PromptBar.Cancelled) -> None:
        event.stop()
        self.value_bar.close()
        self.rows.focus()

    def action_back(self) -> None:
        self._with_trial(lambda trial: trial.back())

    def action_restart(self) -> None:
        scenario = self._scenario
        if scenario is not None:
            self._queue_job(lambda: self._begin(scenario))

    def action_cue(self) -> None:
        self._with_trial(lambda trial: trial.mark_cue())

    def action_keep(self) -> None:
        if self.trial is not None and self.trial.steps:
            self.post_message(self.KeepAsked(self.trial))
