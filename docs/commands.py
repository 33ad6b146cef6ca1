"""Writes commands and options into their reference pages: `.venv/bin/python -m docs.commands`.

A page has a mark for each command, `<!-- command: rise-engine check -->`, or for a group of commands. The text from the
mark to the next `<!-- end -->` comes from the program's own help.
"""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import click

from rise_engine.cli.program import CommandGroup
from rise_engine.cli.program import main as rise_engine
from rise_tui.cli.main import main as rise_tui

REFERENCE = Path(__file__).parent / "reference"
PAGES = {"rise-engine": REFERENCE / "rise-engine.md", "rise-tui": REFERENCE / "rise-tui.md"}
PROGRAMS: dict[str, click.Command] = {"rise-engine": rise_engine, "rise-tui": rise_tui}
MARK = re.compile(r"(<!-- (command|commands|shared options): ([\w -]+) -->\n).*?(<!-- end -->)", re.DOTALL)
OPTION = re.compile(r"(?<![\w`-])--[a-z][\w-]*")
SHARED_BY = 2
"""Minimum number of commands with the same option and help for the common list."""

Row = tuple[str, str]
"""An option as it is typed, and its help."""


def leaves(command: click.Command, name: str, parent: click.Context | None = None) -> Iterator[click.Context]:
    """A context for each command that can run, including groups that can."""
    context = click.Context(command, info_name=name, parent=parent)
    if not isinstance(command, click.Group) or command.invoke_without_command:
        yield context
    if isinstance(command, click.Group):
        for each in command.list_commands(context):
            inner = command.get_command(context, each)
            assert inner is not None, each
            yield from leaves(inner, each, context)


def option_rows(context: click.Context) -> list[Row]:
    options = (each for each in context.command.params if isinstance(each, click.Option))
    records = (option.get_help_record(context) for option in options)
    return [(typed, about.replace("  [", " [")) for typed, about in filter(None, records)]


def shared_rows(program: str) -> list[Row]:
    """The options of many commands, the most frequent first."""
    counted = Counter(row for context in leaves(PROGRAMS[program], program) for row in option_rows(context))
    frequent = [row for row, count in counted.most_common() if count >= SHARED_BY]
    return list({typed: (typed, about) for typed, about in reversed(frequent)}.values())[::-1]


def help_text(command: click.Command) -> str:
    """A command's summary and its exit status. The rest of its help is about details, or is examples."""
    first, *others = [" ".join(each.split()) for each in inspect.cleandoc(command.help or "").split("\n\n")]
    statuses = [f"Exit status{each.partition('Exit status')[2]}" for each in others if "Exit status" in each]
    return "\n\n".join(in_code(each) for each in [first, *statuses])


def in_code(text: str) -> str:
    """A sentence with each option as code."""
    return OPTION.sub(r"`\g<0>`", text)


def option_list(rows: list[Row]) -> str:
    return "\n".join(f"- `{typed}`: {in_code(about)}" if about else f"- `{typed}`" for typed, about in rows)


def command_text(context: click.Context, shared: list[Row]) -> str:
    """The usage of a command, its help, and its options."""
    usage = " ".join([context.command_path, *context.command.collect_usage_pieces(context)])
    parts = [f"```\n{usage}\n```", help_text(context.command)]
    rows = option_rows(context)
    if own := [row for row in rows if row not in shared]:
        parts.append(option_list(own))
    if also := [f"`{typed}`" for typed, about in rows if (typed, about) in shared]:
        parts.append(f"[Shared options](#shared-options): {', '.join(also)}.")
    return "\n\n".join(parts)


def commands_by_purpose() -> str:
    assert isinstance(rise_engine, CommandGroup)
    names = {title: ", ".join(f"`{name}`" for name, _ in lines) for title, lines in rise_engine.help_sections().items()}
    return "\n".join(f"- **{title}**: {each}" for title, each in names.items())


def page_text(program: str, text: str) -> str:
    """A page with the text between its marks replaced by the program's."""
    shared = shared_rows(program) if "<!-- shared options" in text else []

    def between(kind: str, name: str) -> str:
        if kind == "commands":
            return commands_by_purpose()
        if kind == "shared options":
            return option_list(shared)
        contexts = [each for each in leaves(PROGRAMS[program], program) if is_marked(name, each.command_path)]
        return "\n\n".join(command_text(each, shared) for each in contexts)

    return MARK.sub(lambda found: f"{found[1]}{between(found[2], found[3])}\n{found[4]}", text)


def is_marked(name: str, command: str) -> bool:
    """Whether a mark is about a command: it names the command, or its group."""
    return command == name or (name not in PROGRAMS and command.startswith(f"{name} "))


if __name__ == "__main__":
    for name, page in PAGES.items():
        page.write_text(page_text(name, page.read_text("utf-8")), "utf-8")
