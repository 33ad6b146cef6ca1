"""The command `guide`: the whole format of a scenario on one page, made from what the program itself declares."""

from __future__ import annotations

import sys
import typing
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import UnionType
from typing import Any, get_args

import click
import msgspec

from rise_engine import exit_status
from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.options import FOLDER_OR_NONE, ROBOT
from rise_engine.edit.edits import (
    AnyEdit,
    BranchForm,
    CallForm,
    IfForm,
    NameKind,
    OneOfForm,
    StatementAddress,
    TransitionForm,
)
from rise_engine.expression.signatures import SIGNATURES, SITUATION_SIGNATURES
from rise_engine.scenario import load
from rise_engine.scenario.file_names import DEFAULT_PATHS
from rise_engine.scenario.model import ActionSpec, FunctionName, Parameter, RobotProfile
from rise_engine.scenario.scenario_toml import BINDINGS, TOP_KEYS

_MOST_NAMES = 12
"""Known names of a parameter that are listed."""

EXAMPLES = {
    "acts/acts.xml": """\
<Dialogs>
<Dialog name="R_Ask">
  <Speech>
    <actionID>1</actionID>
    <message>Shall I go on, {person|you there}?</message>
  </Speech>
  <Variants>
    <actionID>2</actionID>
    <waitForActions>1</waitForActions>
    <onFailure>continue</onFailure>
    <Speech><message>Please.</message></Speech>
    <Speech><message>If you like.</message></Speech>
  </Variants>
</Dialog>
</Dialogs>
""",
    "rules/main.xml": """\
<InteractionRule name="Main" initial="Ask">
  <State id="Ask">
    <onEntry>
      <function assignValue="asked = asked + 1"/>
      <function startCommunicationRobotAct="R_Ask"/>
    </onEntry>
    <transition eventTopic="/yes" cond="asked &lt; 3" target="Done"/>
    <transition ended="R_Ask" outcome="failed" target="Done"/>
    <transition while="not session.speaking" after="8s" target="Ask">
      <if cond="asked = 2"><function raiseEventTopic="/twice"/></if>
    </transition>
  </State>
  <State id="Done"/>
</InteractionRule>
""",
    "scenario.toml": """\
title = "Asking"
robot = "generic"
[keys]
b = { rule = "Main", label = "begin" }
y = { event = "/yes", label = "yes" }
p = { set = "person = 'Ada'" }
[act.R_Ask]
hold = true
[conditions.polite]
memory = { asked = 0 }
""",
    "memory.json": '{"asked": 0, "person": null}\n',
}
"""A study in which everything stands that is said; the tests check it."""


@click.command()
@FOLDER_OR_NONE
@ROBOT
def guide(folder: str | None, robot: str | None) -> None:
    """Print the whole format of a scenario on one page, for people and language models that write one.

    With DIR, it names the actions of that scenario's robot; without, those of --robot, or of the simulated one.
    Exit status: 0; 1 when there is no such robot; 2 when there is no such folder.
    """
    if folder is not None and not Path(resolve_scenario(folder)).exists():
        exit_with_usage(f"there is no folder {folder}")
    if folder is None:
        loaded = load("no-folder", robot=robot, held={"scenario.toml": b""})
    else:
        loaded = load(resolve_scenario(folder), robot=robot)
    problems = [each for each in loaded.errors if each.code == "unknown-robot"]
    if problems:
        print(problems[0], file=sys.stderr)
        sys.exit(exit_status.REFUSED)
    print(guide_text(loaded.robot), end="")


def guide_text(robot: RobotProfile) -> str:
    """The page, in Markdown. :param robot: whose actions it lists."""
    parts = (_files(), _acts(robot), _rules(), _conditions(), _settings(), _edits(), _commands())
    return "# The format of a scenario\n\n" + "\n\n".join(parts) + "\n"


def _files() -> str:
    return (
        "A folder of UTF-8 text files. Unknown elements, attributes and keys are errors. The order of actions means "
        "nothing, that of transitions does.\n\n"
        f"- `scenario.toml`: settings. `{DEFAULT_PATHS['acts']}/*.xml`: what the robot does. "
        f"`{DEFAULT_PATHS['rules']}/*.xml`: when. `{DEFAULT_PATHS['memory']}`: start values, one JSON object.\n"
        "- `tables/*.csv`: read-only lists (`items[i].word`). `texts/de.toml`: translations. `tests/*.jsonl`: tests."
    )


def _acts(robot: RobotProfile) -> str:
    lines = [
        "## Acts\n\n```xml\n" + EXAMPLES["acts/acts.xml"] + "```",
        "An action starts when all of `waitForActions` (ids with commas) have ended; without it, at once. `{key}` in "
        "a text is a memory value, `{key|else}` says what to take when there is none, `{{` is a brace. `Variants`: one "
        "by chance. `onFailure` is only ever `continue`: successors start all the same.",
        f"Actions of `{robot.name}` (**bold**: required):",
    ]
    return "\n\n".join(lines) + "\n\n" + "\n".join(_action(spec) for spec in robot.actions.values() if spec.supported)


def _action(spec: ActionSpec) -> str:
    parameters = ", ".join(_parameter(each) for each in spec.parameters.values())
    return f"- `{spec.name}`: {parameters or 'no parameters'}"


