"""From an edit to its changes of characters: each kind of edit has one function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, TypeAlias

from rise_engine.author.edit import (
    acts,
    memory,
    parts,
    rename,
    settings,
    statements,
    states,
    tables,
    translations,
)
from rise_engine.author.edit.edits import Edit, ReplaceFile
from rise_engine.author.edit.plan import EditedText, EditRefused, Plan, StudyState
from rise_engine.expression.errors import shorten
from rise_engine.scenario.files.source_files import MAX_BYTES
from rise_engine.scenario.files.study_paths import why_none_written

_BOM = b"\xef\xbb\xbf"
_SHOWN = 90
"""Maximum characters of a line in a sentence."""


def plan_replace_file(edit: ReplaceFile, study: StudyState) -> Plan:
    """Plan new content for a file, a new file, or its removal. An existing byte order mark stays."""
    file = str(PurePosixPath(edit.file))
    old = study.files.get(file)
    if edit.text is None:
        if old is None:
            raise EditRefused(f"there is no file `{file}`")
        return Plan(written={file: None}, says=(f"{file} is removed",))
    try:
        data = edit.text.encode()
    except UnicodeEncodeError:
        raise EditRefused(f"the text for {file} holds half a character and cannot be written") from None
    if len(data) > MAX_BYTES:
        raise EditRefused(f"{file} would be larger than {MAX_BYTES // 1_000_000} MB, and could not be read")
    if old is not None and old.startswith(_BOM) and not data.startswith(_BOM):
        data = _BOM + data
    if data == old:
        return Plan()
    return Plan(
        written={file: data}, says=(f"{file} is made" if old is None else _difference_text(file, old, edit.text),)
    )


def _difference_text(file: str, old: bytes, new: str) -> str:
    """Describe the difference; for a single line, with its new and old text."""
    before, after = (text.removeprefix("\ufeff").splitlines() for text in (old.decode(errors="replace"), new))
    changed = [number for number, (one, other) in enumerate(zip(before, after, strict=False)) if one != other]
    if len(changed) != 1 or len(before) != len(after):
        return f"{file} is rewritten"
    was, is_now = (shorten(" ".join(lines[changed[0]].split()), _SHOWN) for lines in (before, after))
    return f"{file}, line {changed[0] + 1}, is “{is_now}” (was “{was}”)"


_FILE_PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {ReplaceFile: plan_replace_file}


# --- every kind of edit ----------------------------------------------------------------------------------------------


Planner: TypeAlias = Callable[[Any, StudyState], Plan]
"""A planner for one kind of edit. Raises EditRefused for an edit that cannot be made."""

_MODULE_PLANNERS: tuple[Mapping[type[Edit], Planner], ...] = (
    acts.PLANNERS,
    memory.PLANNERS,
    _FILE_PLANNERS,
    parts.PLANNERS,
    rename.PLANNERS,
    settings.PLANNERS,
    states.PLANNERS,
    statements.PLANNERS,
    tables.PLANNERS,
    translations.PLANNERS,
)
"""The edits that each module can plan, its `PLANNERS`."""
PLANNERS: dict[type[Edit], Planner] = {edit: planner for part in _MODULE_PLANNERS for edit, planner in part.items()}


def plan(edit: Edit, study: StudyState) -> Plan:
    """Plan an edit of the files of a study, without changing anything.

    :raises EditRefused: it cannot be made; the message has the reason and a remedy.
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
    says = planned.says if splices or written else ()  # an edit without effect needs no description
    return Plan(splices, written, says, planned.noticed)


__all__ = ["PLANNERS", "Planner", "StudyState", "plan"]
