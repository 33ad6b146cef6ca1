"""What an edit does to files: stretches of bytes that others take the place of, and what it says about itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from msgspec import Struct

from rise_engine.errors import RiseError

Files: TypeAlias = Mapping[str, bytes]
"""A study's files by their names relative to its folder, with slashes. Never changed; unchanged contents are shared."""


class EditRefused(RiseError, ValueError):
    """An edit that cannot be made; the message says why, and what could be done, for a person."""


class Splice(Struct, frozen=True):
    """Bytes `start` to `end` of a file, and what takes their place."""

    file: str
    start: int
    end: int
    data: bytes


class Plan(Struct, frozen=True):
    """What an edit does."""

    splices: tuple[Splice, ...] = ()
    """In any order; no two of them overlap."""
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
    by_file: dict[str, list[Splice]] = {}
    for splice in plan.splices:
        by_file.setdefault(splice.file, []).append(splice)
    for file, splices in by_file.items():
        data, pieces, at = files[file], [], 0
        for splice in sorted(splices, key=lambda each: (each.start, each.end)):
            if not at <= splice.start <= splice.end <= len(data):
                raise ValueError(f"{file}: bytes {splice.start} to {splice.end} cannot be replaced")
            pieces += [data[at : splice.start], splice.data]
            at = splice.end
        after[file] = b"".join([*pieces, data[at:]])
    for file, content in plan.written.items():
        if content is None:
            after.pop(file, None)
        else:
            after[file] = content
    return after
