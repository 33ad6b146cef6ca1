"""`rise-engine convert`: rules and acts in the formats of the field, and back."""

from __future__ import annotations

import click


@click.group("convert")
def convert() -> None:
    """Turn rules into SCXML and acts into BML, and back."""


COMMANDS = {"convert": convert}
