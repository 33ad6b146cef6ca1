"""XML files, read by a hardened parser, with exact places for every element, attribute and character of a value.

lxml decides whether a file is well-formed, and holds it for the schema. The checks walk over a tree of our own, made by
expat: it tells line and column of every element (lxml only the line, and for a start tag over several lines the wrong
one), and walking over it costs half as much. What expat would do with a DOCTYPE does not matter: there is none.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.parsers import expat

from lxml import etree
from msgspec import Struct

from rise_engine.scenario.findings import Findings
from rise_engine.scenario.model import Place
from rise_engine.scenario.source import Source

if TYPE_CHECKING:
    from rise_engine.scenario.xml_repair import Mended


class Element(list["Element"]):
    """An element: a list of its children."""

    __slots__ = ("attributes", "column", "line", "tag", "tail", "text")

    def __init__(self, tag: str, attributes: dict[str, str], line: int, column: int) -> None:
        self.tag = tag
        self.attributes = attributes
        """In file order."""
        self.line = line
        self.column = column
        """Where its start tag begins in the text that was parsed; the line from 1, the column from 0."""
        self.text = ""
        """What stands before its first child. Comments leave no trace."""
        self.tail = ""
        """What stands behind it, before the next element."""

    def get(self, name: str) -> str | None:
        """The value of an attribute."""
        return self.attributes.get(name)


_TAG = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|</[^>]*>|<[^!?/>\"'][^>\"']*(?:\"[^\"]*\"[^>\"']*|'[^']*'[^>\"']*)*>",
    re.DOTALL,
)
_MAYBE_TEXT = re.compile(r">\s*+[^<]")
_ATTRIBUTE = re.compile(r"([^\s=/<>\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_UNIT = re.compile(r"&(?:#x[0-9A-Fa-f]+|#[0-9]+|[A-Za-z]+);|\r\n|.", re.DOTALL)
_VISIBLE = re.compile(r"(?:\s|<!--.*?-->|<\?.*?\?>)*", re.DOTALL)
_PROLOG = r"\A(?:\s|<\?.*?\?>|<!--.*?-->)*"
_DOCTYPE = re.compile(_PROLOG + r"<!DOCTYPE", re.DOTALL)
_DECLARED = re.compile(r"""\A\s*<\?xml[^>]*?\sencoding\s*=\s*["']([^"']*)["']""")


class XmlFile:
    """A well-formed file: its elements and where they stand."""

    def __init__(self, source: Source, tree: etree._Element, text: str, mended: Mended | None) -> None:
        self.source = source
        self.tree = tree
        """As lxml has it."""
        self.has_text = "<![CDATA[" in text or _MAYBE_TEXT.search(text) is not None
        """Whether there may be visible text between tags."""
        self.root = _build(text, self.has_text)
        self._parsed = source if mended is None else Source(source.name, b"", text)
        self._text = text
        self._mended = mended

    def place(self, element: Element) -> Place:
        """Where an element's start tag begins."""
        if self._mended is None:
            return Place(self.source.name, element.line, element.column + 1)
        return self._at(self._start(element))

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

    def _start(self, element: Element) -> int:
        return self._parsed.offset(element.line, element.column + 1)

    def _attribute(self, element: Element, name: str) -> re.Match[str] | None:
        tag = _TAG.match(self._text, self._start(element))
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


def expression_texts(file: XmlFile) -> tuple[list[str], list[str]]:
    """All conditions and all assignments of a rule file, as written, each once."""
    conditions: dict[str, None] = {}
    assignments: dict[str, None] = {}
    pending = [file.root]
    while pending:
        for element in pending.pop():
            if element:
                pending.append(element)
            attributes = element.attributes
            if "cond" in attributes:
                conditions[attributes["cond"]] = None
            elif "assignValue" in attributes:
                assignments[attributes["assignValue"]] = None
    return list(conditions), list(assignments)


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


def _parse(text: str) -> etree._Element:
    parser = etree.XMLParser(
        remove_comments=True,
        remove_pis=True,
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
    )
    return etree.fromstring(text.encode(), parser)


def _build(text: str, has_text: bool) -> Element:
    """The tree of a text that lxml has found well-formed."""
    parser = expat.ParserCreate("utf-8")
    outside = Element("", {}, 0, 0)
    open_elements = [outside]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber, parser.CurrentColumnNumber)
        open_elements[-1].append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        open_elements.pop()

    def characters(data: str) -> None:
        inside = open_elements[-1]
        if inside:
            inside[-1].tail += data
        else:
            inside.text += data

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    if has_text:
        parser.buffer_text = True
        parser.CharacterDataHandler = characters
    parser.Parse(text.encode(), True)
    return outside[0]


def _advance(text: str, start: int, end: int, index: int) -> int:
    """The offset of the character number `index` of a value; an entity counts as one character."""
    for _ in range(index):
        unit = _UNIT.match(text, start, end)
        if unit is None:
            break
        start = unit.end()
    return min(start, end)
