"""A group of commands that loads each command only when it is used."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click


def load_command(place: str) -> click.Command:
    """Load a command from its place, `package.module:attribute`."""
    module, _, attribute = place.partition(":")
    command: click.Command = getattr(import_module(module), attribute)
    return command


class LazyGroup(click.Group):
    """A group that knows where its commands are, and their lines of the help."""

    def __init__(self, *arguments: Any, sections: Mapping[str, Mapping[str, tuple[str, str]]], **more: Any) -> None:
        """:param sections: the sections of the help: by the name of each command, where it is and what it does."""
        super().__init__(*arguments, **more)
        self._sections = sections
        self.places = {name: place for section in sections.values() for name, (place, _) in section.items()}

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.places)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return load_command(self.places[name]) if name in self.places else None

    def help_sections(self) -> dict[str, list[tuple[str, str]]]:
        """Return the commands and their lines of the help, by section, without loading them."""
        return {
            title: [(name, about) for name, (_, about) in section.items()] for title, section in self._sections.items()
        }

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, lines in self.help_sections().items():
            with formatter.section(title):
                formatter.write_dl(lines, col_max=12)
