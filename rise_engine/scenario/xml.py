"""XML files, read by a hardened parser, with exact places for every element, attribute and character of a value.

lxml decides whether a file is well-formed, and says what is wrong. The checks walk over a tree of our own, made by
expat: it tells the offset of every element (lxml only the line, and for a start tag over several lines the wrong one),
and walking over it costs half as much. Names that only one of the two accepts are refused. What expat would do with a
DOCTYPE does not matter: there is none.

Whatever a file holds, reading it takes time in proportion to its length: no pattern here goes back over what it has
passed, and what is asked often of one element is worked out once.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from functools import lru_cache, partial
from xml.parsers import expat

from lxml import etree

from rise_engine.errors import RiseError
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.source_files import FileReader, SourceFile
from rise_engine.scenario.xml_repair import RepairedText, repair
from rise_engine.scenario.xml_syntax_errors import report_syntax_error
from rise_engine.text import character_name, match_end


class Element(list["Element"]):
    """An element: a list of its children."""

    __slots__ = ("attributes", "end_offset", "start_offset", "tag", "tail", "text")

    def __init__(self, tag: str, attributes: dict[str, str], at: int) -> None:
        self.tag = tag
        self.attributes = attributes
        """In file order."""
        self.start_offset = at
        """Where its start tag begins in the text that was parsed."""
        self.end_offset = at
        """Where its end tag begins; of `<empty/>`, the same as `at`."""
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
_MAYBE_TEXT = re.compile(r">[ \t\r\n]*+[^< \t\r\n]")
_ATTRIBUTE = re.compile(r"(?<=\s)([^\s=/<>\"']++)\s*+=\s*+(?:\"([^\"]*)\"|'([^']*)')")
_CHARACTER = re.compile(r"&(?:#x[0-9A-Fa-f]+|#[0-9]+|[A-Za-z]+);|\r\n")
"""What is one character of a value and several of the file."""
_LINE_END = re.compile(r"\r\n")
_DOCTYPE = re.compile(r"(?:\s++|<\?(?>.*?\?>)|<!--(?>.*?-->))*+<!DOCTYPE", re.DOTALL)
_DECLARED = re.compile(r"""\s*+<\?xml[^>]*?\sencoding\s*=\s*["']([^"']*)["']""")


class XmlNameError(RiseError, ValueError):
    """A character that no XML name can have, though lxml accepts it. `offset` is where it stands."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


class XmlFile:
    """A well-formed file: its elements and where they stand."""

    def __init__(self, repaired: RepairedText) -> None:
        """The text is well-formed. Raises XmlNameError."""
        text = repaired.text
        self.source = repaired.source
        self.has_text = "<![CDATA[" in text or _MAYBE_TEXT.search(text) is not None
        """Whether there may be visible text between tags."""
        self.root = _element_tree(text, self.has_text)
        self.may_have_templates = "<use" in text or "<Template" in text
        """Whether it may have a `<Template>` or a `<use>`."""
        self.may_define_templates = "<Template" in text
        self._text = text
        self._repaired = repaired

    @property
    def text(self) -> str:
        """What was parsed: the file's text, with its common mistakes repaired."""
        return self._text

    def end_of(self, element: Element) -> int:
        """The offset in `text` behind an element."""
        end = match_end(_TAG, self._text, element.start_offset)
        return end if self._text.endswith("/>", 0, end) else self._text.index(">", element.end_offset) + 1

    def is_complete(self, element: Element) -> bool:
        """Whether the element holds all that it should: not when a `<use>` in it has come to nothing."""
        return True

    def element_location(self, element: Element) -> SourceLocation:
        """Where an element's start tag begins."""
        return self._location(element.start_offset)

    def attribute_location(self, element: Element, name: str) -> SourceLocation:
        """Where an attribute's name stands."""
        found = _attributes_at(self._text, element.start_offset).get(name)
        return self._location(found.start(1)) if found else self.element_location(element)

    def value_location(self, element: Element, name: str, index: int = 0) -> SourceLocation:
        """Where the character number `index` (from 0) of an attribute's value stands in the file."""
        found = _attributes_at(self._text, element.start_offset).get(name)
        if found is None:
            return self.element_location(element)
        span = found.span(2 if found.group(2) is not None else 3)
        return self._location(_value_offset_map(self._text, *span).offset(index))

    def text_location(self, element: Element, index: int = 0) -> SourceLocation:
        """Where the character number `index` of an element's text (up to its first child) stands in the file."""
        return self._location(_text_offset_map(self._text, element.start_offset).offset(index))

    def written(self, element: Element) -> str:
        """An element as it is written, with its tags."""
        return self._text[element.start_offset : self.end_of(element)]

    def written_location(self, element: Element, index: int) -> SourceLocation:
        """Where the character number `index` of an element as it is written stands in the file."""
        return self._location(element.start_offset + index)

    def tail_location(self, element: Element, index: int) -> SourceLocation:
        """Where the character number `index` of what stands behind an element stands in the file."""
        return self._location(_text_offset_map(self._text, element.end_offset).offset(index))

    def _location(self, offset: int) -> SourceLocation:
        return self.source.location(self._repaired.original_offset(offset))


