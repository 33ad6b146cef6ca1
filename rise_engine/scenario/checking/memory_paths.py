"""Checks whether the memory keys of a scenario can exist, including the engine's own values under `session`.

Dotted keys are followed into the start values. A key can exist if it is in the start values. It can also exist if a
rule or a key of the keyboard sets it, a parent or a part of it. A start value that nothing sets never changes, so a
path that ends early there never exists. A null is a value that will be set later: any path may continue after it.

Parts that a scenario reads (`items[i].text`) must exist, too; tables must be used and cannot be changed. Only provable
mistakes are errors: a missing column of a table, a row or an entry after the last. An index that a session computes may
be any entry, so only a part that no entry has is an error.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from functools import cache

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, nearest_name, suggest
from rise_engine.expression.environment import describe, lookup, reach_into
from rise_engine.expression.nodes import Key, Literal, Negative, Node, Part, with_all_brackets
from rise_engine.expression.parts import find_part
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.model import SESSION, Act, Action, Json, Table
from rise_engine.scenario.speech.template import MemorySlot

_MAX_NAMES = 12
"""Maximum number of names of an object in a message."""
_SHORT = 1_000
"""Maximum length of such a list, in characters."""


class MemoryPaths:
    """The keys of one scenario: its start values, and the keys that are set while it runs."""

    def __init__(self, start: Mapping[str, Json], written: Collection[str]) -> None:
        self._start = start
        self._written = frozenset(written)
        self._within = {path for key in self._written for path in _key_prefixes(key)}
        """The keys of which an assignment sets a part."""

    def is_known(self, key: str) -> bool:
        """Whether the key has a value, is set, or is a part of such a value."""
        return key in self._start or self._is_written(key) or ("." in key and key.partition(".")[0] in self._start)

    def reading_problem(self, key: str) -> str:
        """Why a known key can never have a value; empty: it can."""
        if key in self._start or self._is_written(key) or key.partition(".")[0] not in self._start:
            return ""
        value, path, missing = self._follow(key)
        if value is None or not missing:
            return ""
        remedy = self._suggested_path(value, path, missing)
        return f"the memory never has `{key}`: {_why_it_ends(value, path, missing[0])}{remedy}"

    def writing_problem(self, key: str) -> str:
        """Why a key can never be set; empty: it can."""
        if key in self._start or not isinstance(self._start.get(key.partition(".")[0]), dict | list):
            return ""
        if any(path in self._written for path in _key_prefixes(key)):
            return ""
        value, path, missing = self._follow(key)
        if value is None or not missing or isinstance(value, dict):  # objects on the path are created
            return ""
        return f"`{key}` cannot be set: {_why_it_ends(value, path)}"

    def _follow(self, key: str) -> tuple[Json, str, list[str]]:
        """Follow a key into the start values. Returns the last value, the path to it, and the remaining parts."""
        path, *parts = key.split(".")
        value = self._start[path]
        while parts:
            found, inner = reach_into(value, parts[0])
            if not found:
                break
            value, path = inner, f"{path}.{parts.pop(0)}"
        return value, path, parts

    def _is_written(self, key: str) -> bool:
        if key in self._written or any(path in self._written for path in _key_prefixes(key)):
            return True
        head = key.partition(".")[0]
        return key in self._within and (head in self._start or head in self._written)

    def _suggested_path(self, value: Json, path: str, missing: list[str]) -> str:
        """The most likely intended path, as the end of a message."""
        if not isinstance(value, dict):
            return ""
        sibling = nearest_name(missing[0], value)
        if sibling is not None:
            return f"; did you mean `{self._existing_part(path, [sibling, *missing[1:]])}`?"
        if 0 < len(value) <= _MAX_NAMES:
            known = in_backquotes(f"{path}.{name}" for name in value)
            return f"; known: {known}" if len(known) < _SHORT else ""
        return ""

    def _existing_part(self, path: str, parts: list[str]) -> str:
        """The path with as many of the following parts as exist."""
        while parts and not lookup(self._start, ".".join((path, *parts)))[0]:
            parts = parts[:-1]
        return ".".join((path, *parts))


def _why_it_ends(value: Json, path: str, part: str = "") -> str:
    """Describe where a path into the start values ends, and that nothing changes this value."""
    if isinstance(value, list):
        entries = f"with the entries `{path}.0` to `{path}.{len(value) - 1}`" if len(value) > 1 else ""
        entries = entries or (f"with the one entry `{path}.0`" if value else "without entries")
        end = f"in the start values `{path}` is a list {entries}"
    elif isinstance(value, dict):
        end = f"in the start values `{path}` has no `{part}`"
    else:
        end = f"in the start values `{path}` is {describe(value)}, which has nothing inside"
    return f"{end}, and nothing in this scenario sets it"


def _key_prefixes(key: str) -> Iterator[str]:
    """The parents of a dotted key: `a` and `a.b` for `a.b.c`."""
    at = key.find(".")
    while at >= 0:
        yield key[:at]
        at = key.find(".", at + 1)


# --- the keys of the session ------------------------------------------------------------------------------------------


EXAMPLE: dict[str, Json] = {
    "speaking": False,
    "cue": False,
    "stopped": False,
    "participant": "",
    "condition": "",
    "factors": None,
    "language": "",
}
"""The keys under `session`. The study defines the names of the factors."""


def add_session_keys(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Add the session's values if the scenario reads any of them."""
    reads = [
        mention
        for mentions in (
            draft.key_reads,
            draft.optional_key_reads,
            draft.property_reads,
            draft.bare_words,
            draft.bare_keys,
        )
        for mention in mentions
        if mention.name.partition(".")[0] == SESSION
    ]
    if not reads:
        return
    is_own = SESSION in draft.tables or any(key.partition(".")[0] == SESSION for key in draft.settable_keys)
    if not is_own:
        draft.session_keys = EXAMPLE
        draft.settable_keys.add(SESSION)
    elif known := next((each for each in reads if each.name.partition(".")[2].partition(".")[0] in EXAMPLE), None):
        message = (
            f"`{known.name}` is a key of this scenario, because it sets `{SESSION}` itself; rename your key, so that "
            "the engine's values about the session are available"
        )
        diagnostics.warning("own-session", known.locate(), message)


