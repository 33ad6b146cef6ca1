"""Reads `[explore]`, `[always]`, `[reachable]`, `[eventually]` and `[trials]` (docs/reference/scenario.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, get_args

from rise_engine.base.nearest_name import suggest
from rise_engine.expression import Expression, ExpressionError
from rise_engine.expression.nodes import Key, Part
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.explore_settings import (
    MEASURES,
    PARTICIPANT,
    ExploredKeys,
    ExploreSettings,
    PropertyKind,
    StudyProperty,
    TrialSettings,
    fits_state,
)
from rise_engine.scenario.files.toml_files import TomlTable, character_location, is_integer
from rise_engine.scenario.model import Json, Rule, SourceLocation, normal_topic
from rise_engine.scenario.reading.expression_checks import expression_message, note_property
from rise_engine.scenario.settings import SCENARIO_TABLES, names_in
from rise_engine.syntax.toml import toml_key

PROPERTY_TABLES: tuple[PropertyKind, ...] = get_args(PropertyKind)
_EVENTUALLY_KEYS = tuple(names_in(SCENARIO_TABLES, "eventually.*"))
_TRIAL_KEYS = tuple(names_in(SCENARIO_TABLES, "trials"))
MAX_AT_ONCE = 5
"""The limit for faults, waiting acts and parallel acts. Each more multiplies the situations by ten."""
MAX_PACE = 1_000.0
_PACE_FORM = 'pace = [0.5, 3.0], or pace = "any"'


def read_explore(settings: TomlTable, draft: ScenarioDraft) -> ExploreSettings:
    """Read `[explore]`, with defaults for missing entries."""
    table = settings.section("explore", names_in(SCENARIO_TABLES, "explore"))
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
    elif not 0 <= value <= MAX_AT_ONCE:
        table.report_value("out-of-range", key, f"`{key}` is from 0 to {MAX_AT_ONCE}; this is {value}")
    else:
        return int(value)
    return usual


def _read_pace(table: TomlTable, usual: tuple[float, float] | None) -> tuple[float, float] | None:
    value = table.values.get("pace", usual)
    if value == "any" or value == usual:
        return None if value == "any" else usual
    if not isinstance(value, list) or len(value) != 2 or not all(map(_is_number, value)):
        message = "`pace` is the least and greatest duration of acts, as multiples of the expected one"
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
    inner = table.subtable("tries", f"`tries` lists the values that somebody may give a memory key: {form}")
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
                message = f"there is another property `{name}` in [{first[name]}]; choose another name"
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
        inner.report_unknown_keys(_EVENTUALLY_KEYS)
        if "then" not in inner.values:
            inner.report_key("missing-value", f"`{self.name}` does not say what happens without help: {form}")
        parts = {key: self.read_condition(inner, key) for key in _EVENTUALLY_KEYS if key in inner.values}
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
            message = "a property cannot depend on chance: write it without `rand`, `shuffle`, `sample`"
            table.report_value("condition", key, message)
            return None
        note_property(condition, locate, self.draft)
        return condition


# --- trials -----------------------------------------------------------------------------------------------------------


def states_named(written: str, rules: Mapping[str, Rule]) -> list[tuple[str, str]]:
    """The states that `written` matches, each with its rule."""
    return [
        (rule.name, state) for rule in rules.values() for state in rule.states if fits_state(written, rule.name, state)
    ]


def read_trials(settings: TomlTable, draft: ScenarioDraft) -> TrialSettings | None:
    """Read `[trials]`; None: scenario.toml has none, or no start of a trial.

    :param settings: scenario.toml.
    :param draft: gets the names in it.
    """
    if "trials" not in settings.values:
        return None
    table = settings.section("trials", _TRIAL_KEYS)
    state = (table.read("state", str, "", form=': state = "Ask"') or "").strip()
    key = _read_value(table, ("key",), table.values["key"], draft) if "key" in table.values else None
    if state and "key" in table.values:
        table.report_key(
            "wrong-value", "a trial begins at a `state` or with a `key`, not with both; leave one out", "key"
        )
    elif not state and "key" not in table.values:
        message = '[trials] does not say what begins a trial: state = "STATE" of a rule, or key = "KEY" of the memory'
        if set(table.values) <= set(_TRIAL_KEYS):  # a mistyped `state` has its own error
            table.report_key("missing-value", message)
        return None
    if key is not None and not isinstance(key.root, Key):
        table.report_value("wrong-value", "key", "`key` is a memory key, whose change begins a trial")
    if state:
        draft.trial_states.append(Mention(state, partial(table.value_location, "state")))
    columns, speech = _read_columns(table, draft), _read_speech(table)
    if not state and key is None:
        return None
    return TrialSettings(state, key, columns, _read_measure(table, columns), speech)


def _read_columns(table: TomlTable, draft: ScenarioDraft) -> tuple[Expression, ...]:
    written = table.values.get("columns", [])
    if not isinstance(written, list):
        table.report_value("wrong-type", "columns", '`columns` is a list of memory keys: columns = ["item"]')
        return ()
    found: dict[str, Expression] = {}
    for index, text in enumerate(written):
        value = _read_value(table, ("columns", str(index)), text, draft)
        if value is not None and value.text in found:
            location = table.value_location("columns", str(index))
            table.diagnostics.error("duplicate-name", location, f"`{value.text}` is listed twice")
        elif value is not None:
            found[value.text] = value
    return tuple(found.values())


def _read_value(table: TomlTable, path: tuple[str, ...], text: Any, draft: ScenarioDraft) -> Expression | None:
    """Read a memory key, or a part of a value (`items[i].text`)."""
    location = table.value_location(*path)
    if not isinstance(text, str) or not text.strip():
        table.diagnostics.error("wrong-type", location, f"`{path[0]}` names memory keys, in quotation marks")
        return None
    locate = partial(character_location, table.file, (*table.path, *path), text)
    try:
        value = Expression.parse(text)
    except ExpressionError as error:
        table.diagnostics.error("condition", locate(error.column - 1), expression_message(error), error.suggestion)
        return None
    if not isinstance(value.root, Key | Part):
        message = f"`{text}` is not a memory key, and not a part of a value such as `items[i].text`"
        table.diagnostics.error("wrong-value", location, message)
        return None
    note_property(value, locate, draft)
    return value


def _read_speech(table: TomlTable) -> str:
    topic = normal_topic(table.read("speech", str, "", form=': speech = "/speech_begins"') or "")
    if not topic and "speech" in table.values:
        message = "`speech` names the event that a program raises when the participant begins to speak"
        table.report_value("missing-value", "speech", message)
    return topic


def _read_measure(table: TomlTable, columns: Iterable[Expression]) -> str:
    measure: str = table.read("measure", str, PARTICIPANT, form=f': measure = "{PARTICIPANT}"')
    known = [*MEASURES, *(column.text for column in columns)]
    if measure not in known:
        message = f"`{measure}` is not a column of trials that is a number: {', '.join(known)}"
        table.report_value("unknown-name", "measure", message, suggest(measure, known))
    return measure


def check_trials(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Check that the state that begins trials exists, in one rule. Only for a draft whose rules could all be read."""
    for mention in draft.trial_states:
        _check_state(mention.name, draft.rules, mention.locate, diagnostics)


def _check_state(
    written: str, rules: Mapping[str, Rule], locate: Callable[[], SourceLocation], diagnostics: Diagnostics
) -> None:
    found = states_named(written, rules)
    if not found:
        names = {state for rule in rules.values() for state in rule.states}
        names |= {f"{rule.name}/{state}" for rule in rules.values() for state in rule.states}
        near = suggest(written, sorted(names), limit=0)
        code = unknown_code("unknown-state", written, names)
        diagnostics.error(code, locate(), f"no rule has the state `{written}`, so no trial ever begins", near)
    elif len({rule for rule, _ in found}) > 1 and "*" not in written:
        several = " and ".join(f"`{rule}/{state}`" for rule, state in found)
        diagnostics.error("wrong-value", locate(), f"several rules have this state: write one of {several}")
