"""Before a session of a study: the next session, then the checks as one list. After it: only the checks.

Esc leaves at every step without any effect. One press of a key is one answer: a held key does not answer unread
questions.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import nullcontext
from functools import partial
from typing import ClassVar, Protocol

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from rise_engine.checks.outcome import CheckOutcome
from rise_engine.kernel.inputs import CheckReport
from rise_engine.study.model import StudyCheck
from rise_tui.model.check_list import CheckItem, CheckList
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, crop, wrap
from rise_tui.screens.dialog import SingleDismissModal, TitledBox
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import RowList, RowView, StaticLines

REPEAT_SECONDS = 0.7
"""Seconds. A key that repeats within this time is held down."""
INTRO_KEYS = "enter: {next} · esc: back, nothing starts"
CHECK_KEYS = "y yes · n no · r again · s skip · ↑↓ choose · esc back"


class CheckMaker(Protocol):
    """Makes the checks of one session."""

    async def make(self, check: StudyCheck) -> CheckOutcome:
        """Make a check. A check that needs an answer returns a question. Never raises."""

    def note(self, check: StudyCheck, report: CheckReport) -> None:
        """Write a result, without waiting."""


class ChecksScreen(SingleDismissModal[tuple[CheckReport, ...] | None]):
    """The result: the reports of all checks, when nothing blocks and Enter was pressed; None: the wizard left."""

    DEFAULT_CSS = """
    ChecksScreen {
        align: center middle; background: transparent;
        #box { width: 96; max-height: 95%; border-title-color: $foreground; }
        RowList { height: auto; max-height: 100%; min-height: 1; background: $panel; }
        #answer { height: auto; min-height: 1; margin: 1 0 0 0; background: $panel; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "leave", show=False)]

    def __init__(
        self,
        title: str,
        checks: CheckList,
        maker: CheckMaker,
        *,
        go: str,
        wizard: str,
        intro: Sequence[StyledLine] = (),
    ) -> None:
        """`go`: the final effect of Enter, such as `begin the session of P07 in REAL`. `wizard`: the person who
        answers, by the name in records. `intro`: the text before the checks."""
        super().__init__()
        self._title, self.checks, self._go, self._wizard = title, checks, go, wizard
        self._maker = maker
        self._intro = tuple(intro)
        self.is_intro = bool(intro)
        """Whether the checks have not begun."""
        self.list = RowList(id="check-rows")
        self.answer_line = StaticLines(id="answer")
        self.reason_bar = PromptBar("reason for skipping: ", "goes into the record; esc cancels")
        self._answer = ""
        """Why the last key had no effect; empty: it had one."""
        self._last_key, self._last_at = "", float("-inf")
        self._one_at_a_time = asyncio.Lock()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, " "):
            yield self.list
            yield self.answer_line
            yield self.reason_bar

    def on_mount(self) -> None:
        self.set_focus(self.list)
        if not self.is_intro:
            self._begin_checks()
        self.call_after_refresh(self._draw)

    # --- drawing ----------------------------------------------------------------------------------------------------

    @on(RowView.Resized)
    def _draw(self) -> None:
        width = self.list.row_width
        if width <= 0:
            return
        rows = self._intro_rows(width) if self.is_intro else self.checks.rows(width)
        self.list.styles.height = max(1, len(rows))
        self.list.show(rows)
        line, role = self._state_line()
        texts = wrap(line, max(20, width - 2))
        self.answer_line.styles.height = len(texts)
        self.answer_line.show(*(((f" {text}", role),) for text in texts))
        self.query_one("#box").border_subtitle = f" {self._keys()} "

    def _intro_rows(self, width: int) -> list[ListRow]:
        return [ListRow("", crop(line, width), selectable=False) for line in self._intro]

    def _state_line(self) -> tuple[str, TextRole]:
        if self._answer:
            return self._answer, "wait"
        if self.is_intro:
            count = len(self.checks.items)
            runs = f"enter runs {count} check{'s' * (count > 1)}"
            return (runs if count else f"enter: {self._go}"), "strong"
        if self.checks.obstacle:
            return self.checks.obstacle, "wait"
        return f"enter: {self._go}", "accent"

    def _keys(self) -> str:
        if self.is_intro:
            return INTRO_KEYS.format(next="run the checks" if self.checks.items else "begin")
        return CHECK_KEYS if self.checks.items else "esc: back, nothing starts"

    def say(self, sentence: str) -> None:
        """Show a sentence until the next key."""
        self._answer = sentence
        self._draw()

    # --- keys -------------------------------------------------------------------------------------------------------

    @property
    def _selected(self) -> CheckItem | None:
        return self.checks.find(self.list.current_id)

    def on_key(self, event: events.Key) -> None:
        if self.reason_bar.is_open or event.key not in ("enter", "y", "n", "r", "s"):
            return
        event.stop()
        event.prevent_default()
        is_held = event.key == self._last_key and event.time - self._last_at < REPEAT_SECONDS
        self._last_key, self._last_at = event.key, event.time
        if is_held:
            return
        self._answer = ""
        if event.key == "enter":
            self._go_on()
        elif not self.is_intro and (item := self._selected) is not None:
            self._carry_out(event.key, item)
        self._draw()

    def _go_on(self) -> None:
        if self.is_intro and self.checks.items:
            self.is_intro = False
            self._begin_checks()
        elif self.is_intro or not self.checks.obstacle:
            self.dismiss(self.checks.reports)
        else:
            self._select_open()
            self._answer = f"not yet: {self.checks.obstacle}"

    def _carry_out(self, key: str, item: CheckItem) -> None:
        if key in ("y", "n"):
            if not self.checks.answer(item, key == "y", self._wizard):
                self._answer = f"{item.check.id}: checked automatically; r checks again"
                return
            self._note(item)
            if key == "y":
                self._select_open()
        elif key == "r":
            self._begin(item)
        elif item.status == "passed":
            self._answer = f"{item.check.id} has passed: there is nothing to skip"
        elif problem := self.checks.why_not_skip(item, "a reason"):
            self._answer = problem
        else:
            self.reason_bar.open()

    def action_leave(self) -> None:
        """Handle Esc: leave, without any effect."""
        self.dismiss(None)

    # --- the checks -------------------------------------------------------------------------------------------------

    def _begin_checks(self) -> None:
        """Begin the checks. Questions appear immediately; automatic checks run one by one, in the order of the file."""
        for item in self.checks.items:
            if not item.is_kept:
                self._begin(item)
        self.call_after_refresh(self._select_open)

    def _begin(self, item: CheckItem) -> None:
        self.checks.reset(item)
        run: Callable[[], Awaitable[None]] = partial(self._run, item)
        self.run_worker(run, group=f"check-{item.check.id}", exclusive=True)

    async def _run(self, item: CheckItem) -> None:
        async with nullcontext() if item.check.ask else self._one_at_a_time:
            item.is_running = True
            self._draw()
            outcome = await self._maker.make(item.check)
        before = self._selected
        self.checks.finish(item, outcome)
        self._note(item)
        self._draw()
        if before is None or before.status in ("passed", "running", "waiting"):
            self._select_open()

    def _note(self, item: CheckItem) -> None:
        if (report := item.report) is not None:
            self._maker.note(item.check, report)

    def _select_open(self) -> None:
        """Put the cursor on the next check that waits for a person."""
        self._draw()
        at = next((at for at, item in enumerate(self.checks.items) if item is self._selected), 0)
        if (index := self.checks.first_open(at)) is not None:
            self.list.select(self.checks.items[index].check.id)

    # --- skipping ---------------------------------------------------------------------------------------------------

    @on(PromptBar.Edited)
    def _reason_edited(self, event: PromptBar.Edited) -> None:
        event.stop()

    @on(PromptBar.Accepted)
    def _skip(self, event: PromptBar.Accepted) -> None:
        event.stop()
        reason, item = self.reason_bar.text.strip(), self._selected
        if item is not None and (problem := self.checks.why_not_skip(item, reason)):
            self.say(problem)
            return
        if item is not None:
            self.checks.skip(item, reason, self._wizard)
            self._note(item)
        self._close_reason()
        self._select_open()

    @on(PromptBar.Cancelled)
    def _keep(self, event: PromptBar.Cancelled) -> None:
        event.stop()
        self._close_reason()

    def _close_reason(self) -> None:
        self._answer = ""
        self.reason_bar.close()
        self.set_focus(self.list)
        self._draw()