def _parameter(parameter: Parameter) -> str:
    name = f"**{parameter.name}**" if parameter.required else parameter.name
    known = [*parameter.codes, *parameter.names]
    if known:
        more = " ..." if len(known) > _MOST_NAMES else ""
        return f"{name} ({' '.join(known[:_MOST_NAMES])}{more})"
    said: list[str] = [parameter.unit] if parameter.unit else [] if parameter.type == "text" else [parameter.type]
    least, most = parameter.minimum, parameter.maximum
    if least is not None:
        said.append(f"{least:g} to {most:g}" if most is not None else f"from {least:g}")
    elif most is not None:
        said.append(f"up to {most:g}")
    return f"{name} ({' '.join(said)})" if said else name


def _rules() -> str:
    functions = ", ".join(f"`{each}`" for each in get_args(FunctionName))
    return (
        "## Rules\n\n```xml\n" + EXAMPLES["rules/main.xml"] + "```\n\n"
        "The first transition that fits is taken: `eventTopic` when the event comes; `ended` when this rule's act ends "
        "(`outcome`: succeeded, failed, stopped, with `|` between); `after` (500ms, 2s, 1.5min, `{seconds}`) in this "
        "state, with `while` only if that held all the time; `cond` alone as soon as it becomes true, beside another "
        "as a guard. Without `target` the state is not left. A state without transitions ends the rule. Also "
        "`<onExit>`, `<if>` with `<elseif>` and `<else>` in it, `<oneOf>` (one by chance), "
        '`<transitions in="A | B">` for several states.\n\n'
        f'Functions: {functions}. `startInteractionRule` may have `state`, `raiseEventTopic` may have `keep="2s"`. '
        "The engine raises `/ACT_succeeded`, `/ACT_failed`, `/ACT_stopped`, then `/ACT_end`; `/RULE_STATE`, "
        "`/RULE_end`; `/cue`."
    )


def _conditions() -> str:
    functions, asked = (
        ", ".join(f"`{written}`" for each in signatures for written in each.written)
        for signatures in (SIGNATURES, SITUATION_SIGNATURES)
    )
    return (
        "## Conditions and assignments\n\n"
        "From loosest to tightest: `or`, `xor`, `and`, `not`, `= !=`, `< <= > >= contains starts with ends with`, "
        "`+ -`, `* /`, `^`; texts in '...', `true false null`, keys, `items[i].text` (from 0). In XML `<` is `&lt;`. "
        "A key that is not there counts as false, 0 or ''. An assignment is `key = expression`. Read-only: "
        "`session.speaking`, `session.cue`, `session.condition`, `session.participant`.\n\n"
        f"Functions: {functions}. Only in `[always]`, `[reachable]` and `[eventually]` of scenario.toml: {asked}."
    )


def _settings() -> str:
    bindings = ", ".join(f"`{each}`" for each in BINDINGS)
    tops = ", ".join(f"`{each}`" for each in TOP_KEYS)
    return (
        "## scenario.toml\n\n```toml\n" + EXAMPLES["scenario.toml"] + "```\n\n"
        f"All entries: {tops}. A key of the keyboard has one of {bindings}. `on_failure`: go_on, ask, repeat:2."
    )


def _edits() -> str:
    lines = [
        "## Changes: `rise-engine edit DIR EDITS.json [--dry-run]`",
        'A list of objects, as `[{"edit": "set_parameter", "act": "R_Ask", "action": "1", "parameter": "message", '
        '"value": "Hello"}]`; made all or none. `?`: may be left out. A value `null` takes it away.',
    ]
    forms = [f"- {name}: {_fields(form)}" for name, form in _FORMS.items()]
    edits = [f"- `{each.__struct_config__.tag}` {_fields(each)}" for each in AnyEdit.__args__]
    return "\n\n".join(lines) + "\n\n" + "\n".join([*edits, *forms])


_FORMS = {
    "TransitionForm (`was`: as it is now)": TransitionForm,
    "StatementAddress (place: onEntry, onExit, transition; path: numbers from 0)": StatementAddress,
    'CallForm ("statement": "call")': CallForm,
    'IfForm ("statement": "if")': IfForm,
    "BranchForm (condition null: else; statements are forms)": BranchForm,
    'OneOfForm ("statement": "oneOf"; choices are forms)': OneOfForm,
}


def _fields(kind: Any) -> str:
    hints = typing.get_type_hints(kind)
    fields = msgspec.structs.fields(kind)
    return ", ".join(f"{each.encode_name}{'' if each.required else '?'}{_type(hints[each.name])}" for each in fields)


def _type(hint: Any) -> str:
    """What a value is, where it is not a text."""
    options = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    names = [_TYPES.get(str(typing.get_origin(each) or each), getattr(each, "__name__", "")) for each in options]
    return f" ({'/'.join(names)})" if any(names) and names != ["str"] and names != ["str", "null"] else ""


_TYPES = {
    str(str): "str",
    str(int): "number",
    str(bool): "true/false",
    str(type(None)): "null",
    str(dict): "object of texts",
    str(tuple): "list",
    str(Any): "any",
    str(typing.Literal): "",
}


def _commands() -> str:
    kinds = "|".join(get_args(NameKind))
    rows: Iterable[tuple[str, str]] = (
        ("check DIR --json", "everything that is wrong"),
        ("run DIR --rule NAME --speed max", "play it at once without a robot"),
        ("eval 'EXPRESSION'", "try a condition"),
        (f"uses|rename DIR {kinds} ...", "where a name stands; another name everywhere"),
        ("graph DIR [RULE]", "draw it"),
        ("fmt DIR", "the usual layout"),
    )
    return "## Commands\n\n" + "\n".join(_rows(rows))


def _rows(rows: Iterable[tuple[str, str]]) -> Iterator[str]:
    for command, what in rows:
        yield f"- `rise-engine {command}`: {what}"


COMMANDS = {"guide": guide}