class _OffsetMap:
    """Which character of a value stands where in the text: stretches in which one follows the other."""

    def __init__(self) -> None:
        self.length = 0
        """Of the value."""
        self.starts: list[int] = []
        self.offsets: list[int] = []
        self.end = 0

    def add(self, text: str, start: int, end: int, units: re.Pattern[str]) -> None:
        """What stands from `start` to `end` goes on with the value."""
        for unit in units.finditer(text, start, end):
            self._add_run(start, unit.start())
            self._add_run(unit.start(), unit.start() + 1)
            start = unit.end()
        self._add_run(start, end)
        self.end = end

    def _add_run(self, start: int, end: int) -> None:
        if end > start:
            self.starts.append(self.length)
            self.offsets.append(start)
            self.length += end - start

    def offset(self, index: int) -> int:
        if index >= self.length:
            return self.end
        which = bisect_right(self.starts, index) - 1
        return self.offsets[which] + index - self.starts[which]


# Of one element many locations may be asked for in a row: each of these remembers what it worked out last.


@lru_cache(maxsize=1)
def _attributes_at(text: str, start: int) -> dict[str, re.Match[str]]:
    """The attributes of the start tag that begins there, by name."""
    return {found.group(1): found for found in _ATTRIBUTE.finditer(text, start, match_end(_TAG, text, start))}


@lru_cache(maxsize=1)
def _value_offset_map(text: str, start: int, end: int) -> _OffsetMap:
    """The value of an attribute."""
    stretches = _OffsetMap()
    stretches.add(text, start, end, _CHARACTER)
    return stretches


@lru_cache(maxsize=1)
def _text_offset_map(text: str, tag: int) -> _OffsetMap:
    """What stands behind the tag that begins there, up to the next one, comments left out."""
    stretches = _OffsetMap()
    at = match_end(_TAG, text, tag)
    while True:
        end = text.find("<", at)
        end = end if end >= 0 else len(text)
        stretches.add(text, at, end, _CHARACTER)
        inner = _TAG.match(text, end)
        if inner is None or not inner.group().startswith(("<!", "<?")):
            return stretches
        if inner.group().startswith("<![CDATA["):
            stretches.add(text, inner.start() + 9, inner.end() - 3, _LINE_END)
        at = inner.end()


def is_element_name(name: str) -> bool:
    """Whether an element can have this name."""
    try:
        _parse(f"<{name}/>")
        return _element_tree(f"<{name}/>", has_text=False).tag == name
    except (etree.XMLSyntaxError, XmlNameError, UnicodeEncodeError):
        return False


