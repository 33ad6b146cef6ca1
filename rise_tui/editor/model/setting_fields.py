"""The settings of scenario.toml and study.toml as fields of a form: each with its meaning, also those not given."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from rise_engine.author.edit.edits import AnyEdit, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_engine.scenario.explore_settings import MEASURES
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.model import Json
from rise_engine.scenario.reading.robot_profiles import robot_names
from rise_engine.scenario.settings import (
    ANY,
    SCENARIO_TABLES,
    Setting,
    SettingKind,
    SettingTable,
    names_in,
    table_at,
)
from rise_engine.study.balance import prove_balance
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.plan import make_plan, rows_wanted, strata_of
from rise_engine.study.recording_table import recorder_drivers
from rise_engine.study.settings import STUDY_TABLES
from rise_engine.study.study_toml import load_study
from rise_engine.syntax.toml import entries_in, value_at
from rise_tui.editor.model.draft import StudyDraft, is_study_alone, toml_values
from rise_tui.editor.model.fields import NOT_GIVEN, TYPED, EditField, FieldChoice, FieldKind, no_edits
from rise_tui.rendering.text import format_value, json_type_name, parse_typed_value

SettingPath: TypeAlias = tuple[str, ...]
"""The keys of an entry, with the numbers of entries of lists."""
TABLES: dict[str, Sequence[SettingTable]] = {SCENARIO_FILE: SCENARIO_TABLES, STUDY_FILE: STUDY_TABLES}
YES_OR_NO = {"yes": True, "no": False}
OPEN_CHOICES = ("robot", "on_failure", "by")
"""Settings that can have another value than their choices."""


def setting_fields(draft: StudyDraft) -> list[EditField]:
    """The settings in the order of their tables, each table after a heading. Keys have a page of their own."""
    files = [file for file in TABLES if file in draft.files]
    if SCENARIO_FILE not in files and not is_study_alone(draft):
        files.insert(0, SCENARIO_FILE)
    fields = [field for file in files for field in _file_fields(draft, file)]
    for path, data in draft.above.items():
        fields += _shown_only(path, data)
    return fields


def setting_id(file: str, path: SettingPath) -> str:
    """The id of the field of a setting."""
    return "\0".join((file, *path))


def _file_fields(draft: StudyDraft, file: str) -> Iterator[EditField]:
    values = draft.values_in(file)
    for path, table in _groups(values, TABLES[file]):
        fields = list(_table_fields(draft, file, path, table, values))
        if fields:
            yield _heading(file, values, path, table.meaning)
            yield from fields


def _heading(file: str, values: Mapping[str, Any], path: SettingPath, meaning: str) -> EditField:
    """The names of a table's path. Tables of a list are counted from 1."""
    names = [
        str(int(part) + 1) if isinstance(value_at(values, path[:at]), list) else part for at, part in enumerate(path)
    ]
    return EditField("", " ".join(names) or file, "heading", note=meaning)


def _groups(values: Mapping[str, Any], tables: Sequence[SettingTable]) -> list[tuple[SettingPath, SettingTable]]:
    """The tables that the form shows, with their paths: those of the top, and inner ones that are given."""
    found = [
        (path, table)
        for table in tables
        for path in _paths(values, table.path.split(".") if table.path else [])
        if table_at(tables, path) is table and (len(path) < 2 or isinstance(value_at(values, path), dict))
    ]
    tops = list(dict.fromkeys(table.path.partition(".")[0] for table in tables))

    def place(group: tuple[SettingPath, SettingTable]) -> tuple[int, ...]:
        path = group[0]
        return (tops.index(path[0]) if path else -1, *_positions(values, path))

    return sorted(found, key=place)


def _positions(values: Any, path: SettingPath) -> Iterator[int]:
    for part in path:
        names = list(entries_in(values))
        yield names.index(part) if part in names else len(names)
        values = entries_in(values).get(part)


def _paths(values: Any, parts: Sequence[str], path: SettingPath = ()) -> Iterator[SettingPath]:
    """The paths of a pattern. A name need not be given; `*` stands for each name that is."""
    if not parts:
        yield path
        return
    for name in entries_in(values) if parts[0] == ANY else parts[:1]:
        yield from _paths(entries_in(values).get(name), parts[1:], (*path, name))


def _table_fields(
    draft: StudyDraft, file: str, path: SettingPath, table: SettingTable, values: Mapping[str, Any]
) -> Iterator[EditField]:
    given, tables = entries_in(value_at(values, path)), TABLES[file]
    shown = {*names_in(tables, table.path)}
    for setting in table.settings:
        parts = setting.path.split(".")[len(path) :]
        for at in _paths(given, parts):
            value = value_at(given, at)
            if not (isinstance(value, dict) and table_at(tables, (*path, *at))):  # its own group shows it
                yield _setting_field(draft, file, (*path, *at), len(path), setting, value)
            shown.add(at[0])
    if path == ("keys",):
        yield from _keep_fields(given)
    else:
        others = {name: value for name, value in given.items() if name not in shown}
        yield from _leaves(file, others, path)


def _setting_field(
    draft: StudyDraft, file: str, path: SettingPath, depth: int, setting: Setting, value: Any
) -> EditField:
    known = dict.fromkeys(YES_OR_NO, "") if setting.kind == "yes or no" else setting.choices
    choices = tuple(FieldChoice(name, name, help) for name, help in (known or _known_values(draft, path)).items())
    kind: FieldKind = "text"
    if setting.kind == "names" and choices:
        kind = "many"
    elif choices and path[0] != "trials":
        kind = "choice"
    return EditField(
        setting_id(file, path), ".".join(path[depth:]), kind, None if value is None else _text_of(value, setting.kind),
        note=setting.meaning, choices=choices, new=TYPED if path[-1] in OPEN_CHOICES else "",
        empty=setting.usual or NOT_GIVEN, edits=partial(_setting_edits, file, path, setting.kind),
    )  # fmt: skip


