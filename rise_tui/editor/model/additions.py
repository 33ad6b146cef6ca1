"""What can be added to scenario.toml and study.toml: conditions, properties, factors, checks, recorders."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import AnyEdit, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.model import Json
from rise_engine.scenario.settings import SCENARIO_TABLES, setting_at
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.recording_table import recorder_drivers
from rise_engine.syntax.toml import entries_in, value_at
from rise_tui.editor.model.draft import StudyDraft, is_study_alone
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.setting_fields import SettingPath, setting_id
from rise_tui.rendering.text import parse_typed_value

ACT_SETTINGS: tuple[tuple[str, Json], ...] = (
    *(("calling_type", "None"), ("filler", True), ("hold", True)),
    *(("on_failure", "repeat:1"), ("on_failure", "ask")),
)
"""The settings of an act that are offered, with their values."""

Added: TypeAlias = tuple[Sequence[AnyEdit], str]
"""Edits, and the id of the field that shows their result."""


class Addition(NamedTuple):
    """An entry that can be added to the settings."""

    choice: FieldChoice
    make: Callable[[str], Added]
    """Receives the typed text."""
    title: str = ""
    """The title of its question; empty: no question."""
    hint: str = ""


def additions(draft: StudyDraft) -> list[Addition]:
    """All entries that can be added to scenario.toml, and to study.toml if it exists."""
    found = [] if is_study_alone(draft) else list(_scenario_additions(draft))
    return found + (list(_StudyAdditions(draft.values_in(STUDY_FILE)).all()) if STUDY_FILE in draft.files else [])


_ONE_OF = {
    "factors": "factor",
    "strata": "stratum",
    "wizards": "wizard",
    "questionnaire": "questionnaire",
    "recording": "recorder",
}
"""What an entry of a table of study.toml is."""


def _set(file: str, path: SettingPath, value: Json, *more: AnyEdit, shows: SettingPath = ()) -> Added:
    """An edit, and the field to go to: of this path, or of an entry in it."""
    return (SetSetting(path, value, file=file), *more), setting_id(file, (*path, *shows))


def _parts(typed: str, form: str, separator: str = ":") -> tuple[str, str]:
    """The texts before and after the separator. :raises EditRefused: one of them is missing."""
    name, _, rest = (each.strip() for each in typed.partition(separator))
    if not name or not rest:
        raise EditRefused(f"Write {form}; not “{typed}”")
    return name, rest


def _memory_value(typed: str) -> tuple[str, Json]:
    key, text = _parts(typed, "a memory key and its value: “distraction = true”", "=")
    value, _, problem = parse_typed_value(text)
    if problem:
        raise EditRefused(problem)
    return key, value


def _scenario_additions(draft: StudyDraft) -> Iterator[Addition]:
    """Settings of acts that are not set yet, conditions, and properties for exploring."""
    given = entries_in(draft.values_in(SCENARIO_FILE).get("act"))
    for act in draft.outline.acts:
        for setting, value in ACT_SETTINGS:
            if entries_in(given.get(act.name)).get(setting) != value:
                path, shown = ("act", act.name, setting), "yes" if value is True else value
                known = setting_at(SCENARIO_TABLES, path)
                help = known.choices.get(str(value), known.meaning) if known is not None else ""
                choice = FieldChoice(f"{act.name} {setting} {value}", f"{act.name}  {setting} = {shown}", help)
                yield Addition(choice, partial(_add_value, path, value))
    condition = FieldChoice("condition", "a condition", "memory values at the start of its sessions")
    hint = "Its name and a memory value: loud: distraction = true"
    yield Addition(condition, _add_condition, "A new condition", hint)
    for kind, claim in (("always", "holds in every situation"), ("reachable", "stays possible"),
                        ("eventually", "happens without help")):  # fmt: skip
        yield Addition(FieldChoice(kind, f"a property: {kind}", f"exploring checks that it {claim}"),
                       partial(_add_property, kind), f"What {claim}",
                       "A name and a condition: one at a time: not (runs('R_A') and runs('R_B'))")  # fmt: skip


def _add_value(path: SettingPath, value: Json, _typed: str) -> Added:
    return _set(SCENARIO_FILE, path, value)


def _add_condition(typed: str) -> Added:
    name, rest = _parts(typed, "its name and a memory value: “loud: distraction = true”")
    key, value = _memory_value(rest)
    return _set(SCENARIO_FILE, ("conditions", name, "memory", key), value)


def _add_property(kind: str, typed: str) -> Added:
    name, condition = _parts(typed, "a name and a condition: “it ends: not rule('Main')”")
    return _set(SCENARIO_FILE, (kind, name, *(["then"] if kind == "eventually" else [])), condition)


class _StudyAdditions:
    """What can be added to study.toml. Nothing that is there already is replaced."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        """`values`: those of study.toml."""
        self._values = values

    def all(self) -> Iterator[Addition]:
        """In the order of a design: factors, strata, checks, people, questionnaires, recorders."""
        yield from self._factors()
        yield Addition(
            FieldChoice("stratum", "a stratum", "a column of participants.csv, within which cells are balanced"),
            self._add_stratum, "A new stratum", "A column and its values: language: de, en",
        )  # fmt: skip
        yield from self._checks()
        form = "A name and its code in exports: anna: W1"
        yield Addition(FieldChoice("wizard", "a wizard", "with a code for exports"),
                       partial(self._add_named, "wizards", (), form), "A wizard", form)  # fmt: skip
        form = "A name and its file: godspeed: questionnaires/godspeed.csv"
        yield Addition(FieldChoice("questionnaire", "a questionnaire", "answers from a survey tool's CSV"),
                       partial(self._add_named, "questionnaire", ("file",), form), "A questionnaire", form)  # fmt: skip
        yield from self._recorders()

    def _refuse_existing(self, table: str, name: str) -> None:
        if name in entries_in(self._values.get(table)):
            raise EditRefused(f"there is a {_ONE_OF[table]} {name} already")

    # --- factors and strata -------------------------------------------------------------------------------------------

    def _factors(self) -> Iterator[Addition]:
        yield Addition(FieldChoice("factor", "a factor", "what differs between sessions"), self._add_factor,
                       "A new factor", "Its name and its levels, as noise: quiet, loud")  # fmt: skip
        for factor, table in entries_in(self._values.get("factors")).items():
            levels = entries_in(entries_in(table).get("levels"))
            yield Addition(FieldChoice(f"level {factor}", f"a level of {factor}", "beside " + ", ".join(levels)),
                           partial(self._add_level, factor), f"A new level of {factor}", "Its name: loud")  # fmt: skip
            for level in levels:
                named = f"a start value of {factor} = {level}"
                yield Addition(FieldChoice(f"value {factor} {level}", named, "in its sessions only"),
                               partial(self._add_value, factor, level), named[0].upper() + named[1:],
                               "A memory key and its value: distraction = true")  # fmt: skip

    def _add_factor(self, typed: str) -> Added:
        name, _, listed = typed.partition(":")
        levels = [each.strip() for each in listed.split(",") if each.strip()]
        if not name.strip() or len(set(levels)) < 2:
            raise EditRefused(f"A factor has a name and at least two levels: “noise: quiet, loud”; not “{typed}”")
        self._refuse_existing("factors", name.strip())
        value: Json = {"kind": "between", "levels": {each: {} for each in levels}}
        return _set(STUDY_FILE, ("factors", name.strip()), value, shows=("kind",))

    def _add_level(self, factor: str, typed: str) -> Added:
        if typed in entries_in(value_at(self._values, ("factors", factor, "levels"))):
            raise EditRefused(f"{factor} has a level “{typed}” already")
        return _set(STUDY_FILE, ("factors", factor, "levels", typed), {}, shows=("scenario",))

    def _add_value(self, factor: str, level: str, typed: str) -> Added:
        key, value = _memory_value(typed)
        return _set(STUDY_FILE, ("factors", factor, "levels", level, "memory", key), value)

    def _add_stratum(self, typed: str) -> Added:
        name, listed = _parts(typed, "a column and its values: “language: de, en”")
        self._refuse_existing("strata", name)
        balanced = [*_names(value_at(self._values, ("assignment", "strata"))), name]
        balance = SetSetting(("assignment", "strata"), balanced, file=STUDY_FILE)
        return _set(STUDY_FILE, ("strata", name), _names(listed), balance)

    # --- checks -------------------------------------------------------------------------------------------------------

    def _checks(self) -> Iterator[Addition]:
        yield Addition(FieldChoice("check", "a check by a person", "a sentence to confirm before each session"),
                       partial(self._add_check, "ask"), "A new check",
                       "The statement to confirm before a session: The door is closed")  # fmt: skip
        for auto, help in AUTOMATIC.items():
            choice = FieldChoice(f"auto {auto}", f"an automatic check: {auto}", help)
            yield Addition(choice, partial(self._add_automatic, auto))

    def _add_check(self, kind: str, text: str) -> Added:
        given = entries_in(self._values.get("check"))
        used = {each.get("id") for each in given.values() if isinstance(each, dict)}
        ids = [text] * (kind == "auto") + [f"check{number}" for number in range(1, len(given) + 2)]
        value: Json = {"id": next(each for each in ids if each not in used), kind: text, "when": "before"}
        path: SettingPath = ("check", str(len(given))) if given else ("check",)
        edit = SetSetting(path, value if given else [value], file=STUDY_FILE)
        return (edit,), setting_id(STUDY_FILE, ("check", str(len(given)), "id"))

    def _add_automatic(self, auto: str, _typed: str) -> Added:
        return self._add_check("auto", auto)

    # --- people, questionnaires, recorders ----------------------------------------------------------------------------

    def _add_named(self, table: str, entry: SettingPath, form: str, typed: str) -> Added:
        name, rest = _parts(typed, f"{form[0].lower()}{form[1:]}")
        self._refuse_existing(table, name)
        return _set(STUDY_FILE, (table, name, *entry), rest)

    def _recorders(self) -> Iterator[Addition]:
        yield Addition(FieldChoice("camera", "a recorder: ffmpeg", "a camera or a microphone"), self._add_camera,
                       "A recorder", "A name and ffmpeg's input: camera: -f v4l2 -i /dev/video0")  # fmt: skip
        for driver in recorder_drivers():
            if driver != "ffmpeg":
                choice = FieldChoice(f"recorder {driver}", f"a recorder: {driver}")
                yield Addition(choice, partial(self._add_recorder, driver))

    def _add_camera(self, typed: str) -> Added:
        name, rest = _parts(typed, "a name and ffmpeg's input: “camera: -f v4l2 -i /dev/video0”")
        self._refuse_existing("recording", name)
        try:
            arguments = shlex.split(rest)
        except ValueError:
            raise EditRefused(f"a quotation mark has no end in “{rest}”") from None
        return _set(STUDY_FILE, ("recording", name), {"by": "ffmpeg", "input": arguments}, shows=("by",))

    def _add_recorder(self, driver: str, _typed: str) -> Added:
        self._refuse_existing("recording", driver)
        return _set(STUDY_FILE, ("recording", driver), {"by": driver}, shows=("by",))


def _names(value: Any) -> list[str]:
    listed = value if isinstance(value, list) else str(value or "").split(",")
    return [str(each).strip() for each in listed if str(each).strip()]
