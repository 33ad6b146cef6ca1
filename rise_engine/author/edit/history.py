"""The steps of an editor, backwards and forwards without limit, over several files and over saves.

A step back is the files as they were before it, not the contrary edit: quotation marks and blanks come back too.
"""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.edit.plan import Files


class Step(Struct, frozen=True, eq=False):
    """What was done, and the files before and after it."""

    change: object
    before: Files
    after: Files

    @property
    def files(self) -> set[str]:
        """The names of those that it changes."""
        return changed_names(self.before, self.after)


def changed_names(one: Files, other: Files) -> set[str]:
    """The names of the files that differ."""
    return {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}


class History:
    """Steps that were made, and those that were taken back."""

    def __init__(self) -> None:
        self.done: list[Step] = []
        self.undone: list[Step] = []
        self.saved: list[Step] = []
        """What had been done at the last save."""

    def add(self, step: Step) -> None:
        self.done.append(step)
        self.undone.clear()

    def undo(self) -> Step | None:
        if not self.done:
            return None
        self.undone.append(self.done.pop())
        return self.undone[-1]

    def redo(self) -> Step | None:
        if not self.undone:
            return None
        self.done.append(self.undone.pop())
        return self.done[-1]

    def mark_saved(self) -> None:
        self.saved = list(self.done)

    @property
    def unsaved(self) -> tuple[list[Step], list[Step]]:
        """Steps of the last save that were taken back since, the latest first; and steps that were made since."""
        same = 0
        while same < min(len(self.done), len(self.saved)) and self.done[same] is self.saved[same]:
            same += 1
        return self.saved[: same - 1 if same else None : -1] if len(self.saved) > same else [], self.done[same:]

    def touched(self) -> set[str]:
        """The names of all files that any step changes."""
        return {name for steps in (self.done, self.undone, self.saved) for step in steps for name in step.files}

    def lay_under(self, outside: Mapping[str, bytes | None]) -> None:
        """Take over files that somebody else has changed and no step has touched."""
        known: dict[int, Step] = {}

        def with_outside(files: Files) -> Files:
            merged = {**files, **{name: data for name, data in outside.items() if data is not None}}
            for name, data in outside.items():
                if data is None:
                    merged.pop(name, None)
            return merged

        for steps in (self.done, self.undone, self.saved):
            for index, step in enumerate(steps):
                if id(step) not in known:
                    known[id(step)] = replace(step, before=with_outside(step.before), after=with_outside(step.after))
                steps[index] = known[id(step)]

    def begin_anew(self, steps: list[Step]) -> None:
        """Forget what was before: the files have changed outside where steps had changed them."""
        self.done, self.undone, self.saved = list(steps), [], []