def _known_values(draft: StudyDraft, path: SettingPath) -> Mapping[str, str]:
    """What a setting can name, as far as it is known, each with its meaning."""
    match path:
        case ("robot",):
            return dict.fromkeys(robot_names(Path(draft.folder)), "")
        case ("private",) | ("trials", "key"):
            return dict.fromkeys(draft.checked.draft.memory, "")
        case ("trials", "state"):
            return {f"{rule.name}/{state.id}": "" for rule in draft.outline.rules for state in rule.states}
        case ("trials", "measure"):
            return dict.fromkeys(MEASURES, "")
        case ("explore", "end"):
            return dict.fromkeys((rule.name for rule in draft.outline.rules), "")
        case ("check", _, "auto"):
            return AUTOMATIC
        case ("assignment", "strata"):
            return dict.fromkeys(entries_in(draft.values_in(STUDY_FILE).get("strata")), "")
        case ("recording", _, "by"):
            return dict.fromkeys(recorder_drivers(), "")
    return {}


def _text_of(value: Any, kind: SettingKind) -> str:
    if kind == "yes or no" and isinstance(value, bool):
        return "yes" if value else "no"
    if kind in ("names", "whole numbers") and isinstance(value, list) and not any("," in str(each) for each in value):
        return ", ".join(map(_shown, value))
    return _shown(value)


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else format_value(value)


def _setting_edits(file: str, path: SettingPath, kind: SettingKind, text: str | None) -> tuple[AnyEdit, ...]:
    """The edit that gives a setting this text.

    :raises EditRefused: it is none of this kind.
    """
    return (SetSetting(path, None if text is None else _value_of(path[-1], kind, text), file=file),)


def _value_of(name: str, kind: SettingKind, text: str) -> Json:
    if kind == "text":
        return text
    if kind == "yes or no":
        if text not in YES_OR_NO:
            raise EditRefused(f"{name} is yes or no; not “{text}”")
        return YES_OR_NO[text]
    if kind == "value":
        return parse_typed_value(text)[0]
    if kind == "names" and text.startswith("["):  # a name with a comma
        return parse_typed_value(text)[0]
    parts = [each.strip() for each in text.split(",") if each.strip()]
    if kind == "names":
        return list(parts)
    numbers = [parse_typed_value(each)[0] for each in parts]
    wanted = int if kind.startswith("whole") else int | float
    if not numbers or any(isinstance(each, bool) or not isinstance(each, wanted) for each in numbers):
        form = "whole numbers with commas between them" if kind == "whole numbers" else f"a {kind}"
        raise EditRefused(f"{name} is {form}; not “{text}”")
    if kind != "whole numbers" and len(numbers) > 1:
        raise EditRefused(f"{name} is one {kind}; not “{text}”")
    return numbers if kind == "whole numbers" else numbers[0]


def _keep_fields(keys: Mapping[str, Any]) -> Iterator[EditField]:
    """The time that the event of each key waits for a rule."""
    for key, entry in keys.items():
        if isinstance(entry, dict) and "event" in entry:
            path = ("keys", key, "keep")
            yield EditField(
                setting_id(SCENARIO_FILE, path), f"keep of {key}", "text", entry.get("keep"), empty="not at all",
                note=f"How long {entry['event']} waits for a rule: 3s",
                edits=partial(_setting_edits, SCENARIO_FILE, path, "text"),
            )  # fmt: skip


def _leaves(file: str, values: Mapping[str, Any], path: SettingPath) -> Iterator[EditField]:
    """Entries without a form of their own, such as those of [actions]."""
    for name, value in values.items():
        at = (*path, name)
        if isinstance(value, dict) and value:
            yield from _leaves(file, value, at)
        elif isinstance(value, str | int | float | bool):
            kind: SettingKind = "text" if isinstance(value, str) else "value"
            note, edits = f"{json_type_name(value)}; {file}", partial(_setting_edits, file, at, kind)
            yield EditField(setting_id(file, at), ".".join(at), "text", _shown(value), note=note, edits=edits)
        else:
            yield EditField(setting_id(file, at), ".".join(at), shown="…", note="e opens the file")


def _shown_only(path: str, data: bytes) -> Iterator[EditField]:
    """The settings of the study.toml in a folder above. They are read-only, because they belong to the whole study, and
    a plan may depend on them."""
    yield EditField(path, "study", shown=path, note="this scenario is part of that study; e opens it")
    values = toml_values(data)
    if not values:
        yield EditField(f"{path}\0", "study", shown="it cannot be read", note="rise-engine study check says why")
    for field in _leaves(path, values, ()):
        yield field._replace(kind="fixed", edits=no_edits, note="study.toml above")


# --- effects ----------------------------------------------------------------------------------------------------------


DESIGN = ("n", "seed", "factors", "assignment", "strata")
"""Entries of study.toml that the plan depends on."""
MAX_PLANNED = 1_000
"""Rows of a plan that is made while somebody types."""


def depends_on_design(field: EditField) -> bool:
    """Whether the plan of the study depends on a setting."""
    file, _, path = field.id.partition("\0")
    return file == STUDY_FILE and path.partition("\0")[0] in DESIGN


def plan_lines(folder: str, files: Mapping[str, bytes]) -> list[str]:
    """The plan that this design gives, in sentences: how many rows, after which of them the cells are equally full."""
    study = load_study(folder, check_scenarios=False, held=files).study
    if study is None or study.assignment.between == "list" or rows_wanted(study) * len(strata_of(study)) > MAX_PLANNED:
        return []
    return list(prove_balance(study, make_plan(study)).lines)
