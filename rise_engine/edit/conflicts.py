"""Edits of files that git could not join: of each conflict one version is kept, or both."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.edit.documents import NotXmlError, XmlDocument
from rise_engine.edit.edits import Edit, ResolveConflict
from rise_engine.edit.plan import EditRefused, Files, Plan
from rise_engine.edit.study_state import StudyState
from rise_engine.edit.text_edits import EditedText, TextEdit
from rise_engine.scenario.merge_conflicts import Keep, MergeConflict, find_conflicts
from rise_engine.text import pluralize

_LONGEST_END = 60
"""Lines behind a conflict that are looked at for an end that both versions have."""


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
    splices = file.splices([TextEdit(conflict.start, conflict.end, _kept(file, conflict, edit.keep))])
    says = f"{edit.file}, line {file.line(conflict.start)}: {kept_in_words(conflict, edit.keep)}"
    return Plan(splices=splices, says=(says,))


def _kept(file: EditedText, conflict: MergeConflict, keep: Keep) -> str:
    """What takes the place of a conflict. :raises EditRefused: both do not fit behind one another."""
    text = file.text
    yours, theirs = text[slice(*conflict.yours)], text[slice(*conflict.theirs)]
    if keep != "both":
        return yours if keep == "yours" else theirs
    if not file.name.lower().endswith(".xml"):
        return yours + theirs
    between = _end_of_both(yours, theirs, text[conflict.end :])
    if between is None:
        raise EditRefused(
            f"{file.name}, line {file.line(conflict.start)}: yours and the other's are not whole elements, so they do "
            "not fit behind one another; keep one of them, or open the file in your editor"
        )
    return yours + between + theirs


def _end_of_both(yours: str, theirs: str, behind: str) -> str | None:
    """The lines that end both versions, and that git has left behind the conflict, once; None: there are none.

    Two acts that were added in the same place often end alike, `</Dialog>`: to keep both, that end is needed twice.
    """
    end = ""
    for line in ["", *behind.splitlines(keepends=True)[:_LONGEST_END]]:
        if line.startswith("<<<<<<<"):
            return None
        end += line
        if _is_whole(yours + end) and _is_whole(theirs + end):
            return end
    return None


def _is_whole(text: str) -> bool:
    """Whether all elements that begin in a text end in it."""
    try:
        XmlDocument(f"<all>{text}</all>".encode())
    except NotXmlError:
        return False
    return True


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
