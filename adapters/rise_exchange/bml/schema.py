"""A RELAX NG schema of BML 1.0's core, made from `rise_exchange.bml.vocabulary` (`rise-engine schema --kind bml`).

It is for editors. `rise_exchange.bml.block_file` reads files. It uses the same table, and reports mistakes in sentences
with line and column. Other namespaces are allowed everywhere, as in the standard.
"""

from __future__ import annotations

from collections.abc import Iterable

from rise_exchange.bml.vocabulary import BEHAVIORS, BLOCK, COMPOSITIONS, EXTENSIONS, NAMESPACE, PARTS, ElementWords

_INSIDE = ('<ref name="inside"/>', '<ref name="required"/>')
_FOREIGN = '<ref name="foreignElement"/>'
_FRAME = f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- The core of BML 1.0, made of the table in adapters/rise_exchange/bml/vocabulary.py. -->
<grammar xmlns="http://relaxng.org/ns/structure/1.0" ns="{NAMESPACE}"
         datatypeLibrary="http://www.w3.org/2001/XMLSchema-datatypes">
  <start><ref name="bml"/></start>
  <define name="foreign">
    <zeroOrMore>
      <attribute><anyName><except><nsName ns=""/></except></anyName></attribute>
    </zeroOrMore>
  </define>
  <define name="foreignElement">
    <element>
      <anyName><except><nsName/><nsName ns=""/></except></anyName>
      <ref name="anything"/>
    </element>
  </define>
  <define name="anything">
    <zeroOrMore>
      <choice>
        <text/>
        <attribute><anyName/></attribute>
        <element><anyName/><ref name="anything"/></element>
      </choice>
    </zeroOrMore>
  </define>
  <define name="description">
    <element name="description">
      <attribute name="priority" ns=""/>
      <attribute name="type" ns=""/>
      <zeroOrMore><choice><text/><element><anyName/><ref name="anything"/></element></choice></zeroOrMore>
    </element>
  </define>
  <define name="required">
    <element name="required">
      <zeroOrMore><ref name="inside"/></zeroOrMore>
    </element>
  </define>
  <define name="inside">
    <choice>BEHAVIORS<ref name="constraint"/><ref name="foreignElement"/></choice>
  </define>
  <define name="constraint">
    <element name="constraint">
      <optional><attribute name="id" ns=""/></optional>
      <ref name="foreign"/>
      <zeroOrMore><choice><ref name="synchronize"/><ref name="before"/><ref name="after"/></choice></zeroOrMore>
    </element>
  </define>
  <define name="sync">
    <element name="sync">
      <choice><attribute name="id" ns=""/><attribute name="ref" ns=""/></choice>
      <ref name="foreign"/>
    </element>
  </define>
"""


def block_schema_text() -> str:
    """The schema of a block, as text. It is `schema/bml.rng`."""
    behaviors = "".join(f'<ref name="{name}"/>' for name in BEHAVIORS)
    parts = [
        _FRAME.replace("BEHAVIORS", behaviors),
        _define("bml", BLOCK, [f"<zeroOrMore>{_choice(_INSIDE)}</zeroOrMore>"]),
    ]
    for name, words in BEHAVIORS.items():
        points = ("start", *words.points, "end")
        inside = [*(f'<ref name="{child}"/>' for child in words.children), '<ref name="description"/>']
        content = [f"<zeroOrMore>{_choice([*inside, _FOREIGN])}</zeroOrMore>"]
        parts.append(_define(name, ElementWords(("id", *words.required), (*points, *words.optional)), content))
    for name, words in PARTS.items():
        inside = [f'<ref name="{child}"/>' for child in words.children]
        content = [f"<zeroOrMore>{_choice(inside)}</zeroOrMore>"] if inside else []
        parts.append(_define(name, words, ["<mixed>" + "".join(content) + "</mixed>"] if words.text else content))
    return "".join((*parts, "</grammar>\n"))


def _define(name: str, words: ElementWords, content: Iterable[str]) -> str:
    """An element with its attributes and its content."""
    namespace = f' ns="{EXTENSIONS}"' if name == "faceFacs" else ""
    lines = [f'      <attribute name="{each}" ns=""/>' for each in words.required]
    for each in words.optional:
        values = _choice(f"<value>{value}</value>" for value in COMPOSITIONS) if each == "composition" else "<text/>"
        lines.append(f'      <optional><attribute name="{each}" ns="">{values}</attribute></optional>')
    lines += ['      <ref name="foreign"/>', *(f"      {each}" for each in content)]
    body = "\n".join(lines)
    return f'  <define name="{name}">\n    <element name="{name}"{namespace}>\n{body}\n    </element>\n  </define>\n'


def _choice(of: Iterable[str]) -> str:
    return f"<choice>{''.join(of)}</choice>"
