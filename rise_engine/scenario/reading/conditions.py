"""The conditions of a study: `[study]`, `[conditions.NAME]` and `private` in scenario.toml.

The table of a condition sets memory values at the start of a session in it.
"""

from __future__ import annotations

import json
from collections import Counter
from functools import cache, partial
from typing import Any

from msgspec.json import encode

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, suggest
from rise_engine.scenario.checking.memory_paths import keys_read
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ConditionValue, Mention, ScenarioDraft
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, is_integer
from rise_engine.scenario.model import SESSION, Condition, Json, Scenario
from rise_engine.scenario.settings import SCENARIO_TABLES, names_in
from rise_engine.syntax.toml import toml_key

MAX_PARTICIPANTS = 1_000_000
MAX_CONDITION_LABEL = 24
"""Maximum characters of a `label`, because it shares the status line."""


def how_to_write(name: str) -> str:
    """Return what to write in scenario.toml so that a session can run in a condition of this name."""
    table = f"[conditions.{toml_key(name)}]"
    return f"write under {table} what it sets, `memory = {{ KEY = VALUE }}`, or `label_only = true` if it sets nothing"


def read_study(table: TomlTable) -> dict[str, Any]:
    """Read `[study]`: the number of participants, and the conditions. Other remarks belong in comments or a README."""
    study: dict[str, Any] = {}
    participants = table.values.get("participants")
    if participants is not None:
        if not is_integer(participants):
            message = "`participants` is a whole number: how many take part"
            table.report_value("wrong-type", "participants", message)
        elif not 1 <= participants <= MAX_PARTICIPANTS:
            table.report_value("out-of-range", "participants", f"`participants` is from 1 to {MAX_PARTICIPANTS}")
        else:
            study["participants"] = participants
    names = table.values.get("conditions")
    if names is not None:
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            table.report_value("wrong-type", "conditions", '`conditions` is a list of texts: ["A", "B"]')
        elif not names or not all(name.strip() == name and name for name in names):
            message = "each condition has a name, without blanks around it"
            table.report_value("missing-value", "conditions", message)
        elif len(set(names)) < len(names):
            twice = Counter(names).most_common(1)[0][0]
            table.report_value("duplicate-name", "conditions", f"the condition `{twice}` is listed twice")
        else:
            study["conditions"] = names
    return study


def read_conditions(
    table: TomlTable, study: TomlTable, listed: list[str], draft: ScenarioDraft
) -> dict[str, Condition]:
    """Read `[conditions.NAME]` in the order in which `[study]` lists them, or else in file order.

    :param table: `[conditions]`.
    :param study: `[study]`, for the places in it.
    :param listed: its `conditions`; empty: it lists none.
    :param draft: gets the values that the conditions set.
    """
    found = {name: _read_condition(table, name, draft) for name in table.values}
    _check_difference(table, found)
    for index, name in enumerate(listed):
        if name in found:
            continue
        location = study.value_location("conditions", str(index))
        if found:
            message = f"the condition `{name}` has no table; {how_to_write(name)}"
            study.diagnostics.error("unknown-name", location, message, suggest(name, found))
        else:  # old scenarios list bare names; they can still be read, replayed and exported
            message = f"the condition `{name}` is only a name, and no session can begin in it; {how_to_write(name)}"
            study.diagnostics.warning("bare-condition", location, message)
    for name in found.keys() - set(listed) if listed else ():
        message, near = f"`conditions` of [study] does not list `{name}`", suggest(name, listed)
        table.report_key("unknown-name", message, name, suggestion=near)
    return {name: found[name] for name in (listed or found) if name in found}


def _check_difference(table: TomlTable, conditions: dict[str, Condition]) -> None:
    """Report conditions that people or the robot cannot distinguish."""
    shown: dict[str, str] = {}
    set_by: dict[bytes, str] = {}
    for name, condition in conditions.items():
        label = condition.label or name
        if (first := shown.setdefault(label, name)) != name:
            message = f"screens would show the conditions `{first}` and `{name}` as the same, `{label}`"
            table.report_key("duplicate-name", message, name)
        if condition.memory and (same := set_by.setdefault(encode(condition.memory, order="sorted"), name)) != name:
            message = (
                f"the robot does the same in `{same}` and `{name}`: give them different values, or write "
                "label_only = true in both, if the difference is outside the robot"
            )
            table.report_key("same-condition", message, name)


