"""The state for planning an edit, and the plan: the replaced pieces of text, and a description in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

from msgspec import Struct

from rise_engine.author.edit.outline import Outline
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.scenario.loader import LoadResult
from rise_engine.syntax.changes import EditRefused as EditRefused
from rise_engine.syntax.changes import Splice as Splice
from rise_engine.syntax.changes import TextEdit, changed_text

Files: TypeAlias = Mapping[str, bytes]
"""A study's files by their names relative to its folder, with slashes. Never changed; unchanged contents are shared."""
_BYTE_ORDER_MARK = "\ufeff"


class Plan(Struct, frozen=True):
    """The effect of an edit."""

    splices: tuple[Splice, ...] = ()
    """In any order, without overlaps. The files are UTF-8."""
    written: dict[str, bytes | None] = {}
    """Complete files: new ones, and None for deleted ones. None of them has a splice."""
    says: tuple[str, ...] = ()
    """The effect in words: "R_Yes 2 says “Yes.” (was “Yes, exactly.”)"."""
    noticed: tuple[str, ...] = ()
    """Remarks on what stays unchanged: "the comment in acts/a.xml, line 3, names R_Yes too"."""


def apply_plan(files: Files, plan: Plan) -> Files:
    """Return the files after a plan.

    :raises ValueError: splices overlap, or are outside of their file, which is an error of the planner.
    """
    after = dict(files)
    for file in {splice.file: None for splice in plan.splices}:
        text = files[file].decode()
        mark = _BYTE_ORDER_MARK * text.startswith(_BYTE_ORDER_MARK)
        splices = [splice for splice in plan.splices if splice.file == file]
        after[file] = (mark + changed_text(text[len(mark) :], splices)).encode()
    for file, content in plan.written.items():
        if content is None:
            after.pop(file, None)
        else:
            after[file] = content
    return after


class EditedText:
    """One file of a study as text."""

    def __init__(self, name: str, data: bytes, encoding: str = "utf-8") -> None:
        """:raises EditRefused: it is not in this encoding."""
        self.name = name
        try:
            self.text = data.decode("utf-8-sig" if encoding == "utf-8" else encoding)
        except UnicodeDecodeError:
            raise EditRefused(f"{name} is not {encoding.upper()}; save it as UTF-8 first") from None

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Prefix refusals within the block with the file's name."""
        try:
            yield
        except EditRefused as error:
            raise EditRefused(f"{self.name}: {error}") from None

    def line(self, offset: int) -> int:
        """Return the line number of a character, from 1. As in an editor, a lone CR ends a line, too."""
        before = self.text[:offset].replace("\r\n", "\n")
        return before.count("\n") + before.count("\r") + 1

    def splices(self, edits: Iterable[TextEdit]) -> tuple[Splice, ...]:
        """Add the file's name to changes, and omit those without effect."""
        return tuple(Splice(self.name, *edit) for edit in edits if self.text[edit.start : edit.end] != edit.text)


def file_of(files: Files, name: str) -> EditedText:
    """Return a file of the study. :raises EditRefused: there is none of this name, or it is not UTF-8."""
    if name not in files:
        raise EditRefused(f"there is no file {name} in this study")
    return EditedText(name, files[name])


class StudyState(Struct, frozen=True, dict=True):
    """A study in its present state, for planning an edit."""

    files: Files
    checked: LoadResult
    """The check of these files."""
    folder: Path
    """The folder of the study. Planning reads only the targets of its links."""
    above: Files = {}
    """The study.toml of a folder above, by its path (`read_study_above`). It is read for names and not changed."""

    @cached_property
    def outline(self) -> Outline:
        """The written form of its acts and rules."""
        return read_outline(self.checked.parts)
