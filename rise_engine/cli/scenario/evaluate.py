"""`rise-engine eval`: the value of an expression, and the functions of the language."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from random import Random
from textwrap import wrap
from typing import Any

import click

from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.json_codec import JsonError, decode
from rise_engine.cli.options import JSON
from rise_engine.cli.terminal import Refused, exit_with_usage, print_notes, reason_of, show, write_json
from rise_engine.expression import EvaluationError, Expression, ExpressionError
from rise_engine.expression.functions import SIGNATURES


class _ExpressionCommand(click.Command):
    """A command that accepts `-1`, `-n` and `-2^2` as expressions. Only `--word` and `-h` are options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        takes_value = {
            name: not parameter.is_flag
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option)
            for name in parameter.opts
        }
        options: list[str] = []
        expressions: list[str] = []
        rest = iter(args)
        for arg in rest:
            if arg == "--":
                expressions += rest
            elif arg in takes_value:
                options.append(arg)
                if takes_value[arg]:
                    options += [each for each in (next(rest, None),) if each is not None]
            elif arg.startswith("--") and arg[2:3].isalpha():
                options.append(arg)  # with `=value`, or unknown: click reports it with the nearest one
            else:
                expressions.append(arg)
        return super().parse_args(ctx, [*options, "--", *expressions])


@click.command("eval", cls=_ExpressionCommand)
@click.argument("expression", required=False)
@click.option("--functions", is_flag=True, help="List the functions: what each takes and returns, with an example.")
@click.option(
    "--memory",
    metavar="JSON",
    default="{}",
    help="Use this memory: a JSON object, or the path of a memory.json (or @PATH).",
)
@JSON
def evaluate(expression: str | None, functions: bool, memory: str, as_json: bool) -> int:
    """Show the value of EXPRESSION, its type, and how it was read. It may begin with a minus: -2^2.

    Exit status: 0; 1 if it is refused or cannot be evaluated; 2 if the memory cannot be read.
    """
    if functions:
        rows = [{**each._asdict(), "written": list(each.written)} for each in SIGNATURES]
        show(_function_lines(), {"functions": rows}, as_json=as_json)
        return OK
    if expression is None:
        exit_with_usage("write an expression, in quotation marks: rise-engine eval '2 + 3' (or --functions)")
    return _evaluate(expression, _read_memory(memory), as_json=as_json)


def _function_lines() -> list[str]:
    lines = []
    for each in SIGNATURES:
        lines.append(", ".join(each.written))
        lines += [f"    {line}" for line in wrap(each.meaning.replace("`", ""), 90)]
        lines.append(f"    {each.example} = {each.result}")
    return lines


def _read_memory(text: str) -> dict[str, Any]:
    """Read a memory from JSON or a file, plain or as in the paper's listing 3. Ends the command if it is invalid."""
    source = text.strip()
    if source.startswith("@") or not source.startswith("{"):
        try:
            source = Path(source.removeprefix("@")).read_text("utf-8-sig")
        except (OSError, ValueError) as error:
            reason = reason_of(error) if isinstance(error, OSError) else str(error)
            exit_with_usage(
                f"--memory: {text} is neither a JSON object, such as '{{\"task\": 2}}', nor a file that can be read "
                f"({reason})"
            )
    try:
        value = decode(source)
    except JsonError as error:
        exit_with_usage(f"--memory: {error} (column {error.offset + 1})")
    if isinstance(value, dict) and isinstance(value.get("WorkingMemory"), list) and len(value) == 1:
        items = value["WorkingMemory"]
        if not all(isinstance(item, dict) for item in items):
            exit_with_usage('--memory: every entry of "WorkingMemory" is an object')
        value = {key: each for item in items for key, each in item.items()}
    if not isinstance(value, dict):
        exit_with_usage("--memory: the memory is a JSON object")
    return value


def _evaluate(text: str, memory: Mapping[str, Any], *, as_json: bool) -> int:
    """Print the value of an expression and its reading. The exit status is 1 if it has no value."""
    try:
        expression = Expression.parse(text)
    except ExpressionError as error:
        if as_json:
            write_json({"expression": text, "error": error.message, "column": error.column, "hint": error.hint})
            return REFUSED
        raise Refused(str(error), findings=(_one_line(text), f"{' ' * (error.column - 1)}^")) from None
    missing: set[str] = set()
    read_as = expression.with_all_brackets
    try:
        chance = Random(0)
        value = expression.value(memory, chance.random, missing, chance.randrange)
    except EvaluationError as error:
        show([f"read as    {read_as}"], {"expression": text, "error": str(error), "read_as": read_as}, as_json=as_json)
        if not as_json:
            print_notes(f"error: {error}")
        return REFUSED
    try:
        chance = Random(0)
        holds = str(expression.as_condition(memory, chance.random, None, chance.randrange)).lower()
    except EvaluationError as error:
        holds = f"error: {error}"
    lines = [f"value      {json.dumps(value, ensure_ascii=False)}", f"type       {type_name(value)}"]
    if not isinstance(value, bool):
        lines.append(f"condition  {holds}")
    lines.append(f"read as    {read_as}")
    lines += [f'missing    the memory has no {key}: it counts as false, 0 or ""' for key in sorted(missing)]
    document = {
        "expression": text,
        "value": value,
        "type": type_name(value),
        "condition": holds == "true",
        "read_as": read_as,
        "keys": sorted(expression.keys),
        "missing": sorted(missing),
    }
    show(lines, document, as_json=as_json)
    return OK


def type_name(value: Any) -> str:
    """Return the type of a memory value in JSON's words (a whole number is an integer)."""
    if value is None:
        return "null"
    names = ((bool, "boolean"), (int, "integer"), (float, "number"), (str, "string"), (list, "array"), (dict, "object"))
    return next((name for kind, name in names if isinstance(value, kind)), type(value).__name__)


def _one_line(text: str) -> str:
    """Replace line ends by blanks, so that every character keeps its column."""
    return "".join(" " if character.isspace() else character for character in text)