def factors_read(draft: ScenarioDraft) -> frozenset[str]:
    """The study's factors that are read without a fallback: `pace` for `session.factors.pace`."""
    if not draft.session_keys:
        return frozenset()
    paths = (mention.name.split(".") for mention in (*draft.key_reads, *draft.bare_words, *draft.bare_keys))
    return frozenset(path[2] for path in paths if path[:2] == [SESSION, "factors"] and len(path) > 2)


def keys_read(draft: ScenarioDraft) -> frozenset[str]:
    """The memory keys that are read, up to their first dot."""
    reads = (draft.key_reads, draft.optional_key_reads, draft.bare_words, draft.bare_keys, draft.spoken_keys)
    return frozenset(mention.name.partition(".")[0] for mentions in reads for mention in mentions)


def session_problem(draft: ScenarioDraft, key: str) -> str:
    """Describe a part of the session that does not exist; empty for other keys."""
    head, _, part = key.partition(".")
    if head != SESSION or not draft.session_keys:
        return ""
    near = did_you_mean(key, [f"{SESSION}.{name}" for name in EXAMPLE])
    return f"the engine keeps no `{part}` under `{SESSION}`{near}"


# --- parts ------------------------------------------------------------------------------------------------------------


_MAX_ENTRIES = 1_000
"""Maximum number of entries that an unknown index may address. With more, nothing is proved."""
_ANY = object()
"""An index that is only known during a session."""


