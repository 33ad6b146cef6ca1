"""Expands the templates of a file, and writes it without templates."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from xml.sax.saxutils import escape

from rise_engine.base.text import BLANKS
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.xml import ExpandedElement, TemplateCall, XmlFile
from rise_engine.scenario.grammar import form_of
from rise_engine.scenario.reading.element_templates import TemplateCollection
from rise_engine.syntax.xml import Element

MAX_ELEMENTS = 100_000
"""Maximum number of elements that templates may add to one scenario."""
MAX_CHARACTERS = 10_000_000
"""Maximum characters of attributes and texts that they may add."""
MAX_LEVELS = 100
"""Maximum nesting of elements in a file with templates."""


def expand_files(files: Sequence[XmlFile], templates: TemplateCollection) -> list[XmlFile]:
    """Expand the templates in these files, within limits for all files together."""
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
    """The elements that contain a `<use>` or a `<Template>` at any depth."""
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
        """The file that is being expanded."""
        self._holders: set[Element] = set()
        """The elements of that file that contain uses or templates; all others stay unchanged."""
        self._has_failed = False
        """Whether a use in the current element could not be expanded."""

    def expand(self, file: XmlFile) -> XmlFile:
        """Expand the templates in a file; returns the same file if it has none."""
        if not file.may_have_templates or file.root.tag == "Template":
            return file
        self._holders = _holders(file.root)
        root = ExpandedElement(file.root, None)
        self._file = XmlFile(file.source, file.tree, file.repaired, root)
        self._has_failed = False
        self._add_content(root, file.root, None, 1)
        if self.is_full:  # half an act would only be reported as wrong
            root.clear()
            self._file.incomplete.add(root)
        return self._file

    def _add_content(self, new: Element, old: Element, call: TemplateCall | None, level: int) -> None:
        """Fill a new element with the expanded content of the old one."""
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
            element.tail = ""  # text between a template's elements already has a diagnostic
        if call is None:
            self._file.brought[child] = new[before:]

    def _check_limits(self, element: Element, level: int) -> bool:
        """Whether the limits allow more. Reports a diagnostic at the first excess."""
        problem = ("", "")
        if level > MAX_LEVELS:
            problem = ("too-deep", f"with its templates, this lies more than {MAX_LEVELS} elements deep")
        elif self.elements > MAX_ELEMENTS:
            problem = ("too-large", f"the templates of this scenario would make more than {MAX_ELEMENTS} elements")
        elif self.characters > MAX_CHARACTERS:
            problem = ("too-large", f"the templates would make more than {MAX_CHARACTERS} characters")
        if problem[0] and not self.is_full:
            self.is_full = True
            self.diagnostics.error(problem[0], self._file.element_location(element), problem[1])
        self._has_failed |= self.is_full
        return not self.is_full


# --- a file without templates -----------------------------------------------------------------------------------------


_IN_VALUES = {'"': "&quot;", "\n": "&#10;", "\t": "&#9;", "\r": "&#13;"}
_IN_TEXTS = {"\r": "&#13;"}
_SLOTS = re.compile(r"\{[^}]*\}")
_QUOTED = re.compile(r"""\"[^\"]*\"|'[^']*'""")
_INDEX = re.compile(r"[\w)]\s*\[")


def plain_text(file: XmlFile) -> str:
    """The text of a file with its templates expanded; empty: it contains only templates.

    All other text stays, including comments and line breaks.
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
    """Yield the outermost templates and uses of a file, in file order."""
    for child in parent:
        if child.tag in ("Template", "use"):
            yield child
        else:
            yield from _templates_and_uses(child)


def _with_surroundings(text: str, start: int, end: int) -> tuple[int, int]:
    """The range of a template with the comment directly before it, and with lines that would become empty."""
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
    """An element as XML. Its children get their own lines, indented by two more blanks."""
    attributes = "".join(f' {name}="{escape(value, _IN_VALUES)}"' for name, value in element.attributes.items())
    if any(child.tag == "speak" for child in element):  # blanks in SSML belong to the text
        return f"<{element.tag}{attributes}>{''.join(_markup(child) for child in element)}</{element.tag}>"
    if len(element):
        inner = "".join(f"{indent}  {element_text(child, indent + '  ')}\n" for child in element)
        return f"<{element.tag}{attributes}>\n{inner}{indent}</{element.tag}>"
    if element.text:
        return f"<{element.tag}{attributes}>{escape(element.text, _IN_TEXTS)}</{element.tag}>"
    return f"<{element.tag}{attributes}/>"


def _markup(element: Element) -> str:
    """An element within a text, with its content unchanged."""
    attributes = "".join(f' {name}="{escape(value, _IN_VALUES)}"' for name, value in element.attributes.items())
    inner = escape(element.text, _IN_TEXTS) + "".join(
        _markup(child) + escape(child.tail, _IN_TEXTS) for child in element
    )
    return f"<{element.tag}{attributes}>{inner}</{element.tag}>" if inner else f"<{element.tag}{attributes}/>"


def additions(files: Iterable[XmlFile]) -> Counter[str]:
    """Count the extensions in these expanded files that RISE does not know."""
    found: Counter[str] = Counter()
    rest = [file.root for file in files if file.root.tag != "Template"]
    while rest:
        element = rest.pop()
        rest += element
        form = form_of(element.tag)
        found[f"`<{element.tag}>`"] += not form.in_rise
        forms = [
            (form.attributes[name], name, value)
            for name, value in element.attributes.items()
            if name in form.attributes
        ]
        found.update(f"`{name}` of `<{element.tag}>`" for each, name, _ in forms if not each.in_rise)
        written = [value for each, _, value in forms if each.holds in ("expression", "delay", "assignment")]
        written += _SLOTS.findall(element.text) if not len(element) else []
        found["parts of values by index"] += sum(_INDEX.search(_QUOTED.sub("''", text)) is not None for text in written)
        if element.tag == "transition" and "target" not in element.attributes:
            found["transitions without `target`"] += 1
        elif element.tag == "waitForActions" and ("," in element.text or ";" in element.text):
            found["several ids in `<waitForActions>`"] += 1
        elif element.tag == "speak":
            found["SSML"] += 1
        elif not len(element) and "{" in element.text:
            found["memory values in braces"] += 1
    return +found
