"""Checks that the parts that a scenario reads exist (`items[i].text`), and that tables are used and never changed.

Only provable mistakes are errors: a column that a table does not have, a row or an entry after the last. An index that
is computed while a session runs may be any entry, so only what no entry has is a mistake.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from functools import cache

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, nearest_name, suggest
from rise_engine.expression.environment import lookup
from rise_engine.expression.nodes import Key, Literal, Negative, Node, Part, with_all_brackets
from rise_engine.expression.parts import find_part
from rise_engine.expression.values import describe
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.model import SESSION, Act, Action, Json, Table
from rise_engine.scenario.speech.template import MemorySlot

_MOST = 1_000
"""The most entries that an unknown index may mean. With more, nothing is proved."""
_FEW = 12
"""How many names a message lists."""
_ANY = object()
"""An index that is only known when a session runs."""


def check_parts(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Report parts that do not exist, tables that something would change, and tables that nothing uses."""
    _check_changes(draft, diagnostics)
    memory = {**draft.memory, **({SESSION: draft.session_keys} if draft.session_keys else {})}
    written = {mention.name for mention in (*draft.key_writes, *draft.part_writes, *draft.condition_values)}
    paths = _PartPaths(draft.tables, memory, {name.partition(".")[0] for name in written})
    problem = cache(paths.reading_problem)
    for part in draft.part_reads:
        if (found := problem(part.part)) or (part.spoken and (found := paths.speaking_problem(part.part))):
            diagnostics.error("unknown-path", part.locate(), found)
    for key in (*draft.key_reads, *draft.property_reads, *draft.bare_words, *draft.bare_keys):
        if "." in key.name and (found := paths.dotted_problem(key.name)):
            diagnostics.error("unknown-path", key.locate(), found)
    for key in draft.spoken_keys:
        if key.name in draft.tables:
            diagnostics.error("unknown-path", key.locate(), _whole_table(key.name, draft.tables[key.name]))
    _check_use(draft, diagnostics)


def find_missing_parts(
    act: Act, tables: Mapping[str, Table], memory: Mapping[str, Json], changed: Set[str]
) -> Iterator[tuple[Action, str]]:
    """Yield the actions of an act that need a part that can never exist in a session, each with the reason.

    Arguments:
        act: the act. Parts with a fallback are not needed.
        tables: of the scenario.
        memory: the memory at the start of the session.
        changed: the first parts of keys that something in the scenario sets. All other keys keep their first value,
            also as an index.
    """
    constants = {name: value for name, value in memory.items() if name.partition(".")[0] not in changed}
    paths = _PartPaths(tables, memory, changed, constants)
    for action in act.actions:
        templates = [template for call in action.calls for template in call.parameters.values()]
        slots = [slot for template in templates for slot in template.parts if isinstance(slot, MemorySlot)]
        needed = [slot.part for slot in slots if slot.part is not None and slot.fallback is None]
        for part in dict.fromkeys(part for expression in needed for part in expression.parts):
            if problem := paths.reading_problem(part):
                yield action, problem


