"""Memory, keys and settings as fields of a form."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rise_engine.author.edit.edits import AnyEdit, SetSetting, SetStartValue
from rise_engine.author.edit.outline import WrittenAct
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.model import Json
from rise_engine.scenario.reading.robot_profiles import robot_names
from rise_tui.editor.model.acts import act_content
from rise_tui.editor.model.draft import StudyDraft, is_study_alone, toml_values
from rise_tui.editor.model.fields import TYPED, EditField, FieldChoice, no_edits
from rise_tui.rendering.text import format_value, json_type_name, parse_typed_value

KEY_KINDS = ("act", "rule", "event", "set")
"""The functions of a key of the keyboard, in the words of [keys]."""
USUAL_SETTINGS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("title", "the name of the study", ()),
    ("robot", "the name of a profile", ()),
    ("mode", "debug: a simulated robot", ("debug", "real")),
    ("language", "the language of the acts: en, de, …", ()),
    ("on_failure", "when an act fails", ("go_on", "ask", "repeat:1", "repeat:2")),
)
"""Settings that are offered even if they are not given: name, meaning, choices."""
ACT_SETTINGS: tuple[tuple[str, Json, str], ...] = (
    ("calling_type", "None", "runs beside other acts and gives way to them"),
    ("filler", True, "a filler for a pause: offered with the key ,"),
    ("hold", True, "its key must be pressed twice, so that a slip does not start it"),
    ("on_failure", "repeat:1", "after a failure it starts once more"),
    ("on_failure", "ask", "after a failure the console asks what to do"),
)
"""The settings of an act: setting, value, meaning."""


def memory_fields(draft: StudyDraft) -> list[EditField]:
    """Each key with its start value, its type, and the number of its uses."""
    return [
        EditField(key, key, "text", "" if value == "" else format_value(value), edits=partial(_start_value, key),
                  note=f"{json_type_name(value)}; {_used(draft, key)}")
        for key, value in draft.checked.draft.memory.items()
    ]  # fmt: skip


def _used(draft: StudyDraft, key: str) -> str:
    number = sum(not use.defines for use in draft.uses.of("key", key))
    return f"used in {pluralize(number, 'place')}" if number else "not used"


def _start_value(key: str, text: str | None) -> tuple[AnyEdit, ...]:
    value, _, remark = parse_typed_value(text or "")
    if remark:
        raise EditRefused(remark)
    return (SetStartValue(key, value),)


# --- keys -------------------------------------------------------------------------------------------------------------


def key_choices(draft: StudyDraft) -> list[FieldChoice]:
    """Everything that a key can start or raise, each as `KIND NAME`."""
    outline = draft.outline
    found = [FieldChoice(f"act {act.name}", f"act {act.name}", act_content(act)) for act in outline.acts]
    found += [FieldChoice(f"rule {rule.name}", f"rule {rule.name}", pluralize(len(rule.states), "state"))
              for rule in outline.rules]  # fmt: skip
    waits = {transition.form.event.lstrip("/") for rule in outline.rules for state in rule.states
             for transition in state.transitions if transition.form.event}  # fmt: skip
    ends = {f"{name}_end" for name in (*(act.name for act in outline.acts), *(rule.name for rule in outline.rules))}
    found += [
        FieldChoice(f"event /{event}", f"event /{event}", "a rule waits for it") for event in sorted(waits - ends)
    ]
    return found


def key_fields(draft: StudyDraft) -> list[EditField]:
    """Each key of the keyboard with its function and its label."""
    keys, choices = draft.values_in(SCENARIO_FILE).get("keys", {}), key_choices(draft)
    fields = []
    for key, binding in keys.items() if isinstance(keys, dict) else ():
        entry: Mapping[str, Any] = binding if isinstance(binding, dict) else {}
        kind = next((each for each in KEY_KINDS if each in entry), "")
        text = f"{kind} {entry[kind]}" if kind else ""
        more = {name: value for name, value in entry.items() if name not in (kind, "label")}
        label = entry.get("label", "")
        note = f"“{label}”" if label else ""
        note += "".join(f"  {name} = {json.dumps(value, ensure_ascii=False)}" for name, value in more.items())
        fields.append(
            EditField(key, key, "choice", text, choices=choices, new=TYPED, note=note,
                      reason="" if kind else "no form for this: e opens the file",
                      edits=partial(_key_edits, key, entry))
        )  # fmt: skip
    return fields


def new_key_edits(key: str, text: str) -> tuple[AnyEdit, ...]:
    """Return the edits that give an unused key a function: `act R_Hello`, `set score = 1`.

    :raises EditRefused: a key cannot do this.
    """
    return _key_edits(key, {}, text)


def _key_edits(key: str, entry: Mapping[str, Any], text: str | None) -> tuple[AnyEdit, ...]:
    """Change a key's function. The old label is removed, because it described the old function."""
    if text is None:
        return (SetSetting(("keys", key), None),)
    kind, _, name = text.partition(" ")
    if kind not in KEY_KINDS or not name.strip():
        raise EditRefused(f"write an act, a rule, an event or a value: “act NAME”, “set score = 1”; not “{text}”")
    before = next((each for each in KEY_KINDS if each in entry), "")
    if kind == before:
        return (SetSetting(("keys", key, kind), name.strip()),)
    return (SetSetting(("keys", key), {kind: name.strip()}),)


