"""What the files of acts and of rules have in common: their outermost element, and no text between elements."""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.nearest_name import suggestion
from rise_engine.scenario.findings import Findings
from rise_engine.scenario.xml import Element, XmlFile
from rise_engine.text import BLANKS, called, strange


def top_elements(file: XmlFile, tag: str, wrappers: tuple[str, ...], findings: Findings) -> Iterator[Element]:
    """The elements called `tag`: the outermost element itself, or the children of a wrapper."""
    root = file.root
    if root.tag == tag:
        yield root
        return
    if root.tag not in wrappers:
        findings.error(
            "unknown-element",
            file.place(root),
            f"`<{root.tag}>` cannot be the outermost element here{suggestion(root.tag, (tag, *wrappers))}",
        )
        return
    for name in root.attributes:
        findings.error("unknown-attribute", file.attribute_place(root, name), f"`<{root.tag}>` has no attributes")
    check_no_text(file, root, findings)
    for child in root:
        if child.tag == tag:
            yield child
        else:
            findings.error(
                "unknown-element",
                file.place(child),
                f"`<{child.tag}>` cannot stand here; `<{root.tag}>` holds `<{tag}>`",
            )


def check_no_text(file: XmlFile, element: Element, findings: Findings) -> None:
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
    place = file.text_place(element, index) if behind is None else file.tail_place(behind, index)
    if strange(stray) == 0:
        message = f"the character {called(stray[0])} cannot stand here; delete it, or write an ordinary blank"
    else:
        message = f"text cannot stand here: `{' '.join(stray[:1000].split())[:60]}`"
    findings.error("unexpected-text", place, message)
