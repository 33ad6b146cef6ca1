"""Places in the files of a scenario."""

from __future__ import annotations

from msgspec import UNSET, Struct, UnsetType


class TemplateLocation(Struct, frozen=True):
    """A place in a template."""

    name: str
    """The name of the template."""
    file: str
    line: int
    column: int


class SourceLocation(Struct, frozen=True):
    """A place in a file. Lines and columns count from 1; the file is relative to the folder."""

    file: str
    line: int = 1
    column: int = 1
    template: TemplateLocation | UnsetType = UNSET
    """The place in the template, for an element from one. File, line and column are then those of the `<use>`."""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"
