"""RELAX NG schemas for acts and rules, for editors (completion, help).

Loading a scenario does not ask them: the checks say more, and say it in words. That both agree is held by tests
(docs/decisions/0014-schemas-are-for-editors.md).

`schema/cra.rng` and `schema/rules.rng` are what these functions give for the core actions; a test holds them equal.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from lxml import etree

from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, known_names

_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that no XML file can hold; a help text of a robot's profile may have them."""
FOLDER = Path(__file__).with_name("schema")
_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<grammar xmlns="http://relaxng.org/ns/structure/1.0"
         xmlns:a="http://relaxng.org/ns/compatibility/annotations/1.0"
         datatypeLibrary="http://www.w3.org/2001/XMLSchema-datatypes">
"""


def act_schema_text(actions: Mapping[str, ActionSpec]) -> str:
    """The schema of acts (CRA files) for these actions, as RELAX NG in XML."""
    usable = [spec for spec in actions.values() if spec.supported]
    parts = [_HEAD, _ACT_FRAME]
    parts.append('  <define name="action">\n    <choice>\n')
    parts += [f'      <ref name="action.{spec.name}"/>\n' for spec in usable]
    parts.append('      <ref name="variants"/>\n    </choice>\n  </define>\n')
    parts.append('  <define name="variants">\n    <element name="Variants">\n')
    parts.append(
        _doc("Several actions of one type, of which one is picked at each start; never the same twice running.")
    )
    parts.append('      <interleave>\n        <ref name="common"/>\n        <choice>\n')
    parts += [f'          <oneOrMore><ref name="variant.{spec.name}"/></oneOrMore>\n' for spec in usable]
    parts.append("        </choice>\n      </interleave>\n    </element>\n  </define>\n")
    for spec in usable:
        parts.append(_action(spec))
    parts.append("</grammar>\n")
    return "".join(parts)


def rule_schema_text() -> str:
    """The schema of rules (IR files), as RELAX NG in XML."""
    return _HEAD + _RULE_GRAMMAR + "</grammar>\n"


def act_schema(actions: Mapping[str, ActionSpec]) -> etree.RelaxNG:
    """The compiled schema of acts for these actions."""
    return etree.RelaxNG(etree.fromstring(act_schema_text(actions).encode()))


@cache
def rule_schema() -> etree.RelaxNG:
    """The compiled schema of rules."""
    return etree.RelaxNG(etree.fromstring(rule_schema_text().encode()))


def _action(spec: ActionSpec) -> str:
    body = [_parameter(parameter) for parameter in spec.parameters.values()]
    fields = "".join(body) or "        <empty/>\n"
    return (
        f'  <define name="action.{spec.name}">\n    <element name="{spec.name}">\n{_doc(spec.help)}'
        f'      <interleave>\n        <ref name="common"/>\n        <ref name="parameters.{spec.name}"/>\n'
        f"      </interleave>\n    </element>\n  </define>\n"
        f'  <define name="variant.{spec.name}">\n    <element name="{spec.name}">\n{_doc(spec.help)}'
        f'      <ref name="parameters.{spec.name}"/>\n    </element>\n  </define>\n'
        f'  <define name="parameters.{spec.name}">\n      <interleave>\n{fields}      </interleave>\n  </define>\n'
    )


def _parameter(parameter: Parameter) -> str:
    notes = [parameter.help]
    if parameter.unit:
        notes.append(f"Unit: {parameter.unit}.")
    if parameter.default is not None:
        notes.append(f"Default: {parameter.default}.")
    content = "<text/>"
    if parameter.type == "boolean":
        content = "<choice><value>true</value><value>false</value><text/></choice>"
    elif parameter.type == "name" and known_names(parameter):
        values = "".join(f"<value>{_escape(name)}</value>" for name in known_names(parameter))
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
    text = _NOT_XML.sub("\ufffd", text)
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


_ACT_FRAME = """  <start>
    <choice>
      <ref name="dialog"/>
      <element name="Dialogs">
        <a:documentation>Several acts in one file.</a:documentation>
        <zeroOrMore><ref name="dialog"/></zeroOrMore>
      </element>
      <element name="AgentDialogs"><zeroOrMore><ref name="dialog"/></zeroOrMore></element>
      <element name="CommunicationRobotActs"><zeroOrMore><ref name="dialog"/></zeroOrMore></element>
    </choice>
  </start>
  <define name="dialog">
    <element name="Dialog">
      <a:documentation>A CommunicationRobotAct: a graph of actions.</a:documentation>
      <attribute name="name">
        <a:documentation>The act's name, used by rules, keys and tasks.</a:documentation>
        <text/>
      </attribute>
      <zeroOrMore><ref name="action"/></zeroOrMore>
    </element>
  </define>
  <define name="common">
    <interleave>
      <element name="actionID">
        <a:documentation>The action's id, unique in its act: 1, 2, 3, ...</a:documentation>
        <text/>
      </element>
      <optional><element name="waitForActions">
        <a:documentation>Ids of the actions that must end before: 1, 2. Default: starts at once.</a:documentation>
        <text/>
      </element></optional>
      <optional><element name="onFailure">
        <a:documentation>continue: a failure of this action does not end the act.</a:documentation>
        <value>continue</value>
      </element></optional>
    </interleave>
  </define>
