"""Edits of files that git could not join: of each conflict one version is kept, or both."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.edit.edits import Edit, ResolveConflict
from rise_engine.edit.plan import EditRefused, Files, Plan
from rise_engine.edit.study_state import StudyState
from rise_engine.edit.text_edits import EditedText, TextEdit
from rise_engine.scenario.merge_conflicts import Keep, MergeConflict, find_conflicts
from rise_engine.text import pluralize


def conflict_files(files: Files) -> dict[str, int]:
    """The files with conflicts, and how many each has."""
    found = {name: len(conflicts_of(name, data)[1]) for name, data in files.items() if b"<<<<<<<" in data}
    return {name: number for name, number in sorted(found.items()) if number}


def conflicts_of(name: str, data: bytes) -> tuple[EditedText, list[MergeConflict]]:
    """A file as text, and its conflicts. What is not UTF-8 is read as Windows has it, byte for byte."""
    try:
        file = EditedText(name, data)
    except EditRefused:
        file = EditedText(name, data, "latin-1")
    return file, find_conflicts(file.text)


def plan_resolve_conflict(edit: ResolveConflict, study: StudyState) -> Plan:
    """One version of a conflict, or both, takes its place.

    :raises EditRefused: there is no such file, or no such conflict in it.
    """
    if edit.file not in study.files:
        raise EditRefused(f"there is no file {edit.file} in this study")
    file, conflicts = conflicts_of(edit.file, study.files[edit.file])
    if not 0 <= edit.conflict < len(conflicts):
        has = pluralize(len(conflicts), "conflict") if conflicts else "no conflict"
        raise EditRefused(f"{edit.file} has {has} that git has left; there is no conflict {edit.conflict + 1}")
    conflict = conflicts[edit.conflict]
    splices = file.splices([TextEdit(conflict.start, conflict.end, conflict.kept(file.text, edit.keep))])
    says = f"{edit.file}, line {file.line(conflict.start)}: {kept_in_words(conflict, edit.keep)}"
    return Plan(splices=splices, says=(says,))


def kept_in_words(conflict: MergeConflict, keep: Keep) -> str:
    """What is kept of a conflict: "yours (HEAD) is kept"."""
    yours = f"yours ({conflict.your_name})" if conflict.your_name else "yours"
    theirs = f"the other's ({conflict.their_name})" if conflict.their_name else "the other's"
    return {
        "yours": f"{yours} is kept",
        "theirs": f"{theirs} is taken",
        "both": f"both are kept, {yours} and then {theirs}",
    }[keep]


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {ResolveConflict: plan_resolve_conflict}
