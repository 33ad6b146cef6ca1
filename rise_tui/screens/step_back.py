"""The question whether a rule is to go a step back, and with which memory keys."""

from __future__ import annotations

from collections.abc import Sequence

from rise_tui.model.step_back import ACTS, BACK, GO_ON, KEEP, STOP, BackStep, step_behavior, step_lines
from rise_tui.screens.choices import Choice, ChoicesDialog, first_shown
from rise_tui.screens.dialog import DialogChoice

HINT = "all keys: t take back, k keep   one: ↑ ↓, ← →"
NOTHING = "no memory key has changed since"


class StepBackDialog(ChoicesDialog):
    """Memory keys are taken back, and acts go on, unless something else is chosen."""

    def __init__(self, lines: Sequence[str], step: BackStep) -> None:
        choices = [Choice(key, (BACK, KEEP)) for key in step.keys]
        choices += [Choice(ACTS, (GO_ON, STOP))] if step.acts else []
        super().__init__(
            "One step back?",
            lines,
            choices,
            {"t": BACK, "k": KEEP},
            DialogChoice("b", "Back"),
            DialogChoice("w", "Back, waiting"),
            hint=HINT if choices else NOTHING,
            no="Stay",
        )
        self._step = step

    def behavior(self, answer: str) -> str:
        """Of the task that makes the step, as it is chosen now."""
        return step_behavior(self._step, self.chosen, enter=answer == "b")

    def choice_lines(self, width: int, rows: int) -> list[str]:
        first = first_shown(self.selected, len(self.chosen), rows)
        return step_lines(self._step, self.chosen, self.selected, first, width, rows)
