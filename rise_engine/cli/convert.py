"""`rise-engine convert`: rules and acts in the formats of the field, and back."""

from __future__ import annotations

import click

from rise_engine.cli.convert_from_scxml import from_scxml


@click.group("convert")
def convert() -> None:
    """Turn rules into SCXML and acts into BML, and back."""


convert.add_command(from_scxml)

COMMANDS = {"convert": convert}
