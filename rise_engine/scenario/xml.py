"""XML files, read by a hardened parser, with exact places for every element, attribute and character of a value.

lxml knows only lines, and for a start tag over several lines the wrong one. But documents with a DOCTYPE are refused,
so the n-th start tag of the text is the n-th element: one quick scan of the text tells where everything stands.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, TypeAlias

from lxml import etree
from msgspec import Struct

from rise_engine.scenario.findings import Findings
from rise_engine.scenario.model import Place
from rise_engine.scenario.source import Source

if TYPE_CHECKING:
    from rise_engine.scenario.xml_repair import Mended

Element: TypeAlias = "etree._Element"

_TAG = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|</[^>]*>|<[^!?/>\"'][^>\"']*(?:\"[^\"]*\"[^>\"']*|'[^']*'[^>\"']*)*>",
    re.DOTALL,
)
_START = re.compile(r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|<[^/]", re.DOTALL)
_PLAIN_START = re.compile(r"<[^/]")
_ATTRIBUTE = re.compile(r"([^\s=/<>\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_UNIT = re.compile(r"&(?:#x[0-9A-Fa-f]+|#[0-9]+|[A-Za-z]+);|\r\n|.", re.DOTALL)
_VISIBLE = re.compile(r"(?:\s|<!--.*?-->|<\?.*?\?>)*", re.DOTALL)
_PROLOG = r"\A(?:\s|<\?.*?\?>|<!--.*?-->)*"
_DOCTYPE = re.compile(_PROLOG + r"<!DOCTYPE", re.DOTALL)
_DECLARED = re.compile(r"""\A\s*<\?xml[^>]*?\sencoding\s*=\s*["']([^"']*)["']""")


class XmlFile:
    """A well-formed file: its elements and where they stand."""

    def __init__(self, source: Source, root: Element, text: str, mended: Mended | None) -> None:
        self.source = source
        self.root = root
        self._text = text
        self._mended = mended
        self._starts: list[int] | None = None
        """Offsets of all start tags, in document order."""
        self._places: dict[Element, Place] = {}
        self._order: dict[Element, int] = {}

    def place(self, element: Element) -> Place:
        """Where an element's start tag begins."""
        if self._starts is None:
            self._locate()
        return self._places.get(element) or self._about(element)

    @property
    def has_text(self) -> bool:
        """Whether there is any visible text between tags."""
        return bool(self.root.xpath("boolean(//text()[normalize-space()])"))

    def attribute_place(self, element: Element, name: str) -> Place:
        """Where an attribute's name stands."""
        found = self._attribute(element, name)
        return self._at(found.start(1)) if found else self.place(element)

    def value_place(self, element: Element, name: str, index: int = 0) -> Place:
        """Where the character number `index` (from 0) of an attribute's value stands in the file."""
        found = self._attribute(element, name)
        if found is None:
            return self.place(element)
        group = 2 if found.group(2) is not None else 3
        return self._at(_advance(self._text, found.start(group), found.end(group), index))

    def text_place(self, element: Element, index: int = 0) -> Place:
        """Where the character number `index` of an element's text (up to its first child) stands in the file."""
        start = self._start(element)
        if start is None:
            return self._about(element)
        tag = _TAG.match(self._text, start)
        at = tag.end() if tag else start
        while True:
            end = self._text.find("<", at)
            end = end if end >= 0 else len(self._text)
            length = len(_UNIT.findall(self._text, at, end))
            if index < length:
                return self._at(_advance(self._text, at, end, index))
            index -= length
            inner = _TAG.match(self._text, end)
            if inner is None or not inner.group().startswith(("<!", "<?")):
                return self._at(end)
            if inner.group().startswith("<![CDATA["):
                if index < (length := len(inner.group()) - 12):
                    return self._at(inner.start() + 9 + index)
                index -= length
            at = inner.end()

    def tail_place(self, element: Element) -> Place:
        """Where the first visible character behind an element's end stands."""
        start = self._start(element)
        if start is None:
            return self._about(element)
        depth = 0
        for tag in _TAG.finditer(self._text, start):
            written = tag.group()
            if written.startswith("</"):
                depth -= 1
            elif written[1] not in "!?" and not written.endswith("/>"):
                depth += 1
            if depth == 0:
                visible = _VISIBLE.match(self._text, tag.end())
                return self._at(visible.end() if visible else tag.end())
        return self._at(start)

    def _at(self, offset: int) -> Place:
        return self.source.place(self._mended.original(offset) if self._mended else offset)

    def _about(self, element: Element) -> Place:
        line: Any = element.sourceline  # its type in the stubs is a placeholder
        return Place(self.source.name, line or 1)

    def _start(self, element: Element) -> int | None:
        if self._starts is None:
            self._locate()
        assert self._starts is not None
        if not self._order:
            self._order = {each: index for index, each in enumerate(self._places)}
        index = self._order.get(element)
        return self._starts[index] if index is not None else None

    def _locate(self) -> None:
        """Find every start tag. Should the count ever be wrong, lines must do."""
        text = self._text
        if "<!" in text or "<?" in text:
            starts = [tag.start() for tag in _START.finditer(text) if text[tag.start() + 1] not in "!?"]
        else:
            starts = [tag.start() for tag in _PLAIN_START.finditer(text)]
        elements = list(self.root.iter())
        if len(starts) != len(elements):
            starts, elements = [], []
        self._starts = starts
        if self._mended:
            starts = [self._mended.original(start) for start in starts]
        self._places = dict(zip(elements, self.source.places(starts), strict=True))

    def _attribute(self, element: Element, name: str) -> re.Match[str] | None:
        start = self._start(element)
        tag = _TAG.match(self._text, start) if start is not None else None
        if tag is None:
            return None
        for found in _ATTRIBUTE.finditer(self._text, tag.start(), tag.end()):
            if found.group(1) == name:
                return found
        return None