def read_xml(source: SourceFile, diagnostics: Diagnostics) -> XmlFile | None:
    """Parse a file. What is wrong with its form becomes findings; with the common mistakes repaired it is read on."""
    text = source.text
    if (doctype := _DOCTYPE.match(text)) is not None:
        diagnostics.error(
            "doctype", source.location(doctype.end() - 9), "a DOCTYPE is not allowed in scenario files; delete it"
        )
        return None
    declared = _DECLARED.match(text)
    if declared is not None and declared.group(1).lower() not in ("utf-8", "utf8", "us-ascii"):
        diagnostics.error(
            "encoding",
            source.location(declared.start(1)),
            f'this file declares the encoding {declared.group(1)}; save it as UTF-8 and declare encoding="UTF-8"',
        )
        return None
    try:
        return _read_well_formed(RepairedText(source, []), diagnostics)
    except etree.XMLSyntaxError as first:
        error = first
    before = diagnostics.errors
    repaired = repair(source, diagnostics)
    if diagnostics.errors > before:
        try:
            return _read_well_formed(repaired, diagnostics)
        except etree.XMLSyntaxError as second:
            error = second
    report_syntax_error(error, repaired, diagnostics)
    return None


def xml_of(source: SourceFile, files: FileReader) -> XmlFile | None:
    """As `read_xml`, unless it was parsed before; findings go where those of `files` go."""
    return files.memo.read(("xml", source), files.diagnostics, partial(read_xml, source))


def _read_well_formed(repaired: RepairedText, diagnostics: Diagnostics) -> XmlFile | None:
    """The file, or None after a finding about a name. Raises etree.XMLSyntaxError for what is not well-formed."""
    _parse(repaired.text)
    try:
        return XmlFile(repaired)
    except XmlNameError as error:
        location = repaired.source.location(repaired.original_offset(error.offset))
        diagnostics.error("not-well-formed", location, str(error))
        return None


def _parse(text: str) -> None:
    """Raises etree.XMLSyntaxError for a text that is not well-formed."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    etree.fromstring(text.encode(), parser)


def _element_tree(text: str, has_text: bool) -> Element:
    """The tree of a text that lxml has found well-formed. Raises XmlNameError."""
    data = text.encode()
    parser = expat.ParserCreate("utf-8")
    outside = Element("", {}, 0)
    open_elements = [outside]
    pieces: list[str] = []
    ascii_only = len(data) == len(text)
    done = offset = 0

    def current_offset() -> int:
        """The offset in `text` of what is being read."""
        nonlocal done, offset
        at = parser.CurrentByteIndex
        if ascii_only:
            return at
        offset += len(data[done:at].decode())
        done = at
        return offset

    def flush_text() -> None:
        if pieces:
            inside = open_elements[-1]
            if inside:
                inside[-1].tail = "".join(pieces)
            else:
                inside.text = "".join(pieces)
            pieces.clear()

    def on_start(tag: str, attributes: dict[str, str]) -> None:
        flush_text()
        element = Element(tag, attributes, current_offset())
        open_elements[-1].append(element)
        open_elements.append(element)

    def on_end(tag: str) -> None:
        flush_text()
        open_elements.pop().end_offset = current_offset()

    parser.StartElementHandler = on_start
    parser.EndElementHandler = on_end
    if has_text:
        parser.buffer_text = True
        parser.CharacterDataHandler = pieces.append
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        at = len(data[: max(parser.ErrorByteIndex, 0)].decode(errors="ignore"))
        character = text[at : at + 1]
        if character.isascii():  # nothing is known that leads here
            raise XmlNameError(f"this is not well-formed XML: {expat.ErrorString(error.code)}", at) from None
        shown = f"`{character}`, {character_name(character)}," if character.isprintable() else character_name(character)
        raise XmlNameError(
            f"the character {shown} cannot stand in a name; take it out, or write another letter", at
        ) from None
    return outside[0]
