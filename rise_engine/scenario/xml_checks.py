"""What the files of acts and of rules have in common: their outermost element, and no text between elements."""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.xml import Element, XmlFile
from rise_engine.text import BLANKS, character_name, find_unseen


def top_elements(file: XmlFile, tag: str, wrappers: tuple[str, ...], diagnostics: Diagnostics) -> Iterator[Element]:
    """The elements called `tag`: the outermost element itself, or the children of a wrapper."""
    root = file.root
    if root.tag == tag:
        yield root
        return
    if root.tag not in wrappers:
        diagnostics.error(
            "unknown-element",
            file.element_location(root),
            f"`<{root.tag}>` cannot be the outermost element here{did_you_mean(root.tag, (tag, *wrappers))}",
        )
        return
    for name in root.attributes:
        diagnostics.error("unknown-attribute", file.attribute_location(root, name), f"`<{root.tag}>` has no attributes")
    check_no_text(file, root, diagnostics)
    for child in root:
        if child.tag == tag:
            yield child
        else:
            diagnostics.error(
                "unknown-element",
                file.element_location(child),
                f"`<{child.tag}>` cannot stand here; `<{root.tag}>` holds `<{tag}>`",
            )


def check_no_text(file: XmlFile, element: Element, diagnostics: Diagnostics) -> None:
    """A finding for text between the children of an element that holds only elements."""
    stray, behind = element.text.strip(BLANKS), None
    if not stray:
        for behind in element:
            if behind.tail and (stray := behind.tail.strip(BLANKS)):
                break
        else:
            return
    whole = element.text if behind is None else behind.tail
    index = len(whole) - len(whole.lstrip(BLANKS))
    location = file.text_location(element, index) if behind is None else file.tail_location(behind, index)
    if find_unseen(stray) == 0:
        message = f"the character {character_name(stray[0])} cannot stand here; delete it, or write an ordinary blank"
    else:
        message = f"text cannot stand here: `{' '.join(stray[:1000].split())[:60]}`"
    diagnostics.error("unexpected-text", location, message)
