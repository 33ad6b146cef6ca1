"""`rise-engine convert` and `rise-engine import`: each of their commands is loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click


class _LazyGroup(click.Group):
    """A group whose commands lie in modules of this package."""

    def __init__(self, *arguments: Any, modules: Mapping[str, str], **more: Any) -> None:
        """:param modules: of each command, the module in which it lies under its name, with `_` for `-`."""
        super().__init__(*arguments, **more)
        self._modules = modules

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(self._modules)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in self._modules:
            return None
        module = import_module(f"{__name__}.{self._modules[name]}")
        command: click.Command = getattr(module, name.replace("-", "_"))
        return command


@click.group(
    "convert",
    cls=_LazyGroup,
    modules={"from-bml": "bml", "to-bml": "bml", "from-scxml": "scxml", "to-scxml": "scxml"},
)
def convert() -> None:
    """Convert rules to SCXML and acts to BML, and back."""


@click.group("import", cls=_LazyGroup, modules={"woz4u": "woz4u"})
def import_studies() -> None:
    """Make a scenario from another tool's files."""