# --- settings ---------------------------------------------------------------------------------------------------------


def setting_fields(draft: StudyDraft) -> list[EditField]:
    """The settings of scenario.toml, and of study.toml if it exists, except the keys."""
    if is_study_alone(draft):
        return list(_leaves(STUDY_FILE, draft.values_in(STUDY_FILE)))
    values = draft.values_in(SCENARIO_FILE)
    fields = []
    for name, help, options in USUAL_SETTINGS:
        value = values.get(name)
        names = robot_names(Path(draft.folder)) if name == "robot" else options
        choices = tuple(FieldChoice(each, each) for each in names)
        fields.append(
            EditField(name, name, "choice" if choices else "text", None if value is None else _shown(value),
                      note=help, choices=choices, new=TYPED if name in ("robot", "on_failure") else "",
                      edits=partial(_setting, SCENARIO_FILE, (name,), str))
        )  # fmt: skip
    fields += [_private_field(values.get("private")), *_keep_fields(values.get("keys"))]
    usual = {*(name for name, _, _ in USUAL_SETTINGS), "keys", "private"}
    fields += _leaves(SCENARIO_FILE, {name: value for name, value in values.items() if name not in usual})
    if STUDY_FILE in draft.files:
        fields += _leaves(STUDY_FILE, draft.values_in(STUDY_FILE))
    for path, data in draft.above.items():
        fields += _shown_only(path, data)
    return fields


def _private_field(given: Any) -> EditField:
    """The memory keys about a person, separated by commas."""

    def edits(text: str | None) -> tuple[AnyEdit, ...]:
        keys = [each.strip() for each in (text or "").split(",") if each.strip()]
        return (SetSetting(("private",), keys or None),)

    shown = ", ".join(map(str, given)) if isinstance(given, list) else None
    return EditField("private", "private", "text", shown, note="memory keys about a person: name, age", edits=edits)


def _keep_fields(keys: Any) -> Iterator[EditField]:
    """The time that the event of each key is kept for a rule."""
    for key, entry in keys.items() if isinstance(keys, dict) else ():
        if isinstance(entry, dict) and "event" in entry:
            keep = entry.get("keep")
            yield EditField(
                f"keep\0{key}", f"keep of {key}", "text", None if keep is None else _shown(keep),
                note=f"how long {entry['event']} waits for a rule: 3s", edits=partial(_keep, key),
            )  # fmt: skip


def _keep(key: str, text: str | None) -> tuple[AnyEdit, ...]:
    return (SetSetting(("keys", key, "keep"), text or None),)


def _shown_only(path: str, data: bytes) -> Iterator[EditField]:
    """The settings of the study.toml in a folder above. They are read-only, because they belong to the whole study, and
    a plan may depend on them."""
    yield EditField(path, "study", shown=path, note="this scenario is part of that study; e opens it")
    values = toml_values(data)
    if not values:
        yield EditField(f"{path}\0", "study", shown="it cannot be read", note="rise-engine study check says why")
        return
    for field in _leaves(path, values):
        yield field._replace(kind="fixed", edits=no_edits, note=f"{field.label}; study.toml above")


class Addition(NamedTuple):
    """An entry that can be added to the settings."""

    choice: FieldChoice
    make: Callable[[str], tuple[SetSetting, str]]
    """Makes the edit for the typed text, and the id of the field that then shows it."""
    title: str = ""
    """The title of its question; empty: no question."""
    hint: str = ""


def additions(draft: StudyDraft) -> list[Addition]:
    """All entries that can be added to scenario.toml, and to study.toml if it exists."""
    found = [
        Addition(FieldChoice(f"{each.name} {setting} {value}", f"{each.name}  {setting} = {_shown(value)}", help),
                 partial(_add, SCENARIO_FILE, ("act", each.name, setting), value))
        for each, setting, value, help in _missing_act_settings(draft)
    ]  # fmt: skip
    return found + (list(_study_additions(draft.values_in(STUDY_FILE))) if STUDY_FILE in draft.files else [])


def _add(file: str, path: tuple[str, ...], value: Json, _typed: str = "") -> tuple[SetSetting, str]:
    return SetSetting(path, value, file=file), "\0".join((file, *path))


def _missing_act_settings(draft: StudyDraft) -> Iterator[tuple[WrittenAct, str, Json, str]]:
    """Settings of single acts that are not set yet."""
    given = _table(draft.values_in(SCENARIO_FILE).get("act"))
    for act in draft.outline.acts:
        for setting, value, help in ACT_SETTINGS:
            if _table(given.get(act.name)).get(setting) != value:
                yield act, setting, value, help