class Spot(Struct, frozen=True, gc=False):
    """A place that is worked out only when a finding needs it."""

    file: XmlFile
    element: Element
    attribute: str | None = None
    """None: the element's text, or the element itself when `at` is None too."""
    at: int | None = None

    @property
    def place(self) -> Place:
        if self.attribute is not None:
            return self.file.value_place(self.element, self.attribute, self.at or 0)
        if self.at is not None:
            return self.file.text_place(self.element, self.at)
        return self.file.place(self.element)


_CONDITIONS = etree.XPath("//@cond", smart_strings=False)
_ASSIGNMENTS = etree.XPath("//@assignValue", smart_strings=False)


def expression_texts(file: XmlFile) -> tuple[list[str], list[str]]:
    """All conditions and all assignments of a rule file, as written."""
    conditions: Any = _CONDITIONS(file.root)
    assignments: Any = _ASSIGNMENTS(file.root)
    return list(dict.fromkeys(conditions)), list(dict.fromkeys(assignments))


def attribute_names(element: Element) -> list[str]:
    """The names of an element's attributes, in file order."""
    return [str(name) for name in element.keys()]  # noqa: SIM118  # lxml elements are no mappings


def read_xml(source: Source, findings: Findings) -> XmlFile | None:
    """Parse a file. What is wrong with its form becomes findings; with the common mistakes mended it is read on."""
    text = source.text
    if (doctype := _DOCTYPE.match(text)) is not None:
        findings.error(
            "doctype", source.place(doctype.end() - 9), "a DOCTYPE is not allowed in scenario files; delete it"
        )
        return None
    declared = _DECLARED.match(text)
    if declared is not None and declared.group(1).lower() not in ("utf-8", "utf8", "us-ascii"):
        findings.error(
            "encoding",
            source.place(declared.start(1)),
            f'this file declares the encoding {declared.group(1)}; save it as UTF-8 and declare encoding="UTF-8"',
        )
        return None
    try:
        return XmlFile(source, _parse(text), text, None)
    except etree.XMLSyntaxError as first:
        error = first
        from rise_engine.scenario.xml_repair import mend

        before = findings.errors
        mended = mend(source, findings)
        if findings.errors > before:
            try:
                return XmlFile(source, _parse(mended.text), mended.text, mended)
            except etree.XMLSyntaxError as second:
                error = second
        from rise_engine.scenario.xml_syntax import report_syntax

        report_syntax(error, mended, findings)
        return None


def _parse(text: str) -> Element:
    parser = etree.XMLParser(
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
    )
    return etree.fromstring(text.encode(), parser)


def _advance(text: str, start: int, end: int, index: int) -> int:
    """The offset of the character number `index` of a value; an entity counts as one character."""
    for _ in range(index):
        unit = _UNIT.match(text, start, end)
        if unit is None:
            break
        start = unit.end()
    return min(start, end)
