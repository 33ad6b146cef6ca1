"""Chance (semantics.md 0.1)."""

from __future__ import annotations

MASK = 2**64 - 1


class Chance:
    """SplitMix64."""

    def __init__(self, seed: int) -> None:
        self.state = seed & MASK

    def draw(self) -> int:
        """The next whole number of 64 bits."""
        self.state = (self.state + 0x9E3779B97F4A7C15) & MASK
        number = self.state
        number = ((number ^ (number >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        number = ((number ^ (number >> 27)) * 0x94D049BB133111EB) & MASK
        return number ^ (number >> 31)

    def one_of(self, count: int) -> int:
        """A place among `count`, from 0."""
        return (self.draw() * count) // 2**64

    def fraction(self) -> float:
        """A number from 0 up to, but without, 1."""
        return (self.draw() // 2**11) / 2**53
