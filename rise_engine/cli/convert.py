"""`rise-engine convert`: rules and acts in the formats of the field, and back."""

from __future__ import annotations

import click

from rise_engine.cli.convert_from_bml import from_bml
from rise_engine.cli.convert_from_scxml import from_scxml
from rise_engine.cli.convert_to_bml import to_bml
from rise_engine.cli.convert_to_scxml import to_scxml


@click.group("convert")
def convert() -> None:
    """Turn rules into SCXML and acts into BML, and back."""


convert.add_command(to_bml)
convert.add_command(from_bml)
convert.add_command(to_scxml)
convert.add_command(from_scxml)

COMMANDS = {"convert": convert}
