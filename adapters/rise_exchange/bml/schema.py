"""A RELAX NG schema of BML 1.0's core, made from `rise_exchange.bml.vocabulary` (`rise-engine schema --kind bml`).

It is for editors. `rise_exchange.bml.block_file` reads files by the same table, and reports errors in sentences with
line and column. Other namespaces are allowed everywhere, as in the standard.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rise_exchange.bml.vocabulary import BEHAVIORS, BLOCK, COMPOSITIONS, EXTENSIONS, PARTS, ElementWords

_INSIDE = ('<ref name="inside"/>', '<ref name="required"/>')
_FOREIGN = '<ref name="foreignElement"/>'
_FRAME = Path(__file__).with_name("schema.rng").read_text("utf-8").removesuffix("</grammar>\n")
"""The part that does not depend on the table. `BEHAVIORS` stands for all behaviours."""


def block_schema_text() -> str:
    """The schema of a block, as text."""
    behaviors = "".join(f'<ref name="{name}"/>' for name in BEHAVIORS)
    parts = [
        _FRAME.replace('<ref name="BEHAVIORS"/>', behaviors),
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
    """Write an element with its attributes and its content."""
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
