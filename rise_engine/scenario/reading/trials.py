"""Reading `[trials]` in scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rise_engine.base.nearest_name import suggest
from rise_engine.expression import Expression, ExpressionError
from rise_engine.expression.nodes import Key, Part
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import Mention, ScenarioDraft
from rise_engine.scenario.files.toml_files import TomlTable, character_location
from rise_engine.scenario.model import Rule, SourceLocation, normal_topic
from rise_engine.scenario.reading.expression_checks import expression_message, note_property
from rise_engine.scenario.trial_settings import MEASURES, PARTICIPANT, TRIAL_KEYS, TrialSettings, fits_state


def states_named(written: str, rules: Mapping[str, Rule]) -> list[tuple[str, str]]:
    """The states that `written` matches, each with its rule."""
    return [
        (rule.name, state) for rule in rules.values() for state in rule.states if fits_state(written, rule.name, state)
    ]


def read_trials(settings: TomlTable, draft: ScenarioDraft) -> TrialSettings | None:
    """Read `[trials]`; None if scenario.toml has none, or if it does not say what begins a trial.

    :param settings: scenario.toml.
    :param draft: gets the names in it.
    """
    if "trials" not in settings.values:
        return None
    table = settings.section("trials", TRIAL_KEYS)
    state = (table.read("state", str, "", form=': state = "Ask"') or "").strip()
    key = _read_value(table, ("key",), table.values["key"], draft) if "key" in table.values else None
    if state and "key" in table.values:
        table.report_key(
            "wrong-value", "a trial begins at a `state` or with a `key`, not with both; leave one out", "key"
        )
    elif not state and "key" not in table.values:
        message = '[trials] does not say what begins a trial: state = "STATE" of a rule, or key = "KEY" of the memory'
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
