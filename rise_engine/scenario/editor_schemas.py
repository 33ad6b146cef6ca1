"""RELAX NG schemas of acts and rules, for editors (completion, help).

The schema of rules is `schema/rules.rng`. That of acts is `schema/cra.rng`, to which `act_schema_text` adds the single
actions, including those of a robot's profile and a scenario.

Loading a scenario does not use the schemas, because its own checks find and explain more. Tests make sure that both
agree (docs/decisions/0034-one-reader-of-scenarios.md).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape
from pathlib import Path

from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import MESSAGE, accepts_any_name, listed_names

FOLDER = Path(__file__).with_name("schema")
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML cannot contain, although the help text of a robot's profile may."""
_COMMON = """        <ref name="actionID"/>
        <optional><ref name="waitForActions"/></optional>
        <optional><ref name="onFailure"/></optional>
"""


def rule_schema_text() -> str:
    """The schema of rules (IR files), as RELAX NG in XML.

    >>> rule_schema_text().splitlines()[0]
    '<?xml version="1.0" encoding="UTF-8"?>'
    """
    return (FOLDER / "rules.rng").read_text("utf-8")


def act_schema_text(actions: Mapping[str, ActionSpec]) -> str:
    """The schema of acts (CRA files) with these actions, as RELAX NG in XML.

    `actions` are a robot's actions by name (`RobotProfile.actions`); unsupported ones are omitted.

    >>> from rise_engine.scenario.loader import load
    >>> scenario = load("scenarios/greeting").scenario
    >>> '<element name="Speech">' in act_schema_text(scenario.robot.actions)
    True
    """
    frame = (FOLDER / "cra.rng").read_text("utf-8").removesuffix("</grammar>\n")
    usable = [spec for spec in actions.values() if spec.supported]
    parts = [frame, '  <define name="action">\n    <choice>\n']
    parts += [f'      <ref name="action.{spec.name}"/>\n' for spec in usable]
    parts.append('      <ref name="variants"/>\n    </choice>\n  </define>\n')
    parts.append('  <define name="variants">\n    <element name="Variants">\n')
    parts.append(
        _doc("Several actions of one type, of which one is picked at each start; never the same twice running.")
    )
    parts.append("      <interleave>\n" + _COMMON + "        <choice>\n")
    parts += [f'          <oneOrMore><ref name="variant.{spec.name}"/></oneOrMore>\n' for spec in usable]
    parts.append("        </choice>\n      </interleave>\n    </element>\n  </define>\n")
    parts += [_action(spec) for spec in usable]
    parts.append("</grammar>\n")
    return "".join(parts)


def _action(spec: ActionSpec) -> str:
    fields = "".join(_parameter(parameter) for parameter in spec.parameters.values())
    # One flat interleave for all, because libxml2 rejects valid files for nested interleaves.
    variant = f"      <interleave>\n{fields}      </interleave>\n" if fields else "      <empty/>\n"
    return (
        f'  <define name="action.{spec.name}">\n    <element name="{spec.name}">\n{_doc(spec.help)}'
        f"      <interleave>\n{_COMMON}{fields}      </interleave>\n    </element>\n  </define>\n"
        f'  <define name="variant.{spec.name}">\n    <element name="{spec.name}">\n{_doc(spec.help)}'
        f"{variant}    </element>\n  </define>\n"
    )


def _parameter(parameter: Parameter) -> str:
    notes = [parameter.help]
    if parameter.unit:
        notes.append(f"Unit: {parameter.unit}.")
    if parameter.default is not None:
        notes.append(f"Default: {parameter.default}.")
    content = "<text/>"
    if parameter.name == MESSAGE and parameter.type == "text":
        content = '<choice><text/><ref name="ssml"/></choice>'
    if parameter.type == "boolean":
        content = "<choice><value>true</value><value>false</value><text/></choice>"
    elif parameter.type == "name" and listed_names(parameter):
        values = "".join(f"<value>{_escape(name)}</value>" for name in listed_names(parameter))
        codes = "".join(f"<value>{code}</value>" for code in parameter.codes.values())
        content = f"<choice>{values}{codes}<text/></choice>"
        if parameter.codes:
            notes.append("Numbers: " + ", ".join(f"{code} {name}" for name, code in parameter.codes.items()) + ".")
        if accepts_any_name(parameter):
            notes.append("Other names are passed to the robot.")
    help_ = _doc(" ".join(note for note in notes if note), 12)
    element = f'<element name="{parameter.name}">\n{help_}{" " * 12}{content}</element>'
    if parameter.required:
        return f"        {element}\n"
    return f"        <optional>{element}</optional>\n"


def _doc(text: str, indent: int = 6) -> str:
    return f"{' ' * indent}<a:documentation>{_escape(text)}</a:documentation>\n" if text else ""


def _escape(text: str) -> str:
    return escape(_NOT_XML.sub("\ufffd", text), quote=False)
