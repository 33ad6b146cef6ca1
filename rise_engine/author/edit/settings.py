"""Edits of TOML files: `scenario.toml`, `study.toml`, the settings of a table, pronunciations, translations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rise_engine.author.edit.edits import Edit, RenameSetting, SetSetting
from rise_engine.author.edit.memory import value_text
from rise_engine.author.edit.plan import EditedText, EditRefused, Plan, StudyState
from rise_engine.author.edit.rename_data import pressed_key_splices
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, why_no_name
from rise_engine.syntax.changes import edits_between
from rise_engine.syntax.toml import KeyPath
from rise_engine.syntax.toml_edits import TomlText, remove_value, rename_key, set_value


def plan_set_setting(edit: SetSetting, study: StudyState) -> Plan:
    """Plan a value of a TOML file; None removes the entry. A missing file is created.

    :raises EditRefused: it is not TOML, or has no place for this.
    """
    _check_path(edit.file, edit.path)
    file = _file(study, edit.file, new=edit.value is not None)
    with file.refusing():
        before = TomlText(file.text)
        old = before.find(edit.path)
        if edit.value is None:
            after = remove_value(file.text, edit.path)
            says = f"{_label(edit)} is not set any more (was {value_text(old)})"
        else:
            after = set_value(file.text, edit.path, edit.value)
            was = "new" if old is None else f"was {value_text(old)}"
            says = f"{_label(edit)} {_is_in_words(edit, edit.value)} ({was})"
    _check_outcome(file, after, _with(before.values, edit.path, edit.value))
    noticed = _comments_gone(file, after)
    if edit.file not in study.files:
        return Plan(written={edit.file: after.encode()}, says=(says,))
    return Plan(splices=file.splices(edits_between(file.text, after)), says=(says,), noticed=noticed)


def plan_rename_setting(edit: RenameSetting, study: StudyState) -> Plan:
    """Plan another name for an entry of a TOML file, in its place. For a key of the keyboard, tests are updated.

    :raises EditRefused: the entry does not exist, or the new name is taken.
    """
    _check_path(edit.file, (*edit.path, edit.name))
    file = _file(study, edit.file)
    with file.refusing():
        before = TomlText(file.text)
        after = rename_key(file.text, edit.path, edit.name)
    wanted = _with(before.values, edit.path, None)
    _check_outcome(file, after, _with(wanted, (*edit.path[:-1], edit.name), before.find(edit.path)))
    says = f"{_label(edit)} is called {edit.name} now"
    splices = file.splices(edits_between(file.text, after))
    if edit.file == SCENARIO_FILE and edit.path[:-1] == ("keys",):
        for name in sorted(study.files):
            if name.startswith("tests/") and name.endswith(".jsonl"):
                test = EditedText(name, study.files[name])
                splices += pressed_key_splices(test, edit.path[-1], edit.name)
    return Plan(splices=splices, says=(says,))


def _check_path(file: str, path: KeyPath) -> None:
    if problem := why_no_name(file, (".toml",)):
        raise EditRefused(problem)
    if not path or not all(isinstance(part, str) and part for part in path):
        raise EditRefused("say which entry is meant: a path of names, none of them empty")


def _file(study: StudyState, name: str, *, new: bool = False) -> EditedText:
    if name in study.files:
        return EditedText(name, study.files[name])
    if new:
        return EditedText(name, b"")
    raise EditRefused(f"there is no file {name} in this study")


def _check_outcome(file: EditedText, after: str, wanted: dict[str, Any]) -> None:
    """Check that the file has the intended values, and otherwise its old ones. (Empty tables may be missing.)

    :raises EditRefused: it has other values, because the program cannot edit its form.
    """
    try:
        is_right = _typed(TomlText(after).values) == _typed(wanted)
    except EditRefused:
        is_right = False
    if not is_right:
        raise EditRefused(f"{file.name} is written in a way that cannot be changed here; change it with an editor")


def _typed(value: Any) -> Any:
    """Make values comparable: 1, 1.0 and true differ; empty tables and lists are ignored."""
    if isinstance(value, dict):
        inner = {key: _typed(each) for key, each in value.items()}
        return {key: each for key, each in inner.items() if each not in ({}, [])}
    if isinstance(value, list | tuple):
        return [_typed(each) for each in value]
    return type(value).__name__, value


def _comments_gone(file: EditedText, after: str) -> tuple[str, ...]:
    """Report the comments within the removed part."""
    kept = [line.strip() for line in after.splitlines()]
    gone = []
    for number, line in enumerate(file.text.splitlines(), 1):
        at = line.find("#")
        comment = line[at:].strip()
        if at >= 0 and not any(each.endswith(comment) for each in kept):
            gone.append(f"the comment in {file.name}, line {number}, is removed with it: {comment}")
    return tuple(gone)


def _with(values: Any, path: KeyPath, value: Any) -> Any:
    """Return values with an entry set, or without it for None."""
    if not path:
        return value
    name, *rest = path
    if isinstance(values, list):
        at = int(name)
        inner = _with(values[at] if at < len(values) else {}, tuple(rest), value)
        return [*values[:at], *([] if inner is None else [inner]), *values[at + 1 :]]
    inner = _with(values.get(name, {}), tuple(rest), value)
    return {key: each for key, each in {**values, name: inner}.items() if each is not None}


_KEY_WORDS = {"act": "starts the act", "rule": "starts the rule", "event": "raises the event", "set": "sets"}


def _is_in_words(edit: SetSetting, value: Any) -> str:
    """Describe an entry's value: `is "Greeting"`; for a key of the keyboard its function: `starts the act R_Nod`."""
    if edit.file == SCENARIO_FILE and edit.path[:1] == ("keys",) and len(edit.path) == 2 and isinstance(value, dict):
        kind = next((each for each in _KEY_WORDS if each in value), "")
        if kind:
            label = f", called “{value['label']}”" if "label" in value else ""
            return f"{_KEY_WORDS[kind]} {value[kind]}{label}"
    return f"is {value_text(value)}"


def _label(edit: SetSetting | RenameSetting) -> str:
    """Describe the changed entry."""
    path = edit.path
    match path:
        case ("keys", key) if edit.file == "scenario.toml":
            return f"key {key}"
        case ("keys", key, *rest) if edit.file == "scenario.toml":
            return f"key {key}: {'.'.join(rest)}"
        case ("act", act, *rest) if edit.file == "scenario.toml" and rest:
            return f"act {act}: {'.'.join(rest)}"
        case ("conditions", name, *rest) if edit.file == "scenario.toml":
            return f"condition {name}" + (f": {'.'.join(rest)}" if rest else "")
    where = "" if edit.file == "scenario.toml" else f"{edit.file}: "
    return where + ".".join(path)


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetSetting: plan_set_setting,
    RenameSetting: plan_rename_setting,
}