def check_parts(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Report missing parts, assignments to tables, and unused tables."""
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
        changed: the first parts of keys that the scenario sets. All other keys keep their first value,
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
            message = f"`{name}` is {what}, and nothing can change it; use a key of your own for a value that changes"
            diagnostics.error("read-only", mention.locate(), message)
    settable = sorted(draft.settable_keys | draft.tables.keys())
    for mention in draft.part_writes:
        if not any(prefix in settable for prefix in _prefixes(mention.name)):
            message = (
                f"nothing in this scenario sets the memory key `{mention.name}`, and a part can be set only in a list "
                "or an object that exists"
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
    """Follows parts into tables and into constant start values."""

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
        """First parts of keys that are set, completely or in part."""
        self._constants = constants or {}
        """Keys whose value is known if they are an index."""

    def reading_problem(self, part: Part) -> str:
        """Why a part can never exist; empty: it can."""
        if not isinstance(part.base, Key):
            return ""
        return self._problem(part.base.name, [*map(self._constant, part.steps)], part)

    def dotted_problem(self, key: str) -> str:
        """The same for a key with dots that reaches into a table."""
        name, *steps = key.split(".")
        return self._problem(name, steps, Part(Key(name), tuple(steps), key)) if name in self._tables else ""

    def speaking_problem(self, part: Part) -> str:
        """Why a part cannot be spoken (it is a whole row of a table); empty: it can."""
        if isinstance(part.base, Key) and part.base.name in self._tables and len(part.steps) == 1:
            return _whole_table(part.base.name, self._tables[part.base.name], part.written)
        return ""

    def _constant(self, step: str | Node) -> Json:
        """The value of a literal step, or of a key with a known value; otherwise _ANY."""
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
            return f"`{table.name}` is a table: write the row first, then the column: `{table.name}[i].{first}`"
        if row is not _ANY:
            index = int(row) if isinstance(row, str) else row
            if find_part(table.records, index, by_dot=False) is None:
                rows = f"the rows 0 to {len(table.rows) - 1}" if len(table.rows) > 1 else "one row, 0"
                rows = rows if table.rows else "no rows"
                shown = f"no {index}" if isinstance(index, int) else f"{describe(index)} is not a row"
                return f"the table `{table.name}` has {rows}, and {shown}; rows count from 0"
        if not rest or rest[0] is _ANY:
            return ""
        column = rest[0]
        if column not in table.columns:
            known = [str(each) for each in table.columns]
            near = nearest_name(column, known) if isinstance(column, str) else None
            remedy = f"did you mean `{near}`?" if near else f"it has {in_backquotes(known[:_MAX_NAMES])}"
            shown = f"`{column}`" if isinstance(column, str) else describe(column)
            return f"the table `{table.name}` has no column {shown}; {remedy}"
        if len(rest) > 1:
            return f"`{_prefix(part, 2)}` is a value of the table `{table.name}`, which has no parts"
        return ""


def _start_value_problem(start: Json, steps: list[Json], part: Part) -> str:
    """Why these steps lead nowhere from a start value; empty: they can. A null may get any value later."""
    if start is None:
        return ""
    holders = [start]
    for count, step in enumerate(steps):
        found: list[Json] = []
        if step is _ANY and sum(len(holder) for holder in holders if isinstance(holder, list | dict)) > _MAX_ENTRIES:
            return ""
        for holder in holders:
            if step is _ANY:
                found += holder.values() if isinstance(holder, dict) else holder if isinstance(holder, list) else ()
            elif (place := find_part(holder, step, by_dot=isinstance(part.steps[count], str))) is not None:
                found.append(holder[place])
        if not found:
            return f"{_why_part_ends(holders, step, _prefix(part, count))}, and nothing in this scenario sets it"
        if any(value is None for value in found):
            return ""
        holders = found
    return ""


def _why_part_ends(holders: list[Json], step: Json, path: str) -> str:
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
    """A key and its parents."""
    parts = key.split(".")
    return (".".join(parts[: count + 1]) for count in range(len(parts)))


def _whole_table(name: str, table: Table, row: str = "") -> str:
    what = f"`{row}` is a row of the table `{name}`" if row else f"`{name}` is a table"
    return f"{what}, which cannot be said; name a row and a column: {{{row or name + '[i]'}.{table.columns[0]}}}"