def _study_additions(values: Mapping[str, Any]) -> Iterator[Addition]:
    """Entries for a study: a check, a factor, and for each factor a level and a level's start value."""

    def add_check(typed: str) -> tuple[SetSetting, str]:
        given = values.get("check")
        number = len(given) if isinstance(given, list) else 0
        value: Json = {"id": f"check{number + 1}", "ask": typed, "when": "before"}
        edit = (
            SetSetting(("check", str(number)), value, file=STUDY_FILE)
            if number
            else SetSetting(("check",), [value], file=STUDY_FILE)
        )
        return edit, f"{STUDY_FILE}\0check\0{number}\0id"

    def add_factor(typed: str) -> tuple[SetSetting, str]:
        name, _, listed = typed.partition(":")
        levels = [each.strip() for each in listed.split(",") if each.strip()]
        if not name.strip() or len(set(levels)) < 2:
            raise EditRefused(f"A factor has a name and at least two levels: “noise: quiet, loud”; not “{typed}”")
        value: Json = {"kind": "between", "levels": {each: {} for each in levels}}
        edit, id = _add(STUDY_FILE, ("factors", name.strip()), value)
        return edit, f"{id}\0kind"

    def add_level(factor: str, typed: str) -> tuple[SetSetting, str]:
        if typed in _table(_table(factors.get(factor)).get("levels")):
            raise EditRefused(f"{factor} has a level “{typed}” already")
        return _add(STUDY_FILE, ("factors", factor, "levels", typed), {})

    def add_value(factor: str, level: str, typed: str) -> tuple[SetSetting, str]:
        key, equals, text = (each.strip() for each in typed.partition("="))
        value, _, problem = parse_typed_value(text)
        if not key or not equals or problem:
            raise EditRefused(problem or f"Write a memory key and its value: “distraction = true”; not “{typed}”")
        return _add(STUDY_FILE, ("factors", factor, "levels", level, "memory", key), value)

    yield Addition(FieldChoice("check", "a check", "confirmed before each session"), add_check, "A new check",
                   "The statement to confirm before a session: The door is closed")  # fmt: skip
    yield Addition(FieldChoice("factor", "a factor", "what differs between sessions"), add_factor, "A new factor",
                   "Its name and its levels, as noise: quiet, loud")  # fmt: skip
    factors = _table(values.get("factors"))
    for factor, table in factors.items():
        levels = _table(_table(table).get("levels"))
        yield Addition(FieldChoice(f"level {factor}", f"a level of {factor}", "beside " + ", ".join(levels)),
                       partial(add_level, factor), f"A new level of {factor}", "Its name: loud")  # fmt: skip
        for level in levels:
            yield Addition(
                FieldChoice(f"value {factor} {level}", f"a start value of {factor} = {level}", "in its sessions only"),
                partial(add_value, factor, level), f"A start value of {factor} = {level}",
                "A memory key and its value: distraction = true")  # fmt: skip


def _table(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _leaves(file: str, values: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[EditField]:
    for name, value in values.items():
        at = (*path, name)
        if isinstance(value, dict) and value:
            yield from _leaves(file, value, at)
        elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
            for number, each in enumerate(value):
                yield from _leaves(file, each, (*at, str(number)))
        elif _is_plain(value):
            yield EditField(
                f"{file}\0" + "\0".join(at), ".".join(at), "text", _shown(value),
                note=f"{'.'.join(at)}, {json_type_name(value)}; {file}" if path else f"{json_type_name(value)}; {file}",
                edits=partial(_setting, file, at, str if isinstance(value, str) else type(value)),
            )  # fmt: skip
        else:
            label = ".".join(at)
            shown, note = ("nothing", f"{label}; a adds a start value") if value == {} else ("…", "e opens the file")
            yield EditField("\0".join((file, *at)), label, "fixed", shown=shown, note=note)


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(isinstance(each, str | int | float | bool) for each in value)
    return isinstance(value, str | int | float | bool)


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else format_value(value)


def _setting(file: str, path: tuple[str, ...], kind: type, text: str | None) -> tuple[AnyEdit, ...]:
    """The edit of a setting. A text stays a text, even if it looks like a number; other values keep their type."""
    if text is None or kind is str:
        return (SetSetting(path, text, file=file),)
    value, name, _ = parse_typed_value(text)
    both = isinstance(value, int | float) and not isinstance(value, bool) and kind in (int, float)
    if not both and not isinstance(value, kind):
        wanted = json_type_name(kind())
        article = "an" if wanted[0] in "aeiou" else "a"
        raise EditRefused(f"{'.'.join(path)} is {article} {wanted}; “{text}” is {name}")
    return (SetSetting(path, value, file=file),)
