"""`rise-engine convert`: rules and acts in the formats of the field, and back."""

from __future__ import annotations

import click

from rise_engine.cli.scenario.convert_bml import from_bml, to_bml
from rise_engine.cli.scenario.convert_scxml import from_scxml, to_scxml


@click.group("convert")
def convert() -> None:
    """Convert rules to SCXML and acts to BML, and back."""


for each in (to_bml, from_bml, to_scxml, from_scxml):
    convert.add_command(each)

COMMANDS = {"convert": convert}
