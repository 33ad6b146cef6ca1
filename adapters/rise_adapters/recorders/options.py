"""Options of a recorder in study.toml. All errors are reported together, each in a line that begins with the option."""

from __future__ import annotations

from collections.abc import Mapping

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.ports.recorder import RecorderError
from rise_engine.scenario.model import Json


class OptionReader:
    """Reads the options of one recorder, and collects all errors until `finish`."""

    def __init__(self, options: Mapping[str, Json], known: tuple[str, ...]) -> None:
        """:param options: those of study.toml.
        :param known: all existing options.
        """
        self.options = options
        self.problems = [f"`{key}` is not an option of this recorder{did_you_mean(key, known)}" for key in options
                         if key not in known]  # fmt: skip

    def text(self, key: str, usual: str = "", *, needed: str = "") -> str:
        """Return a text. `needed`: an example, if the option is required."""
        value = self.options.get(key, usual)
        if key not in self.options and needed:
            self.problems.append(f"`{key}` is missing: {needed}")
        elif not isinstance(value, str) or (key in self.options and not value.strip()):
            self.problems.append(f"`{key}` is a text" + (f": {needed}" if needed else ""))
            return usual
        return str(value)

    def texts(self, key: str, form: str, *, needed: bool = False) -> list[str]:
        """Return a list of texts. `form`: an example."""
        value = self.options.get(key, [])
        if isinstance(value, list) and all(isinstance(each, str) and each for each in value):
            if needed and not value:
                self.problems.append(f"`{key}` is missing: {form}")
            return [str(each) for each in value]
        self.problems.append(f"`{key}` is a list of texts: {form}")
        return []

    def number(self, key: str, usual: int, least: int, most: int) -> int:
        """Return a whole number."""
        value = self.options.get(key, usual)
        if isinstance(value, int) and not isinstance(value, bool) and least <= value <= most:
            return value
        self.problems.append(f"`{key}` is a whole number from {least} to {most}")
        return usual

    def choice(self, key: str, known: tuple[str, ...]) -> str:
        """Return one of these words; the first is the default."""
        value = self.options.get(key, known[0])
        if value in known:
            return str(value)
        self.problems.append(f"`{key}` is one of {', '.join(known)}")
        return known[0]

    def refuse(self, problem: str) -> None:
        """Add an error, as a sentence that begins with the option."""
        self.problems.append(problem)

    def finish(self) -> None:
        """Raise RecorderError with all errors, if any."""
        if self.problems:
            raise RecorderError(*self.problems)
