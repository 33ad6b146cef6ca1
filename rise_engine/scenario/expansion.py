"""Puts the elements of templates where `<use>` stands, before anything is read as acts and rules."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.element_templates import TemplateCollection
from rise_engine.scenario.xml import ExpandedElement, TemplateCall, XmlFile
from rise_engine.syntax.xml import Element

MAX_ELEMENTS = 100_000
"""How many elements may come from templates in one scenario."""
MAX_CHARACTERS = 10_000_000
"""How many characters of attributes and texts may."""
MAX_LEVELS = 100
"""How deep elements may lie in each other, in a file with templates."""


def expand_files(files: Sequence[XmlFile], templates: TemplateCollection) -> list[XmlFile]:
    """These files with their templates put in, within limits for all of them together."""
    expanded: list[XmlFile] = []
    elements = characters = 0
    for file in files:
        if not file.may_have_templates or file.root.tag == "Template":
            expanded.append(file)
            continue
        new, expander = templates.memo.get(
            ("expanded", file, templates.stamp_of(file)), partial(_expand, file, templates)
        )
        expanded.append(new)
        elements, characters = elements + expander.elements, characters + expander.characters
        if expander.is_full or elements > MAX_ELEMENTS or characters > MAX_CHARACTERS:
            whole = _Expander(templates, templates.diagnostics)
            return [whole.expand(each) for each in files]
    return expanded


def _expand(file: XmlFile, templates: TemplateCollection) -> tuple[XmlFile, _Expander]:
    expander = _Expander(templates, Diagnostics())
    return expander.expand(file), expander


def _holders(root: Element) -> set[Element]:
    """What holds a `<use>` or a `<Template>`, however deep."""
    found: set[Element] = set()
    for element in root.walk():
        if element.tag in ("use", "Template"):
            holder = element.parent
            while holder is not None and holder not in found:
                found.add(holder)
                holder = holder.parent
    return found


class _Expander:
    """Expands files, within limits for all of them together."""

    def __init__(self, templates: TemplateCollection, diagnostics: Diagnostics) -> None:
        self.meant = templates.meant
        self.circular = templates.circular
        self.diagnostics = diagnostics
        self.elements = 0
        self.characters = 0
        self.is_full = False
        self._file: XmlFile
        """The one that is being expanded."""
        self._holders: set[Element] = set()
        """The elements of that file in which templates are used or stand; all others stay as they are."""
        self._has_failed = False
        """Whether something has come to nothing in the element that is being expanded."""

    def expand(self, file: XmlFile) -> XmlFile:
        """The file with its templates put in; the same one when it has none."""
        if not file.may_have_templates or file.root.tag == "Template":
            return file
        self._holders = _holders(file.root)
        root = ExpandedElement(file.root, None)
        self._file = XmlFile(file.source, file.tree, file.repaired, root)
        self._has_failed = False
        self._add_content(root, file.root, None, 1)
        if self.is_full:  # half an act would only be called wrong
            root.clear()
            self._file.incomplete.add(root)
        return self._file

    def _add_content(self, new: Element, old: Element, call: TemplateCall | None, level: int) -> None:
        """Give an element what the one holds that it is made of."""
        for child in old:
            if child.tag == "use":
                self._add_use(new, child, call, level)
            elif child.tag != "Template":
                self._add_copy(new, child, call, level)
        if self._has_failed:
            self._file.incomplete.add(new)

    def _add_copy(self, new: Element, child: Element, call: TemplateCall | None, level: int) -> None:
        if call is None and child not in self._holders:
            new.append(child)
            return
        copy = ExpandedElement(child, call)
        if call is not None:
            self.elements += 1
            self.characters += len(copy.text) + len(copy.tail) + sum(map(len, copy.attributes.values()))
            if not self._check_limits(copy, level):
                return
        new.append(copy)
        outside, self._has_failed = self._has_failed, False
        if len(child):
            self._add_content(copy, child, call, level + 1)
        self._has_failed |= outside

    def _add_use(self, new: Element, child: Element, call: TemplateCall | None, level: int) -> None:
        template = self.meant.get(child)
        if template is None or template.name in self.circular:
            self._has_failed = True
            return
        use = child if call is None else ExpandedElement(child, call)
        inner = TemplateCall(template.name, template.file, template.defaults, use)
        if not self._check_limits(use, level):
            return
        self._file.has_text |= template.file.has_text
        before = len(new)
        for element in template.content:
            if element.tag == "use":
                self._add_use(new, element, inner, level + 1)
            elif element.tag != "Template":
                self._add_copy(new, element, inner, level)
        for element in new[before:]:
            element.tail = ""  # between what a template holds, text is a finding already
        if call is None:
            self._file.brought[child] = new[before:]

    def _check_limits(self, element: Element, level: int) -> bool:
        """Whether there may be more; the first time not, a finding."""
        problem = ("", "")
        if level > MAX_LEVELS:
            problem = ("too-deep", f"with its templates, this lies more than {MAX_LEVELS} elements deep")
        elif self.elements > MAX_ELEMENTS:
            problem = ("too-large", f"more than {MAX_ELEMENTS} elements would come of the templates of this scenario")
        elif self.characters > MAX_CHARACTERS:
            problem = ("too-large", f"more than {MAX_CHARACTERS} characters would come of the templates")
        if problem[0] and not self.is_full:
            self.is_full = True
            self.diagnostics.error(problem[0], self._file.element_location(element), problem[1])
        self._has_failed |= self.is_full
        return not self.is_full
