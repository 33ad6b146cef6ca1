"""What the readers of acts and of rules have in common."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import partial

from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.base.text import BLANKS, character_name, find_unseen
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Definition, ScenarioDraft
from rise_engine.scenario.model import Act, Rule
from rise_engine.scenario.xml import XmlFile
from rise_engine.syntax.xml import Element


class ElementReader:
    """Reads elements of a file into a draft; what is wrong with them becomes findings."""

    tables: Collection[str] = ()
    """The names of the scenario's tables."""

    def __init__(self, file: XmlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.file = file
        self.draft = draft
        self.diagnostics = diagnostics

    def report_error(self, code: str, element: Element, message: str, suggestion: Correction | None = None) -> None:
        """An error where an element begins."""
        self.diagnostics.error(code, self.file.element_location(element), message, suggestion)

    def report_value(
        self, code: str, element: Element, attribute: str, message: str, suggestion: Correction | None = None
    ) -> None:
        """An error where the value of an attribute begins."""
        self.diagnostics.error(code, self.file.value_location(element, attribute), message, suggestion)

    def report_attribute(
        self, code: str, element: Element, attribute: str, message: str, suggestion: Correction | None = None
    ) -> None:
        """An error where the name of an attribute begins."""
        self.diagnostics.error(code, self.file.attribute_location(element, attribute), message, suggestion)

    def report_warning(self, code: str, element: Element, message: str) -> None:
        """A warning where an element begins."""
        self.diagnostics.warning(code, self.file.element_location(element), message)

    def read_parts(
        self,
        tag: str,
        wrappers: tuple[str, ...],
        definitions: list[Definition],
        read: Callable[[Element], Act | Rule | None],
    ) -> None:
        """Add the acts or the rules of the file to `definitions`."""
        for element in self.top_elements(tag, wrappers):
            part = read(element)
            if part is not None:
                definitions.append(Definition(part, partial(self.file.value_location, element, "name")))

    def top_elements(self, tag: str, wrappers: tuple[str, ...]) -> Iterator[Element]:
        """The elements called `tag`: the outermost element itself, or the children of a wrapper."""
        root = self.file.root
        if root.tag == tag:
            yield root
            return
        if root.tag == "Template":  # a file of its own, for a template
            return
        if root.tag not in wrappers:
            near = suggest(root.tag, (tag, *wrappers)).words
            self.report_error("unknown-element", root, f"`<{root.tag}>` cannot be the outermost element here{near}")
            return
        for name in root.attributes:
            self.report_attribute("unknown-attribute", root, name, f"`<{root.tag}>` has no attributes")
        self.check_no_text(root)
        for child in root:
            if child.tag == tag:
                yield child
            else:
                message = f"`<{child.tag}>` cannot stand here; `<{root.tag}>` holds `<{tag}>`"
                self.report_error("unknown-element", child, message)

    def check_attributes(self, element: Element, known: frozenset[str]) -> dict[str, str]:
        """An element's attributes, with a finding for each that nobody reads."""
        for name in element.attributes:
            if name not in known:
                self.report_unknown_attribute(element, name, known)
        return element.attributes

    def report_unknown_attribute(self, element: Element, name: str, known: frozenset[str]) -> None:
        """An error about an attribute that nobody reads."""
        message, near = f"`<{element.tag}>` has no attribute `{name}`", suggest(name, sorted(known))
        self.report_attribute("unknown-attribute", element, name, message, near)

    def check_no_text(self, element: Element) -> None:
        """A finding for text between the children of an element that holds only elements."""
        if not self.file.has_text:
            return
        stray, behind = element.text.strip(BLANKS), None
        if not stray:
            for behind in element:
                if behind.tail and (stray := behind.tail.strip(BLANKS)):
                    break
            else:
                return
        whole = element.text if behind is None else behind.tail
        index = len(whole) - len(whole.lstrip(BLANKS))
        location = self.file.text_location(element, index) if behind is None else self.file.tail_location(behind, index)
        if find_unseen(stray) == 0:
            name = character_name(stray[0])
            message = f"the character {name} cannot stand here; delete it, or write an ordinary blank"
        else:
            message = f"text cannot stand here: `{' '.join(stray[:1000].split())[:60]}`"
        self.diagnostics.error("unexpected-text", location, message)
