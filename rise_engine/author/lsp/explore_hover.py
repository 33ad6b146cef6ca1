"""What is told about `[trials]`, `[explore]`, `[always]`, `[reachable]` and `[eventually]` of scenario.toml."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from rise_engine.author.lsp.toml_lines import opened_text, table_at
from rise_engine.expression import Expression, ExpressionError
from rise_engine.expression.functions import SITUATION_SIGNATURES
from rise_engine.scenario.explore_tables import EVENTUALLY_KEYS, EXPLORE_KEYS, PROPERTY_MEANINGS, PROPERTY_TABLES
from rise_engine.scenario.trial_settings import TRIAL_KEYS

_HEADER = re.compile(r"\s*\[\s*([\w-]+)[^\]]*\]")
_ENTRY = re.compile(r"([\w-]+)\s*=")
_CALL = re.compile(r"\b(in|rule|runs|waits)\s*\(")
_TEXT = re.compile(r""""([^"\\]*)"|'([^']*)'""")
_MEANINGS: Mapping[str, str] = {
    "explore": "what `rise-engine explore` looks at",
    "trials": "what a trial is: a row of trials.csv",
    **{str(kind): meaning for kind, meaning in PROPERTY_MEANINGS.items()},
}


def explore_notes(text: str, offset: int) -> Iterator[str]:
    """In Markdown, what is known of a place of scenario.toml besides the names there."""
    start = text.rfind("\n", 0, offset) + 1
    line, column = text[start:].partition("\n")[0], offset - start
    if (header := _HEADER.match(line)) is not None and column <= header.end():
        if (name := header.group(1)) in _MEANINGS:
            yield f"**[{name}]**: {_MEANINGS[name]}"
        return
    table, _ = table_at(text[:offset])
    opened = opened_text(line[:column])
    if opened is None:
        known = {"explore": EXPLORE_KEYS, "eventually": EVENTUALLY_KEYS, "trials": TRIAL_KEYS}.get(table, {})
        for found in _ENTRY.finditer(line):
            if found.start() <= column <= found.end(1) and found.group(1) in known:
                yield f"**{found.group(1)}**: {known[found.group(1)]}"
    elif table in PROPERTY_TABLES and line[:opened].rstrip().endswith("="):
        for found in _CALL.finditer(line, opened):
            signature = next(each for each in SITUATION_SIGNATURES if each.name == found.group(1))
            if found.start() <= column <= found.end(1):
                yield f"{signature.usage}: {signature.meaning}"
        if (whole := _TEXT.match(line, opened)) is not None:
            yield from _reading(whole.group(1) if whole.group(1) is not None else whole.group(2))


def _reading(written: str) -> Iterator[str]:
    """How a condition is read."""
    try:
        yield f"read as `{Expression.parse_property(written).with_all_brackets}`"
    except ExpressionError:
        return