def conditions_in(values: dict[str, Any]) -> dict[str, Condition]:
    """The valid conditions of a parsed scenario.toml, without diagnostics."""
    file, draft, diagnostics = TomlFile(SourceFile("", b"", ""), values), ScenarioDraft(), Diagnostics()
    table = TomlTable(file, (), values, diagnostics)
    study = table.section("study")
    return read_conditions(table.section("conditions"), study, read_study(study).get("conditions", []), draft)


def _read_condition(table: TomlTable, name: str, draft: ScenarioDraft) -> Condition:
    if not name or name.strip() != name or not name.isprintable():
        message = "the name of a condition has characters that can be shown, and no blanks around it"
        table.report_key("bad-name", message, name)
    inner = table.subtable(name, f"a condition is a table: [conditions.{toml_key(name)}]")
    if inner is None:
        return Condition()
    inner.report_unknown_keys(names_in(SCENARIO_TABLES, "conditions.*"))
    label_only = inner.read("label_only", bool, False)
    memory = inner.subtable("memory", "`memory` says the values that the condition sets: memory = { KEY = VALUE }")
    values: dict[str, Json] = {} if memory is None else memory.values
    if label_only and values:
        message = f"the condition `{name}` sets something, so it is not `label_only`; remove one of the two"
        inner.report_key("wrong-value", message, "label_only")
    elif not label_only and not values and memory is not None:
        message = f"the condition `{name}` sets nothing; {how_to_write(name)}"
        inner.report_key("missing-value", message, *(["memory"] if "memory" in inner.values else []))
    for key, value in values.items():
        locate = partial(inner.key_location, "memory", key)
        draft.condition_values.append(ConditionValue(key, locate, name, value))
        draft.settable_keys.add(key)
    label = inner.read_label('"A"', MAX_CONDITION_LABEL, "write what screens show, or leave it out")
    return Condition(dict(values), label, label_only, inner.key_location())


def read_private(table: TomlTable, draft: ScenarioDraft) -> frozenset[str]:
    """Read `private`: memory keys with personal values, which are removed from data for others."""
    names = table.values.get("private", [])
    if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() == name != "" for name in names):
        table.report_value("wrong-type", "private", '`private` is a list of memory keys: private = ["person_name"]')
        return frozenset()
    seen: set[str] = set()
    for index, name in enumerate(names):
        locate = partial(table.value_location, "private", str(index))
        if name in seen:
            table.diagnostics.error("duplicate-name", locate(), f"`{name}` is listed twice")
        else:
            seen.add(name)
            draft.private_keys.append(Mention(name, locate))
    return frozenset(names)


# --- checks against the other files ---------------------------------------------------------------------------------


