"""From an edit to the stretches of bytes that change: one function for each kind of edit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from rise_engine.author.edit import (
    acts,
    memory,
    new_files,
    parts,
    rename,
    settings,
    statements,
    states,
    tables,
    templates,
    transitions,
    translations,
)
from rise_engine.author.edit.edits import Edit
from rise_engine.author.edit.plan import EditRefused, Plan
from rise_engine.author.edit.study_state import StudyState
from rise_engine.author.edit.text_edits import EditedText
from rise_engine.scenario.study_paths import why_none_written

Planner: TypeAlias = Callable[[Any, StudyState], Plan]
"""Plans the edits of one kind. Raises EditRefused for one that cannot be made."""

_OF_MODULES: tuple[Mapping[type[Edit], Planner], ...] = (
    acts.PLANNERS,
    memory.PLANNERS,
    new_files.PLANNERS,
    parts.PLANNERS,
    rename.PLANNERS,
    settings.PLANNERS,
    states.PLANNERS,
    statements.PLANNERS,
    tables.PLANNERS,
    templates.PLANNERS,
    transitions.PLANNERS,
    translations.PLANNERS,
)
"""What each module of edits can plan, its `PLANNERS`."""
PLANNERS: dict[type[Edit], Planner] = {edit: planner for part in _OF_MODULES for edit, planner in part.items()}


def plan(edit: Edit, study: StudyState) -> Plan:
    """What an edit does to the files of a study; nothing is changed.

    :raises EditRefused: it cannot be made; the message says why, and what could be done.
    """
    planner = PLANNERS.get(type(edit))
    if planner is None:
        raise EditRefused(f"{type(edit).__name__} cannot be planned here")
    planned = planner(edit, study)
    files = study.files
    touched: dict[str, object] = {**{each.file: each for each in planned.splices}, **planned.written}
    if problem := why_none_written(study.folder, touched.items()):
        raise EditRefused(problem)
    texts = {each.file: EditedText(each.file, files[each.file]).text for each in planned.splices}
    splices = tuple(each for each in planned.splices if texts[each.file][each.start : each.end] != each.text)
    written = {file: content for file, content in planned.written.items() if files.get(file) != content}
    says = planned.says if splices or written else ()  # what changes nothing has nothing to say
    return Plan(splices, written, says, planned.noticed)


__all__ = ["PLANNERS", "Planner", "StudyState", "plan"]
