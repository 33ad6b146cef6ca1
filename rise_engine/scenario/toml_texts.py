"""Texts of TOML files as they are written: where each of their characters stands."""

from __future__ import annotations

import re

from rise_engine.base.text import match_end
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.source_files import SourceFile
from rise_engine.scenario.toml_locations import KeyPath, TomlFile

_BASIC = re.compile(r"\\(?:u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8}|[ \t]*\r?\n\s*|.)|\r\n|.", re.DOTALL)


class WrittenText:
    """One text, with or without quotation marks."""

    def __init__(self, source: SourceFile, offset: int, value: str) -> None:
        """
        :param source: the file.
        :param offset: where the text begins, with its quotation marks.
        :param value: what it says.
        """
        text = source.text
        quotes = next((each for each in ('"""', "'''", '"', "'") if text.startswith(each, offset)), "")
        at = offset + len(quotes)
        if len(quotes) == 3:  # a line end directly behind them is none of the text's
            at = match_end(re.compile(r"\r?\n"), text, at)
        self.starts: list[int] = []
        for _ in value:
            self.starts.append(at)
            if quotes.startswith('"') and (unit := _BASIC.match(text, at)) is not None:
                while unit is not None and len(unit.group()) > 1 and unit.group()[1:].strip() == "":
                    at = unit.end()  # a backslash at the end of a line joins it to the next
                    unit = _BASIC.match(text, at)
                self.starts[-1] = at
                at = unit.end() if unit is not None else at
            else:
                at += 2 if text.startswith("\r\n", at) else 1
        self.starts.append(at)

    def span(self, start: int, length: int) -> tuple[int, int]:
        """From where, and over how many characters of the file, these characters of the value stand."""
        return self.starts[start], self.starts[start + length] - self.starts[start]


def character_location(file: TomlFile, path: KeyPath, value: str, at: int) -> SourceLocation:
    """Where a character of a text stands that is the value at a path; `at` counts from 0, and may be its end."""
    start = file.value_location(*path)
    written = WrittenText(file.source, file.source.offset(start.line, start.column), value)
    return file.source.location(written.starts[min(at, len(value))])
