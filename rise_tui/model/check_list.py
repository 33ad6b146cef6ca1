"""The checks around a session as one list: questions, running checks, results, and obstacles to the session. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.checks.outcome import CheckOutcome, answer_check, kept_check, skipped_check
from rise_engine.checks.runner import report_check
from rise_engine.kernel.inputs import CheckReport
from rise_engine.study.checks import PendingCheck, check_text, skip_problem
from rise_engine.study.model import Purpose, StudyCheck
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, cell_width, crop, fit, fixed_span, wrap

CheckStatus: TypeAlias = Literal["waiting", "asked", "running", "passed", "failed", "skipped"]
STATUS_WORDS: dict[CheckStatus, tuple[str, TextRole]] = {
    "waiting": ("○ waiting", "muted"),
    "asked": ("? y or n", "wait"),
    "running": ("◌ running", "accent"),
    "passed": ("✓ passed", "plain"),
    "failed": ("✗ failed", "fault"),
    "skipped": ("- skipped", "wait"),
}
STATUS_WIDTH = 10


class CheckItem(Struct):
    """One check and its state."""

    check: StudyCheck
    outcome: CheckOutcome | None = None
    """None: it runs, or has not begun."""
    is_running: bool = False
    by: str = "engine"
    """The person who answered or skipped it; otherwise the program."""
    is_kept: bool = False
    """Whether it was made recently and is still valid."""

    @property
    def status(self) -> CheckStatus:
        if self.outcome is not None:
            return self.outcome.result
        return "running" if self.is_running else "waiting"

    @property
    def report(self) -> CheckReport | None:
        """The report for the session; None while the check runs or waits for an answer."""
        if self.outcome is None or self.outcome.result == "asked":
            return None
        return report_check(self.outcome, self.by)


class CheckList:
    """All checks before a session, or all after it."""

    def __init__(self, pending: Sequence[PendingCheck], purpose: Purpose, *, binding: bool) -> None:
        """`binding`: whether a failed check that blocks prevents going on."""
        self.items = [
            CheckItem(each.check, kept_check(each) if each.good_since else None, is_kept=bool(each.good_since))
            for each in pending
        ]
        self._purpose, self._binding = purpose, binding

    def find(self, id: str) -> CheckItem | None:
        """The check with this id."""
        return next((item for item in self.items if item.check.id == id), None)

    def reset(self, item: CheckItem) -> None:
        """Make the check, for the first time or again."""
        item.outcome, item.by, item.is_kept = None, "engine", False

    def finish(self, item: CheckItem, outcome: CheckOutcome) -> None:
        """Set the result of a check."""
        item.outcome, item.is_running = outcome, False

    def answer(self, item: CheckItem, yes: bool, by: str) -> bool:
        """Answer a check, or change an answer; False: there is no question."""
        outcome = item.outcome
        if outcome is None or (outcome.result != "asked" and not item.check.ask):
            return False
        if outcome.result != "asked":  # already answered
            outcome = CheckOutcome(item.check.id, item.check.ask, "asked", question=item.check.ask)
        item.outcome, item.by = answer_check(outcome, yes), by
        return True

    def why_not_skip(self, item: CheckItem, reason: str) -> str:
        """Why a check cannot be skipped for that reason; empty: it can."""
        return skip_problem(item.check, self._purpose, reason)

    def skip(self, item: CheckItem, reason: str, by: str) -> None:
        """Skip a check, with a reason."""
        item.outcome, item.by = skipped_check(item.check, reason, item.outcome), by

    def first_open(self, start: int = 0) -> int | None:
        """The first item from `start` that needs a person's answer or look."""
        count = len(self.items)
        order = [(start + step) % count for step in range(count)]
        return next((at for at in order if self._is_open(self.items[at])), None)

    def _is_open(self, item: CheckItem) -> bool:
        return item.status == "asked" or (item.status == "failed" and self._is_blocking(item))

    def _is_blocking(self, item: CheckItem) -> bool:
        return self._binding and item.check.blocks

    @property
    def obstacle(self) -> str:
        """Why the session cannot go on yet, in a sentence; empty: it can."""
        running = [item.check.id for item in self.items if item.outcome is None]
        asked = [item.check.id for item in self.items if item.status == "asked"]
        failed = [item.check.id for item in self.items if item.status == "failed" and self._is_blocking(item)]
        if failed:
            return f"{_listed(failed)} failed"
        if asked:
            return f"{_listed(asked)}: answer with y or n"
        return f"{_listed(running)} {'are' if len(running) > 1 else 'is'} still running" if running else ""

    @property
    def reports(self) -> tuple[CheckReport, ...]:
        """The reports of all checks, in their order."""
        return tuple(report for item in self.items if (report := item.report) is not None)

    def rows(self, width: int) -> list[ListRow]:
        """One row for each check. Details or reasons that do not fit beside it are below it."""
        ids = min(14, max((cell_width(item.check.id) for item in self.items), default=4))
        return [row for item in self.items for row in self._item_rows(item, ids, width)]

    def _item_rows(self, item: CheckItem, ids: int, width: int) -> list[ListRow]:
        word, role = STATUS_WORDS[item.status]
        lead: StyledLine = ((" ", "plain"), fixed_span(word, STATUS_WIDTH, role), ("  ", "plain"))
        room = max(10, width - STATUS_WIDTH - ids - 6)
        question = item.outcome.question if item.outcome is not None else ""
        texts = wrap(question or check_text(item.check), room)
        head = (*lead, fixed_span(item.check.id, ids, "strong"), ("  ", "plain"), (texts[0], "plain"))
        rows = [ListRow(item.check.id, crop(head, width))]
        indent = " " * (STATUS_WIDTH + ids + 5)
        rows += [_below(f"{indent}{line}", "plain", width) for line in texts[1:]]
        found, last = _found_text(item), rows[-1]
        used = sum(cell_width(text) for text, _ in last.line)
        if found and item.status == "passed" and used + cell_width(found) + 3 <= width:
            rows[-1] = last._replace(line=(*last.line, (f"   {found}", "muted")))
        elif found:
            below: TextRole = "muted" if role == "plain" else role
            rows += [_below(f"{indent}{line}", below, width) for line in wrap(found, room)]
        return rows


def _below(text: str, role: TextRole, width: int) -> ListRow:
    return ListRow("", ((fit(text, min(width, cell_width(text))), role),), selectable=False)


def _found_text(item: CheckItem) -> str:
    """The finding of the check, and why it failed or was skipped."""
    outcome = item.outcome
    if outcome is None or outcome.result == "asked" or (item.check.ask and outcome.result != "skipped"):
        return ""
    if outcome.result == "skipped":
        return f"{outcome.reason} ({outcome.value})" if outcome.value else outcome.reason
    return ": ".join(filter(None, (outcome.value, outcome.reason)))


def _listed(ids: Sequence[str]) -> str:
    return ids[0] if len(ids) == 1 else f"{', '.join(ids[:-1])} and {ids[-1]}"
