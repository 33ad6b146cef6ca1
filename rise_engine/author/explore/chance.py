"""Chance as decisions: whatever a draw can give is tried, one after the other."""

from __future__ import annotations

from rise_engine.kernel.rng import Rng

FRACTIONS = tuple(index / 12 for index in range(12))
"""What stands for a number in [0, 1): twelve values, so that parts down to a twelfth are all met."""
MAX_SCRIPTS = 64
"""How many courses of one input are looked at; chance that has more is not looked at whole."""


class Decisions(Rng):
    """A source of chance that reads from a script and can be asked for the next script."""

    def __init__(self) -> None:
        super().__init__(0)
        self.made: list[tuple[int, int]] = []
        """Since `begin`: each decision, and out of how many."""
        self._script: list[int] = []

    def begin(self, script: list[int]) -> None:
        """From here on, decide as the script says, and by 0 when it has ended."""
        self._script = script
        self.made.clear()

    def choose(self, count: int) -> int:
        """One of `count` possibilities."""
        position = len(self.made)
        choice = self._script[position] if position < len(self._script) else 0
        self.made.append((choice, count))
        return choice

    def integer_below(self, count: int) -> int:
        return self.choose(count)

    def fraction(self) -> float:
        return FRACTIONS[self.choose(len(FRACTIONS))]

    def next_script(self) -> list[int] | None:
        """The script of the next course: the last decision that has another possibility left; null: all were tried."""
        made = self.made
        while made:
            choice, count = made.pop()
            if choice + 1 < count:
                return [*(before for before, _ in made), choice + 1]
        return None
