"""What an edit does to files: stretches of their texts that others take the place of, and what it says about itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from msgspec import Struct

from rise_engine.syntax.changes import EditRefused as EditRefused
from rise_engine.syntax.changes import Splice as Splice
from rise_engine.syntax.changes import changed_text

Files: TypeAlias = Mapping[str, bytes]
"""A study's files by their names relative to its folder, with slashes. Never changed; unchanged contents are shared."""
_BYTE_ORDER_MARK = "\ufeff"


class Plan(Struct, frozen=True):
    """What an edit does."""

    splices: tuple[Splice, ...] = ()
    """In any order; no two of them overlap. The files are UTF-8."""
    written: dict[str, bytes | None] = {}
    """Whole files: new ones, and None for those that go. No splice is in one of them."""
    says: tuple[str, ...] = ()
    """What it does, in words: "R_Yes 2 says “Yes.” (was “Yes, exactly.”)"."""
    noticed: tuple[str, ...] = ()
    """What was seen and left alone: "the comment in acts/a.xml, line 3, names R_Yes too"."""


def apply_plan(files: Files, plan: Plan) -> Files:
    """The files after a plan.

    :raises ValueError: splices overlap, or are outside of their file: a mistake of whoever planned.
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
