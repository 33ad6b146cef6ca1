"""The page of a rule: its editor, and its trial run, beside it if there is room."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.widget import Widget

from rise_engine.author.edit.edits import ReplaceFile
from rise_engine.author.edit.outline import Written
from rise_engine.author.trial.study_test_run import path_of_test, text_of_test
from rise_engine.author.trial.trial import Trial
from rise_tui.editor.model.draft import FilePlace
from rise_tui.editor.model.trial_rows import find_running_rule
from rise_tui.editor.page import EditFrame
from rise_tui.editor.rule_display import RuleHost
from rise_tui.editor.rule_editor import RuleEditor
from rise_tui.editor.trial_view import TrialView
from rise_tui.widgets.lines import RowList

MIN_TRIAL_COLUMNS = 100
"""Minimum columns for a trial run beside the rule. In a narrower terminal it replaces the rule."""


class RulePage(RuleHost):
    """One rule. `t` tries it, `esc` leads back from the trial run."""

    KIND: ClassVar[str] = "rule"
    CAN_FILTER = True
    EXPECTED = ("no-effect",)
    DEFAULT_CSS = """
    RulePage TrialView { display: none; }
    RulePage.-trying TrialView { display: block; }
    RulePage.-trying RuleEditor { display: none; }
    RulePage.-trying.-beside RuleEditor { display: block; width: 1fr; }
    RulePage.-trying.-beside TrialView { border-left: solid $rise-muted; }
    """

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        """`name`: the rule; after a zero character, the first state of the cursor."""
        rule, _, state = name.partition("\0")
        super().__init__(frame, rule)
        self.editor, self.trial = RuleEditor(self, rule, state), TrialView()

    def compose(self) -> ComposeResult:
        with Horizontal():
            yield self.editor
            yield self.trial

    @property
    def first_focus(self) -> Widget | None:
        return self.trial.rows if self.is_trying and not self._fits_beside else self.editor.graph

    @property
    def shown_state(self) -> str:
        return self.editor.shown_state

    @property
    def content_exists(self) -> bool:
        return self.draft.outline.rule(self.shown_name) is not None

    @property
    def is_typing(self) -> bool:
        return self.editor.is_typing or self.trial.value_bar.is_open

    @property
    def hints(self) -> Mapping[str, str]:
        return {} if self._in_trial else self.editor.hints

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        return self.trial.hints() if self._in_trial else ()

    @property
    def place(self) -> FilePlace | None:
        rule, state, spot = self.editor.rule, self.editor.state, self.editor.spot
        if rule is None:
            return None
        if state is None or spot is None:
            return _lines_of(rule)
        if 0 <= spot.transition < len(state.transitions):
            return _lines_of(state.transitions[spot.transition])
        return _lines_of(state)

    def draw(self) -> None:
        self._place_trial()
        self.editor.redraw()
        scenario = self.draft.checked.scenario
        if self.is_trying and scenario is not None:
            self.trial.play_changed(scenario)
        self.trial.redraw()

    def filter(self, text: str) -> None:
        self.editor.find(text)

    def leave(self) -> bool:
        if self.is_trying:
            self._close_trial()
            return True
        return False

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        return {**({} if self._in_trial else self.editor.calls), "edit.other": self._go_to_next_list}

    def _go_to_next_list(self) -> None:
        lists: list[RowList] = []
        if not self.is_trying or self._fits_beside:
            lists += [self.editor.graph, self.editor.parts]
        if self.is_trying:
            lists += [self.trial.rows, self.trial.lines]
        at = next((index for index, each in enumerate(lists) if each.has_focus), -1)
        lists[(at + 1) % len(lists)].focus()

    # --- the trial ---

    @property
    def is_trying(self) -> bool:
        return self.has_class("-trying")

    @property
    def _in_trial(self) -> bool:
        return self.is_trying and self.trial.has_focus_within

    @property
    def _fits_beside(self) -> bool:
        return self.app.size.width >= MIN_TRIAL_COLUMNS

    def try_rule(self, rule: str, state: str) -> None:
        scenario = self.draft.checked.scenario
        if scenario is None:
            error = next((each for each in self.draft.findings if each.severity == "error"), None)
            what = f": {error.message}" if error is not None else ""
            self.frame.say(f"fix the error first{what}", "wait")
            return
        self.add_class("-trying")
        self.hide_list(self._fits_beside)
        self._place_trial()
        self.trial.play(scenario, rule, state)
        self.trial.rows.focus()
        self.frame.draw_bars()

    def _close_trial(self) -> None:
        self.remove_class("-trying", "-beside")
        self.hide_list(False)
        self.editor.graph.focus()

    def _place_trial(self) -> None:
        """Place the trial run. Beside the rule it needs no graph: the cursor in the rule's graph follows it."""
        beside = self.is_trying and self._fits_beside
        self.set_class(beside, "-beside")
        self.trial.set_class(beside, "-beside")

    def on_unmount(self) -> None:
        self.hide_list(False)

    @on(TrialView.Played)
    def _played(self, event: TrialView.Played) -> None:
        event.stop()
        running = find_running_rule(self.trial.trial, self.shown_name) if self.trial.trial is not None else None
        if self._fits_beside and running is not None and running.name == self.shown_name:
            self.editor.go_to_state(running.state)
        self.frame.say(event.problem, "wait" if event.problem else "info")
        self.frame.draw_bars()

    @on(TrialView.KeepAsked)
    def _ask_to_keep(self, event: TrialView.KeepAsked) -> None:
        event.stop()
        hint = "What it tests, in a few words. `rise-engine test` runs it."
        self.frame.ask_text("Save these steps as a test", "", lambda title: self._keep(event.trial, title), hint=hint)

    def _keep(self, trial: Trial, title: str) -> None:
        self.run_worker(self._write_test(trial, title), group="keep")

    async def _write_test(self, trial: Trial, title: str) -> None:
        text = await asyncio.to_thread(text_of_test, trial, title)
        folder = Path(self.draft.folder)
        file = path_of_test(folder, title).relative_to(folder).as_posix()
        self.make(ReplaceFile(file, text), then=lambda: self.frame.say(f"new file: {file}"))


def _lines_of(written: Written) -> FilePlace:
    return FilePlace(written.file, written.line, written.last_line)
