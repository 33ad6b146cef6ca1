"""Scenario files as they would have been written without templates (`rise-engine expand`)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from xml.sax.saxutils import escape

from rise_engine.base.text import BLANKS
from rise_engine.scenario.blocks import FUNCTIONS
from rise_engine.scenario.xml import XmlFile
from rise_engine.syntax.xml import Element

_IN_VALUES = {'"': "&quot;", "\n": "&#10;", "\t": "&#9;", "\r": "&#13;"}
_IN_TEXTS = {"\r": "&#13;"}
_ELEMENTS = {
    "onFailure": "`<onFailure>`",
    "Variants": "`<Variants>`",
    "transitions": "`<transitions in>`",
    "oneOf": "`<oneOf>`",
    "elseif": "`<elseif>`",
    "onExit": "`<onExit>`",
}
"""Elements that RISE does not have."""
_EXPRESSIONS = ("cond", "while", "after", "assignValue")
"""Attributes in which expressions stand."""
_SLOTS = re.compile(r"\{[^}]*\}")
_QUOTED = re.compile(r"""\"[^\"]*\"|'[^']*'""")
_INDEX = re.compile(r"[\w)]\s*\[")
_OF_TRANSITIONS = ("cond", "ended", "after", "while")
"""Attributes of transitions that RISE does not have."""


def plain_text(file: XmlFile) -> str:
    """The text of a file with the elements of its templates in it; empty when it holds nothing but templates.

    Everything else stays as its author wrote it, comments and line breaks too.
    """
    if not file.is_expanded:
        return "" if file.root.tag == "Template" else file.source.text
    if not len(file.root):
        return ""
    text, pieces, at = file.tree.text, [], 0
    for element in _templates_and_uses(file.tree.root):
        start, end = element.start, element.end
        if element.tag == "Template":
            start, end = _with_surroundings(text, start, end)
        pieces.append(text[at:start])
        at = end
        if element.tag == "use":
            line = text[text.rfind("\n", 0, start) + 1 : start]
            indent = line if not line.strip(BLANKS) else ""
            made = file.brought[element]
            pieces.append(f"\n{indent}".join(element_text(each, indent) for each in made))
    return "".join((*pieces, text[at:]))


def _templates_and_uses(parent: Element) -> Iterator[Element]:
    """The outermost templates and uses of a file, in its order."""
    for child in parent:
        if child.tag in ("Template", "use"):
            yield child
        else:
            yield from _templates_and_uses(child)


def _with_surroundings(text: str, start: int, end: int) -> tuple[int, int]:
    """A template with the comment directly before it, and with the lines that would be left empty."""
    before = text[:start].rstrip(BLANKS)
    if before.endswith("-->") and text.count("\n", len(before), start) <= 1:
        start = before.rfind("<!--")
    line = text.rfind("\n", 0, start) + 1
    if not text[line:start].strip(BLANKS):
        start = line
    behind = len(text) - len(text[end:].lstrip(BLANKS))
    last = text.rfind("\n", end, behind) + 1
    return start, last or end


def element_text(element: Element, indent: str = "") -> str:
    """An element as XML; what it holds stands in lines of its own, two blanks deeper."""
    attributes = "".join(f' {name}="{escape(value, _IN_VALUES)}"' for name, value in element.attributes.items())
    if any(child.tag == "speak" for child in element):  # blanks in SSML are blanks of the text
        return f"<{element.tag}{attributes}>{''.join(_markup(child) for child in element)}</{element.tag}>"
    if len(element):
        inner = "".join(f"{indent}  {element_text(child, indent + '  ')}\n" for child in element)
        return f"<{element.tag}{attributes}>\n{inner}{indent}</{element.tag}>"
    if element.text:
        return f"<{element.tag}{attributes}>{escape(element.text, _IN_TEXTS)}</{element.tag}>"
    return f"<{element.tag}{attributes}/>"


def _markup(element: Element) -> str:
    """An element in a text, with all that it holds, just as it stands."""
    attributes = "".join(f' {name}="{escape(value, _IN_VALUES)}"' for name, value in element.attributes.items())
    inner = escape(element.text, _IN_TEXTS) + "".join(
        _markup(child) + escape(child.tail, _IN_TEXTS) for child in element
    )
    return f"<{element.tag}{attributes}>{inner}</{element.tag}>" if inner else f"<{element.tag}{attributes}/>"


def additions(files: Iterable[XmlFile]) -> Counter[str]:
    """What these files have, once expanded, that RISE does not know, and how often."""
    found: Counter[str] = Counter()
    rest = [file.root for file in files if file.root.tag != "Template"]
    while rest:
        element = rest.pop()
        rest += element
        if element.tag in _ELEMENTS:
            found[_ELEMENTS[element.tag]] += 1
        written = [value for name, value in element.attributes.items() if name in _EXPRESSIONS]
        written += _SLOTS.findall(element.text) if not len(element) else []
        found["parts of values by index"] += sum(_INDEX.search(_QUOTED.sub("''", text)) is not None for text in written)
        if element.tag == "transition":
            found.update(f"`{name}`" for name in _OF_TRANSITIONS if name in element.attributes)
            if "target" not in element.attributes:
                found["transitions without `target`"] += 1
        elif element.tag == "function":
            found.update(f"`{name}` of `<function>`" for name in element.attributes if name not in FUNCTIONS)
        elif element.tag == "waitForActions" and ("," in element.text or ";" in element.text):
            found["several ids in `<waitForActions>`"] += 1
        elif element.tag == "speak":
            found["SSML"] += 1
        elif not len(element) and "{" in element.text:
            found["memory values in braces"] += 1
    return +found