"""

_RULE_GRAMMAR = """  <start>
    <choice>
      <ref name="rule"/>
      <element name="InteractionRules">
        <a:documentation>Several rules in one file.</a:documentation>
        <zeroOrMore><ref name="rule"/></zeroOrMore>
      </element>
    </choice>
  </start>
  <define name="rule">
    <element name="InteractionRule">
      <a:documentation>A state machine: from its initial state to a state without transitions.</a:documentation>
      <attribute name="name">
        <a:documentation>The rule's name, used by other rules, keys and tasks.</a:documentation>
        <text/>
      </attribute>
      <attribute name="initial">
        <a:documentation>Id of the state in which the rule begins.</a:documentation>
        <text/>
      </attribute>
      <optional><attribute name="priority">
        <a:documentation>Larger is nearer the top of the stack when the rule starts. Default: 0.</a:documentation>
        <data type="double"/>
      </attribute></optional>
      <oneOrMore><ref name="state"/></oneOrMore>
    </element>
  </define>
  <define name="state">
    <element name="State">
      <a:documentation>A state. Without transitions, the rule ends here after onEntry.</a:documentation>
      <attribute name="id">
        <a:documentation>The state's name, unique in its rule.</a:documentation>
        <text/>
      </attribute>
      <interleave>
        <optional><element name="onEntry">
          <a:documentation>Functions that run when the state is entered, in this order.</a:documentation>
          <ref name="block"/>
        </element></optional>
        <optional><element name="onExit">
          <a:documentation>Functions that run when the state is left, in this order.</a:documentation>
          <ref name="block"/>
        </element></optional>
        <zeroOrMore><ref name="transition"/></zeroOrMore>
      </interleave>
    </element>
  </define>
  <define name="transition">
    <element name="transition">
      <a:documentation>A way out of the state. The first one whose event and condition fit is taken.</a:documentation>
      <choice>
        <group>
          <attribute name="eventTopic">
            <a:documentation>The event that it waits for, such as /R_Greeting_end.</a:documentation>
            <text/>
          </attribute>
          <optional><ref name="condition"/></optional>
        </group>
        <group>
          <attribute name="after">
            <a:documentation>Taken after this time: 500ms, 2s, 1.5min.</a:documentation>
            <data type="string"><param name="pattern">\\s*[0-9]+(\\.[0-9]+)?\\s*(ms|s|min)\\s*</param></data>
          </attribute>
          <optional><ref name="condition"/></optional>
        </group>
        <ref name="condition"/>
      </choice>
      <optional><attribute name="target">
        <a:documentation>Id of the next state. Without it, the state is not left.</a:documentation>
        <text/>
      </attribute></optional>
      <ref name="block"/>
    </element>
  </define>
  <define name="condition">
    <attribute name="cond">
      <a:documentation>A condition over the memory. Write &amp;lt; for the sign less-than.</a:documentation>
      <text/>
    </attribute>
  </define>
  <define name="block">
    <zeroOrMore>
      <choice>
        <ref name="function"/>
        <ref name="oneOf"/>
        <ref name="if"/>
      </choice>
    </zeroOrMore>
  </define>
  <define name="oneOf">
    <element name="oneOf">
      <a:documentation>Runs one of its children, picked by chance.</a:documentation>
      <oneOrMore>
        <choice>
          <ref name="function"/>
          <ref name="oneOf"/>
          <ref name="if"/>
        </choice>
      </oneOrMore>
    </element>
  </define>
  <define name="if">
    <element name="if">
      <a:documentation>Runs what it holds when its condition is true, else its elseif or else.</a:documentation>
      <ref name="condition"/>
      <ref name="block"/>
      <ref name="branches"/>
    </element>
    <ref name="branches"/>
  </define>
  <define name="branches">
    <zeroOrMore>
      <element name="elseif">
        <a:documentation>Tried when the conditions before it are false.</a:documentation>
        <ref name="condition"/>
        <ref name="block"/>
        <ref name="branches"/>
      </element>
    </zeroOrMore>
    <optional>
      <element name="else">
        <a:documentation>Runs when no condition before it is true.</a:documentation>
        <ref name="block"/>
      </element>
    </optional>
  </define>
  <define name="function">
    <element name="function">
      <a:documentation>One call: exactly one of the six attributes.</a:documentation>
      <choice>
        <attribute name="startCommunicationRobotAct">
          <a:documentation>Starts an act: its name.</a:documentation>
          <text/>
        </attribute>
        <attribute name="stopCommunicationRobotAct">
          <a:documentation>Stops an act: its name.</a:documentation>
          <text/>
        </attribute>
        <attribute name="startInteractionRule">
          <a:documentation>Starts a rule: its name.</a:documentation>
          <text/>
        </attribute>
        <attribute name="stopInteractionRule">
          <a:documentation>Stops a rule: its name.</a:documentation>
          <text/>
        </attribute>
        <attribute name="raiseEventTopic">
          <a:documentation>Raises an event: its topic, such as /H_no_interaction.</a:documentation>
          <text/>
        </attribute>
        <attribute name="assignValue">
          <a:documentation>Sets a memory key: count = count + 1</a:documentation>
          <text/>
        </attribute>
      </choice>
    </element>
  </define>
"""
