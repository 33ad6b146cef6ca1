"""The question whether a stop is to be released, and what becomes of the rules that it has ended."""

from __future__ import annotations

from collections.abc import Sequence

from rise_tui.model.resumption import OPTIONS, InterruptedRule, release_behavior, resumption_lines
from rise_tui.screens.choices import Choice, ChoicesDialog
from rise_tui.screens.dialog import DialogChoice

ALL_KEYS = {"e": "enter", "w": "wait", "l": "leave"}
HINT = "all: e re-enter, w wait there, l leave   one: ↑ ↓, ← →"


class ReleaseDialog(ChoicesDialog):
    """Asks once for all rules; each is left stopped unless something else is chosen."""

    def __init__(self, lines: Sequence[str], rules: Sequence[InterruptedRule], repeat_keys: Sequence[str]) -> None:
        super().__init__(
            "Release the stop?",
            lines,
            [Choice(rule.name, OPTIONS) for rule in rules],
            ALL_KEYS,
            DialogChoice("r", "Release"),
            hint=HINT,
            no="Stay stopped",
            repeat_keys=repeat_keys,
        )
        self._rules = rules

    @property
    def behavior(self) -> str:
        """Of the task that releases the stop, as it is chosen now."""
        return release_behavior(self.chosen)

    def choice_lines(self, width: int, rows: int) -> list[str]:
        return resumption_lines(self._rules, self.chosen, self.selected, width, rows)
