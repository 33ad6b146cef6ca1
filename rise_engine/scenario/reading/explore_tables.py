"""Reading `[explore]`, `[always]`, `[reachable]` and `[eventually]` in scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

from functools import partial
from typing import Any, get_args

from rise_engine.expression import Expression, ExpressionError
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.explore_settings import ExploredKeys, ExploreSettings, PropertyKind, StudyProperty
from rise_engine.scenario.files.toml_files import TomlTable, character_location, is_integer
from rise_engine.scenario.model import Json
from rise_engine.scenario.reading.expression_checks import expression_message, note_property
from rise_engine.syntax.toml import toml_key

EXPLORE_KEYS = {
    "end": "the rule whose end is the end of the study; without it, the rule of the first key that starts one",
    "faults": "how many things go wrong on one way, 0 to 5 (1)",
    "line": "how many acts wait at most, 0 to 5 (1)",
    "beside": "how many acts of calling type None run at once, 0 to 5 (2)",
    "pace": 'how many times as long as expected acts take, at least and at most ([0.5, 3.0]); "any": any time',
    "tries": "by memory key, values that somebody may type or a node may write",
    "keys": '"rules" (the usual), or "all": also the keys that start acts by hand',
}
"""The meaning of each entry of `[explore]`, for editors."""
PROPERTY_TABLES: tuple[PropertyKind, ...] = get_args(PropertyKind)
PROPERTY_MEANINGS: dict[PropertyKind, str] = {
    "always": "it holds in every situation",
    "reachable": "it can still come from every situation",
    "eventually": "it happens without help, as acts end and time passes",
}
EVENTUALLY_KEYS = {
    "after": "the situation from which it must happen; without it, from every situation",
    "then": "what happens without help",
    "unless": "what makes it unnecessary",
}
"""The meaning of each part of an entry of `[eventually]`, for editors."""
MOST_AT_ONCE = 5
"""The limit for faults, waiting acts and parallel acts. Each more multiplies the situations by ten."""
MAX_PACE = 1_000.0
_PACE_FORM = 'pace = [0.5, 3.0], or pace = "any"'


def read_explore(settings: TomlTable, draft: ScenarioDraft) -> ExploreSettings:
    """Read `[explore]`, with defaults for missing entries."""
    table = settings.section("explore", EXPLORE_KEYS)
    usual = ExploreSettings()
    return ExploreSettings(
        end=_read_end(table, draft),
        faults=_read_count(table, "faults", usual.faults),
        line=_read_count(table, "line", usual.line),
        beside=_read_count(table, "beside", usual.beside),
        pace=_read_pace(table, usual.pace),
        tries=_read_tries(table, draft),
        keys=_read_keys(table, usual.keys),
    )


def _read_end(table: TomlTable, draft: ScenarioDraft) -> str:
    written = table.read("end", str, None, form=': end = "..."')
    if written is None:
        return ""
    name: str = written.strip()
    if not name:
        message = "`end` is empty; name the rule whose end is the end of the study, or leave `end` out"
        table.report_value("missing-value", "end", message)
        return ""
    locate = partial(character_location, table.file, (*table.path, "end"), written, written.index(name))
    draft.rule_mentions.append(Mention(name, locate))
    return name


def _read_count(table: TomlTable, key: str, usual: int) -> int:
    value = table.values.get(key, usual)
    if not is_integer(value):
        table.report_value("wrong-type", key, f"`{key}` is a whole number: {key} = {usual}")
    elif not 0 <= value <= MOST_AT_ONCE:
        table.report_value("out-of-range", key, f"`{key}` is from 0 to {MOST_AT_ONCE}; this is {value}")
    else:
        return int(value)
    return usual


def _read_pace(table: TomlTable, usual: tuple[float, float] | None) -> tuple[float, float] | None:
    value = table.values.get("pace", usual)
    if value == "any" or value == usual:
        return None if value == "any" else usual
    if not isinstance(value, list) or len(value) != 2 or not all(map(_is_number, value)):
        message = "`pace` says how many times as long as expected acts take, at least and at most"
        table.report_value("wrong-type", "pace", f"{message}: {_PACE_FORM}")
        return usual
    least, most = value
    if not 0 < least <= MAX_PACE or not 0 < most <= MAX_PACE:
        message = f"the numbers of `pace` are more than 0 and at most {MAX_PACE:g}: {_PACE_FORM}"
    elif least > most:
        message = f"the first number of `pace` is the smaller one: pace = [{most:g}, {least:g}]"
    else:
        return float(least), float(most)
    table.report_value("out-of-range", "pace", message)
    return usual


def _is_number(value: Any) -> bool:
    return is_integer(value) or isinstance(value, float)


def _read_tries(table: TomlTable, draft: ScenarioDraft) -> dict[str, tuple[Json, ...]]:
    form = "tries = { KEY = [VALUE, VALUE] }"
    inner = table.subtable("tries", f"`tries` says, by memory key, which values somebody may give it: {form}")
    tries: dict[str, tuple[Json, ...]] = {}
    for key, values in inner.values.items() if inner is not None else ():
        assert inner is not None
        draft.tried_keys.append(Mention(key, partial(inner.key_location, key)))
        if not isinstance(values, list):
            shown = toml_key(key)
            inner.report_value("wrong-type", key, f"`{key}` has a list of values here: {shown} = [VALUE, VALUE]")
        elif not values:
            inner.report_value("missing-value", key, f"no value is tried for `{key}`; name one, or leave it out")
        else:
            tries[key] = tuple(values)
    return tries


def _read_keys(table: TomlTable, usual: ExploredKeys) -> ExploredKeys:
    value = table.values.get("keys", usual)
    if value in get_args(ExploredKeys):
        return "all" if value == "all" else "rules"
    message = '`keys` is "rules", or "all" for those that start acts by hand, too'
    table.report_value("wrong-value", "keys", message)
    return usual


# --- properties -----------------------------------------------------------------------------------------------------


def read_properties(settings: TomlTable, draft: ScenarioDraft) -> tuple[StudyProperty, ...]:
    """Read `[always]`, `[reachable]` and `[eventually]`: the properties of the study, in file order."""
    found: list[StudyProperty] = []
    first: dict[str, str] = {}
    for kind in PROPERTY_TABLES:
        table = settings.section(kind)
        for name in table.values:
            if not name or name.strip() != name or not name.isprintable():
                message = "the name of a property has characters that can be shown, and no blanks around it"
                table.report_key("bad-name", message, name)
            elif name in first:
                message = f"there is another property `{name}` in [{first[name]}]; findings are told by these names"
                table.report_key("duplicate-name", message, name)
            first.setdefault(name, kind)
            each = _PropertyReader(table, name, kind, draft).read()
            if each is not None:
                found.append(each)
    return tuple(sorted(found, key=lambda each: (each.location.line, each.location.column)))


class _PropertyReader:
    """Reads one property."""

    def __init__(self, table: TomlTable, name: str, kind: PropertyKind, draft: ScenarioDraft) -> None:
        self.table = table
        self.name = name
        self.kind = kind
        self.draft = draft
        self.location = table.key_location(name)

    def read(self) -> StudyProperty | None:
        """Read the property; None, after a diagnostic, if it is invalid."""
        shown = toml_key(self.name)
        if self.kind != "eventually":
            condition = self.read_condition(self.table, self.name, f": {shown} = \"in('RULE', 'STATE')\"")
            return StudyProperty(self.kind, self.name, condition, location=self.location) if condition else None
        form = f"{shown} = {{ after = \"in('RULE', 'STATE')\", then = \"runs('ACT')\" }}"
        inner = self.table.subtable(self.name, f"`then` says what happens without help, and `after` from where: {form}")
        if inner is None:
            return None
        inner.report_unknown_keys(EVENTUALLY_KEYS)
        if "then" not in inner.values:
            inner.report_key("missing-value", f"`{self.name}` does not say what happens without help: {form}")
        parts = {key: self.read_condition(inner, key) for key in EVENTUALLY_KEYS if key in inner.values}
        then = parts.get("then")
        if then is None:
            return None
        return StudyProperty(self.kind, self.name, then, parts.get("after"), parts.get("unless"), self.location)

    def read_condition(self, table: TomlTable, key: str, form: str = "") -> Expression | None:
        text = table.values[key]
        if not isinstance(text, str):
            message = f"`{key}` is a condition, in quotation marks{form}"
            table.report_value("wrong-type", key, message)
            return None
        locate = partial(character_location, table.file, (*table.path, key), text)
        try:
            condition = Expression.parse_property(text)
        except ExpressionError as error:
            table.diagnostics.error("condition", locate(error.column - 1), expression_message(error), error.suggestion)
            return None
        if condition.draws:
            message = (
                "what is asked of a situation leaves nothing to chance: write it without `rand`, `shuffle`, `sample`"
            )
            table.report_value("condition", key, message)
            return None
        note_property(condition, locate, self.draft)
        return condition
