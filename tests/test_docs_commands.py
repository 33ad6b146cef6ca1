"""Every command in the documentation can be typed: the program has it, and the options that are written there."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator

import click
import pytest

from rise_engine.cli.program import main as rise_engine
from rise_tui.cli.main import main as rise_tui
from tests.test_docs import PAGES, name_of

PROGRAMS: dict[str, click.Command] = {"rise-engine": rise_engine, "rise-tui": rise_tui}
BLOCK = re.compile(r"^ *```(?:sh)?\n(?P<fenced>.*?)^ *```$|(?P<indented>(?:^ {4}.*\n)+)", re.MULTILINE | re.DOTALL)
CONTINUED = re.compile(r"\\\n\s*")
COMMAND = re.compile(r"(?:^|&& |\| )(?:\$ )?(?:\.venv/bin/|~/rise/bin/)?(?P<command>rise-(?:engine|tui)(?: .*)?)$")
REMARK = re.compile(r"\s+#\s|(?<=\S) {3,}")
"""A comment, and the second column of a list of commands."""
ELSEWHERE = re.compile(r" \| | > | &$| --ros-args ")
"""What follows is not for the program, or for ROS."""
SHAPE = re.compile(r"[\[\]|<>]|\.\.\.|\bSHELL\b")
"""What says how a command is formed, and is not typed."""


def commands(page: str) -> Iterator[list[str]]:
    """The commands in a page's blocks of code, as a shell reads them."""
    for block in BLOCK.finditer(page):
        text = CONTINUED.sub(" ", block["fenced"] or block["indented"])
        for line in text.splitlines():
            found = COMMAND.search(REMARK.split(line.strip())[0].rstrip())
            if found is not None and not SHAPE.search(found["command"]):
                yield shlex.split(ELSEWHERE.split(found["command"])[0])


def read(arguments: list[str]) -> None:
    """Let click read a command and do nothing. Raises click.UsageError for what it does not know."""
    program, *rest = arguments
    command, context = PROGRAMS[program], None
    while isinstance(command, click.Group):
        context = command.make_context(program, rest, parent=context)
        rest = [*context._protected_args, *context.args]
        if not rest:
            return
        name, inner, rest = command.resolve_command(context, rest)
        assert inner is not None, name
        command = inner
    command.make_context(command.name, rest, parent=context)


def test_commands_can_be_typed() -> None:
    wrong, looked_at = [], 0
    for page in PAGES:
        for arguments in commands(page.read_text(encoding="utf-8")):
            looked_at += 1
            try:
                read(arguments)
            except click.exceptions.Exit:
                pass
            except click.UsageError as error:
                wrong.append(f"{name_of(page)}: {shlex.join(arguments)}: {error.format_message()}")
    assert wrong == [] and looked_at > 80


@pytest.mark.parametrize("wrong", ["rise-engine chek .", "rise-engine check . --jsn", "rise-tui --confg ."])
def test_a_slip_is_found(wrong: str) -> None:
    with pytest.raises(click.UsageError):
        read(*commands(f"```sh\n{wrong}\n```\n"))