def _check_changes(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    for mention in (*draft.key_writes, *draft.part_writes):
        name = mention.name.partition(".")[0]
        what = "a table" if name in draft.tables else "the engine's" if name == SESSION and draft.session_keys else ""
        if what:
            message = f"`{name}` is {what}, and nothing can change it; keep what changes under a key of its own"
            diagnostics.error("read-only", mention.locate(), message)
    settable = sorted(draft.settable_keys | draft.tables.keys())
    for mention in draft.part_writes:
        if not any(prefix in settable for prefix in _prefixes(mention.name)):
            message = (
                f"nothing in this scenario sets the memory key `{mention.name}`, and a part can be set only in a list "
                "or an object that is there"
            )
            near = suggest(mention.name, settable, otherwise="; give it a start value")
            diagnostics.warning("unset-key", mention.locate(), message, near)


def _check_use(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    mentions: Iterable[Mention] = (
        *draft.key_reads,
        *draft.optional_key_reads,
        *draft.property_reads,
        *draft.bare_words,
        *draft.bare_keys,
        *draft.spoken_keys,
    )
    used = {mention.name.partition(".")[0] for mention in mentions}
    for name, table in draft.tables.items():
        if name not in used:
            example = f"{name}[i].{table.columns[0]}"
            message = f"nothing in this scenario reads the table `{name}`; its rows are read as {example}"
            diagnostics.warning("unused-table", table.location, message)


class _PartPaths:
    """Follows parts into tables and into start values that nothing changes."""

    def __init__(
        self,
        tables: Mapping[str, Table],
        memory: Mapping[str, Json],
        changed: Set[str],
        constants: Mapping[str, Json] | None = None,
    ) -> None:
        self._tables = tables
        self._memory = memory
        self._changed = changed
        """First parts of keys that something sets, or sets something in."""
        self._constants = constants or {}
        """Keys whose value is known when they are an index."""

    def reading_problem(self, part: Part) -> str:
        """Why a part can never exist; empty if it can."""
        if not isinstance(part.base, Key):
            return ""
        return self._problem(part.base.name, [*map(self._constant, part.steps)], part)

    def dotted_problem(self, key: str) -> str:
        """The same for a key with dots that reaches into a table."""
        name, *steps = key.split(".")
        return self._problem(name, steps, Part(Key(name), tuple(steps), key)) if name in self._tables else ""

    def speaking_problem(self, part: Part) -> str:
        """Why a part cannot be said (it is a whole row of a table); empty if it can."""
        if isinstance(part.base, Key) and part.base.name in self._tables and len(part.steps) == 1:
            return _whole_table(part.base.name, self._tables[part.base.name], part.written)
        return ""

    def _constant(self, step: str | Node) -> Json:
        """The value of a literal step, or of a key whose value is known; else _ANY."""
        match step:
            case str():
                return step
            case Literal(value):
                return value
            case Negative(Literal(int() as value)):
                return -value
            case Key(name) if name in self._constants:
                return self._constants[name]
            case _:
                return _ANY

    def _problem(self, name: str, steps: list[Json], part: Part) -> str:
        table = self._tables.get(name)
        if table is not None:
            return self._table_problem(table, steps, part)
        if name.partition(".")[0] in self._changed:
            return ""
        found, value = lookup(self._memory, name)
        if not found:
            return ""
        return _start_value_problem(value, steps, part)

    def _table_problem(self, table: Table, steps: list[Json], part: Part) -> str:
        row, *rest = steps
        if isinstance(row, str) and not (row.isdigit() and "." in part.written):
            first = table.columns[0] if row not in table.columns else row
            return f"`{table.name}` is a table: first comes the row, and then the column: `{table.name}[i].{first}`"
        if row is not _ANY:
            index = int(row) if isinstance(row, str) else row
            if find_part(table.records, index, by_dot=False) is None:
                rows = f"the rows 0 to {len(table.rows) - 1}" if len(table.rows) > 1 else "one row, 0"
                rows = rows if table.rows else "no rows"
                shown = f"no {index}" if isinstance(index, int) else f"none that {describe(index)} could mean"
                return f"the table `{table.name}` has {rows}, and {shown}; rows count from 0"
        if not rest or rest[0] is _ANY:
            return ""
        column = rest[0]
        if column not in table.columns:
            known = [str(each) for each in table.columns]
            near = nearest_name(column, known) if isinstance(column, str) else None
            remedy = f"did you mean `{near}`?" if near else f"it has {in_backquotes(known[:_FEW])}"
            shown = f"`{column}`" if isinstance(column, str) else describe(column)
            return f"the table `{table.name}` has no column {shown}; {remedy}"
        if len(rest) > 1:
            return f"`{_prefix(part, 2)}` is a value of the table `{table.name}`, which has no parts"
        return ""


def _start_value_problem(start: Json, steps: list[Json], part: Part) -> str:
    """Why these steps lead nowhere from a start value; empty if they can. A null is a value that is still to come."""
    if start is None:
        return ""
    holders = [start]
    for count, step in enumerate(steps):
        found: list[Json] = []
        if step is _ANY and sum(len(holder) for holder in holders if isinstance(holder, list | dict)) > _MOST:
            return ""
        for holder in holders:
            if step is _ANY:
                found += holder.values() if isinstance(holder, dict) else holder if isinstance(holder, list) else ()
            elif (place := find_part(holder, step, by_dot=isinstance(part.steps[count], str))) is not None:
                found.append(holder[place])
        if not found:
            return f"{_why_it_ends(holders, step, _prefix(part, count))}, and nothing in this scenario sets it"
        if any(value is None for value in found):
            return ""
        holders = found
    return ""


def _why_it_ends(holders: list[Json], step: Json, path: str) -> str:
    holder = holders[0]
    start = f"in the start values `{path}` "
    if len(holders) > 1 and isinstance(step, str) and any(isinstance(each, dict) for each in holders):
        return f"{start}has no `{step}`, whatever the index is{did_you_mean(step, sorted(_names(holders)))}"
    if isinstance(holder, list):
        entries = f"is a list of {len(holder)}, with the entries 0 to {len(holder) - 1}"
        return start + (entries if len(holder) > 1 else "is a list with one entry, 0" if holder else "is an empty list")
    if isinstance(holder, dict):
        shown = f"`{step}`" if isinstance(step, str) else "nothing" if step is _ANY else f"`{step}`"
        return f"{start}has no {shown}{did_you_mean(str(step), holder)}" if step is not _ANY else f"{start}is empty"
    return f"{start}is {describe(holder)}, which has no parts"


def _names(holders: Iterable[Json]) -> Collection[str]:
    return {name for holder in holders if isinstance(holder, dict) for name in holder}


def _prefix(part: Part, count: int) -> str:
    """The first steps of a part, as written."""
    return with_all_brackets(part._replace(steps=part.steps[:count]))


def _prefixes(key: str) -> Iterator[str]:
    """A key, and the keys that it reaches into."""
    parts = key.split(".")
    return (".".join(parts[: count + 1]) for count in range(len(parts)))


def _whole_table(name: str, table: Table, row: str = "") -> str:
    what = f"`{row}` is a row of the table `{name}`" if row else f"`{name}` is a table"
    return f"{what}, which cannot be said; name a row and a column: {{{row or name + '[i]'}.{table.columns[0]}}}"