def check_conditions(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Check that the memory keys of conditions, of `tries` and of `private` exist, and that conditions' values are read
    and not changed. Only for a draft whose files could all be read."""
    if draft.condition_values or draft.private_keys or draft.tried_keys:
        _ConditionCheck(draft, diagnostics).check()


class _ConditionCheck:
    def __init__(self, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.draft = draft
        self.diagnostics = diagnostics
        self.changes = (*draft.key_writes, *draft.part_writes)
        """The places where rules and keys of the keyboard set memory values."""
        self.read = keys_read(draft)
        also = (*self.changes, *draft.property_reads)
        self.known = draft.memory.keys() | self.read | {_head(mention.name) for mention in also}
        """All keys up to their first dot."""
        if draft.session_keys:
            self.known.discard(SESSION)
        otherwise = "; give it a start value, if only something outside uses it"
        self.suggest = cache(lambda key: suggest(key, sorted(self.known), limit=0, otherwise=otherwise))

    def check(self) -> None:
        for value in self.draft.condition_values:
            self.check_value(value)
        self.check_changes()
        self.known |= {value.name for value in self.draft.condition_values}
        for mention in self.draft.private_keys:
            if mention.name not in self.known:
                self.report_unknown(mention, "`private` names")
        for mention in self.draft.tried_keys:
            if _head(mention.name) in self.draft.tables:
                message = f"`{_head(mention.name)}` is a table, and nothing can give it other values"
                self.diagnostics.error("read-only", mention.locate(), message)
            elif mention.name not in self.known:
                self.report_unknown(mention, "`tries` names")

    def check_value(self, value: ConditionValue) -> None:
        key = value.name
        if _head(key) in self.draft.tables:
            message = f"`{_head(key)}` is a table, which nothing can change; let the condition set a key of its own"
            self.diagnostics.error("read-only", value.locate(), message)
            return
        if key not in self.known:
            self.report_unknown(value, "a condition sets")
            return
        start = self.draft.memory.get(key)
        if start is not None and _kind(start) != _kind(value.value):
            message = f"the start value of `{key}` is {_kind(start)}; this is {_kind(value.value)}"
            self.diagnostics.warning("memory-type", value.locate(), message)
        if _head(key) not in self.read:
            message = f"nothing in this scenario reads `{key}`, so it changes nothing that the robot does"
            self.diagnostics.warning("condition-unread", value.locate(), message)

    def report_unknown(self, mention: Mention, who: str) -> None:
        key, head, near = mention.name, _head(mention.name), None
        if head != key and head in self.known:
            message = f"{who} whole memory keys: `{head}`, not `{key}`"
        else:
            message, near = f"nothing in this scenario sets or reads the memory key `{key}`", self.suggest(key)
        self.diagnostics.error("unknown-memory-key", mention.locate(), message, near)

    def check_changes(self) -> None:
        """Warn of changes of a value that a condition sets."""
        conditions: dict[str, str] = {}
        for value in self.draft.condition_values:
            conditions.setdefault(_head(value.name), value.condition)
        for mention in self.changes:
            head = _head(mention.name)
            if head in conditions:
                message = (
                    f"this changes `{head}`, which the condition `{conditions[head]}` sets: the session would no "
                    "longer run in the condition that its record names"
                )
                self.diagnostics.warning("condition-changed", mention.locate(), message)


def _head(key: str) -> str:
    return key.partition(".")[0]


def _kind(value: Json) -> str:
    match value:
        case bool():
            return "true or false"
        case int() | float():
            return "a number"
        case str():
            return "a text"
        case list():
            return "a list"
        case _:
            return "an object"


# --- in a session -----------------------------------------------------------------------------------------------------


_LONGEST_VALUE = 40
"""Maximum characters of a value in a sentence."""


def study_conditions(scenario: Scenario) -> tuple[str, ...]:
    """The names of the conditions in order; empty: none. Includes bare names without a table, as in scenarios of
    earlier versions."""
    if scenario.conditions:
        return tuple(scenario.conditions)
    found = scenario.study.get("conditions")
    return tuple(name for name in found if isinstance(name, str)) if isinstance(found, list) else ()


def condition_problem(scenario: Scenario, condition: str) -> str:
    """Why a new session cannot run in this condition; empty: it can.

    :param condition: its name; empty (none) is valid in debug mode and for a scenario without conditions.
    """
    known = study_conditions(scenario)
    if not condition:
        if scenario.conditions and scenario.mode == "real":
            return f"a real session is run in a condition of the study: name one of {in_backquotes(known)}"
        return ""
    if condition in scenario.conditions:
        return ""
    if condition in known:
        return f"the condition `{condition}` is only a name; in scenario.toml, {how_to_write(condition)}"
    if known:
        near = did_you_mean(condition, known, limit=0)
        return f"this study has no condition {condition!r}{near}; it has {in_backquotes(known)}"
    problem = f"this scenario has no conditions, and {condition!r} alone would change nothing that the robot does"
    return f"{problem}; in scenario.toml, {how_to_write(condition)}"


def condition_memory(scenario: Scenario, condition: str) -> dict[str, Json]:
    """The memory values that a condition sets, which replace start values; empty for an unknown name."""
    found = scenario.conditions.get(condition)
    return {} if found is None else dict(found.memory)


def condition_label(scenario: Scenario, condition: str) -> str:
    """The name of a condition on screens: its label, or its name."""
    found = scenario.conditions.get(condition)
    return (found.label if found is not None else "") or condition


def condition_sentence(condition: Condition) -> str:
    """Describe what a condition sets: `sets hesitation = true, pause = 600`."""
    if condition.label_only:
        return "sets nothing: the difference lies outside of the robot"
    values = ", ".join(f"{key} = {_value_text(value)}" for key, value in condition.memory.items())
    return f"sets {values}" if values else "sets nothing"


def _value_text(value: Json) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
