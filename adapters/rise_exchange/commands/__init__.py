"""`rise-engine convert` and `rise-engine import`. Each of their commands is imported at its first use."""

from __future__ import annotations

import click

from rise_engine.cli.program import LazyGroup

_CONVERT = {
    "from-bml": ("rise_exchange.commands.bml:from_bml", "Make acts from blocks of BML 1.0."),
    "from-scxml": ("rise_exchange.commands.scxml:from_scxml", "Make rules from a statechart."),
    "to-bml": ("rise_exchange.commands.bml:to_bml", "Write acts as blocks of BML 1.0."),
    "to-scxml": ("rise_exchange.commands.scxml:to_scxml", "Write rules as SCXML."),
}
_IMPORT = {"woz4u": ("rise_exchange.commands.woz4u:woz4u", "Make a scenario from a WoZ4U configuration.")}


@click.group("convert", cls=LazyGroup, sections={"Commands": _CONVERT})
def convert() -> None:
    """Convert rules to SCXML and acts to BML, and back."""


@click.group("import", cls=LazyGroup, sections={"Commands": _IMPORT})
def import_studies() -> None:
    """Make a scenario from another tool's files."""
