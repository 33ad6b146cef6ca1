"""`[act.NAME]` and `[act."R_Task*"]` in scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from msgspec import Struct
from msgspec.structs import asdict

from rise_engine.base.nearest_name import in_backquotes, suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.files.toml_files import TomlTable, read_seconds
from rise_engine.scenario.model import (
    MAX_REPEATS,
    ActSettings,
    CallingType,
    SourceLocation,
    parse_failure_policy,
)
from rise_engine.scenario.settings import SCENARIO_TABLES, names_in
from rise_engine.syntax.toml import toml_key

MAX_DEBOUNCE = 60.0
MAX_PATTERNS = 100
"""Maximum number of tables with wildcards, because each is compared with each act."""
SETTINGS = tuple(names_in(SCENARIO_TABLES, "act.*"))
_CALLING_TYPES: dict[str, CallingType] = {"none": "None", "blocking": "Blocking"}
_WILDCARD = re.compile(r"\[[^\]]*\]|[*?]")


class ActTable(Struct, frozen=True):
    """One table `[act.NAME]` as written."""

    name: str
    """An act, or a pattern: `*` matches any text, `?` any character, `[12]` one of these characters."""
    given: dict[str, Any]
    """The settings in the table."""
    location: SourceLocation

    @property
    def has_wildcards(self) -> bool:
        return _WILDCARD.search(self.name) is not None

    @property
    def header(self) -> str:
        return f"[act.{toml_key(self.name)}]"


class ActTables(Struct):
    """All these tables, and the resulting settings of acts."""

    tables: tuple[ActTable, ...] = ()
    by_name: dict[str, ActTable] = {}
    """In file order. TOML allows no two tables of one name."""
    patterns: list[ActTable] = []
    """Patterns with more literal characters come later; equal ones stay in file order."""

    def __post_init__(self) -> None:
        self.by_name = {table.name: table for table in self.tables}
        self.patterns = sorted((table for table in self.by_name.values() if table.has_wildcards), key=_exactness)

    def check_patterns(self, acts: Iterable[str], diagnostics: Diagnostics) -> None:
        """Report an error for each pattern that fits no act, and for too many patterns."""
        names = tuple(acts)
        if len(self.patterns) > MAX_PATTERNS:
            message = f"at most {MAX_PATTERNS} tables are for several acts at once; there are {len(self.patterns)}"
            diagnostics.error("out-of-range", self.patterns[0].location, message)
            return
        for table in self.patterns:
            if table.name not in names and not any(fnmatchcase(name, table.name) for name in names):
                message = f"no act has a name like `{table.name}`"
                diagnostics.error("unknown-act", table.location, message, suggest(table.name, names))

    def find_sources(self, act: str) -> dict[str, ActTable]:
        """Return the table of each setting of an act: the act's own table, else the pattern with the most literal
        characters, else the later table."""
        fitting = [table for table in self.patterns if fnmatchcase(act, table.name)]
        if (own := self.by_name.get(act)) is not None:
            fitting.append(own)
        return {key: table for table in fitting for key in table.given}

    def settings_by_act(self, acts: Iterable[str]) -> dict[str, ActSettings]:
        """The settings of each act that any table applies to."""
        found = ((act, self.find_sources(act)) for act in acts)
        return {
            act: ActSettings(**{key: table.given[key] for key, table in sources.items()})
            for act, sources in found
            if sources
        }

    def explain(self, act: str, on_failure: str) -> list[tuple[str, Any, ActTable | None]]:
        """Return each setting of an act with its value and its table; None: a default. The default for failures is the
        scenario's `on_failure`."""
        sources, usual = self.find_sources(act), {**asdict(ActSettings()), "on_failure": on_failure}
        return [(key, sources[key].given[key] if key in sources else usual[key], sources.get(key)) for key in SETTINGS]


def _exactness(table: ActTable) -> int:
    return len(_WILDCARD.sub("", table.name))


def read_act_tables(table: TomlTable, draft: ScenarioDraft) -> ActTables:
    """Read the tables below `[act]`. `draft` gets the names of single acts."""
    usual = ActSettings()
    found = []
    for name in table.values:
        inner = table.subtable(name, f"settings of an act are a table: [act.{toml_key(name)}]")
        given: dict[str, Any] = {}
        if inner is not None:
            inner.report_unknown_keys(SETTINGS)
            read = {
                "hold": partial(inner.read, "hold", bool, usual.hold),
                "debounce": partial(read_seconds, inner, "debounce", usual.debounce, 0.0, MAX_DEBOUNCE),
                "filler": partial(inner.read, "filler", bool, usual.filler),
                "answers": partial(inner.read, "answers", bool, usual.answers),
                "calling_type": partial(_read_calling_type, inner),
                "on_failure": partial(read_on_failure, inner),
            }
            given = {key: read[key]() for key in SETTINGS if key in inner.values}
        each = ActTable(name, given, table.key_location(name))
        found.append(each)
        if not each.has_wildcards:
            draft.act_mentions.append(Mention(name, partial(table.key_location, name)))
    return ActTables(tuple(found))


def _read_calling_type(table: TomlTable) -> CallingType:
    written = table.values["calling_type"]
    if isinstance(written, str) and written.lower() in _CALLING_TYPES:
        return _CALLING_TYPES[written.lower()]
    types = _CALLING_TYPES.values()
    near = suggest(written, types, limit=0) if isinstance(written, str) else None
    table.report_value("wrong-value", "calling_type", f"`calling_type` is one of {in_backquotes(types)}", near)
    return "Blocking"


def read_on_failure(table: TomlTable) -> str:
    """Read `on_failure`, the reaction to a failed act, for one act or as the default for all."""
    written = table.values["on_failure"]
    try:
        if isinstance(written, str):
            parse_failure_policy(written)
            return written
    except ValueError:
        pass
    near = suggest(written, ("go_on", "ask", "repeat:2"), limit=2) if isinstance(written, str) else None
    message = f'`on_failure` is "go_on", "ask" or "repeat:2" (up to {MAX_REPEATS})'
    table.report_value("wrong-value", "on_failure", message, near)
    return "go_on"
