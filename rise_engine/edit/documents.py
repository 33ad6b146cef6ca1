"""XML files by bytes: where every element, attribute and text begins and ends, and whether comments stand in it.

The places are those that expat tells in bytes, so that line ends of any kind, a byte order mark and characters of
several bytes shift nothing. What is read here is what the file says, templates not put in, right or wrong.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import cached_property
from xml.parsers import expat

from rise_engine.edit.content_cache import ContentCache
from rise_engine.errors import RiseError

_START_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*/?>")
_ATTRIBUTE = re.compile(rb"\s+([^\s=/<>\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_LINE_END = re.compile(rb"\r\n?|\n")
_BYTE_BLANKS = b" \t\r\n"
_BLANK_RUN = re.compile(rb"[ \t\r\n]*")
CDATA = b"<![CDATA["
_DEEPEST = 1000
"""Elements in each other. The reader of scenarios takes far fewer."""


class NotXmlError(RiseError, ValueError):
    """A file that is no XML, and what is wrong with it first."""


class WrittenAttribute:
    """An attribute as it stands in its start tag."""

    __slots__ = ("end", "name", "quote", "start", "value_end", "value_start")

    def __init__(self, found: re.Match[bytes]) -> None:
        which = 2 if found.group(2) is not None else 3
        self.name = found.group(1).decode()
        self.start = found.start()
        """Where the blanks before it begin."""
        self.value_start, self.value_end = found.span(which)
        """Between its quotation marks."""
        self.quote = '"' if which == 2 else "'"
        self.end = found.end()


class Node:
    """An element and where it stands in its file, in bytes."""

    __slots__ = (
        *("attributes", "children", "document", "end", "end_tag", "inner_start", "marks", "parent", "start", "tag"),
        *("tail", "text"),
    )

    def __init__(self, document: XmlDocument, tag: str, attributes: dict[str, str], start: int) -> None:
        self.document = document
        self.tag = tag
        self.attributes = attributes
        """In file order, as XML reads them."""
        self.start = start
        self.inner_start = start
        """Behind its start tag."""
        self.end_tag = start
        """Where its end tag begins; of `<empty/>`, the same as `start`."""
        self.end = start
        """Behind it."""
        self.parent: Node | None = None
        self.children: list[Node] = []
        self.text = ""
        """What stands before its first child, comments left out."""
        self.tail = ""
        """What stands behind it, before the next element."""
        self.marks: set[str] = set()
        """What stands in it besides text and elements: "comment", "instruction", "CDATA"."""

    def get(self, name: str) -> str:
        """The value of an attribute without blanks around it; empty: it has none."""
        return self.attributes.get(name, "").strip()

    @property
    def line(self) -> int:
        return self.document.line(self.start)

    @property
    def is_closed(self) -> bool:
        """Whether it is written `<empty/>`."""
        return self.end_tag == self.start

    @property
    def inner_end(self) -> int:
        """Where its end tag begins; of `<empty/>`, behind it."""
        return self.end if self.is_closed else self.end_tag

    def written_attributes(self) -> dict[str, WrittenAttribute]:
        """Where its attributes stand, by name, in file order."""
        data, end = self.document.data, self.inner_start
        at = self.start + 1 + len(self.tag.encode())
        found = (WrittenAttribute(each) for each in _ATTRIBUTE.finditer(data, at, end))
        return {each.name: each for each in found}

    def text_span(self) -> tuple[int, int]:
        """Where its text stands, without the blanks around it; inside the marks of a CDATA section that is all."""
        data = self.document.data
        start, end = self.inner_start, self.inner_end
        start, end = _without_blanks(data, start, end)
        if data.startswith(CDATA, start) and data.find(b"]]>", start) == end - 3 and end - 3 >= start + len(CDATA):
            start, end = _without_blanks(data, start + len(CDATA), end - 3)
        return start, end

    @property
    def is_cdata(self) -> bool:
        """Whether its text is one CDATA section and nothing else."""
        if "CDATA" not in self.marks:
            return False
        start, end = _without_blanks(self.document.data, self.inner_start, self.inner_end)
        data = self.document.data
        return data.startswith(CDATA, start) and data.find(b"]]>", start) == end - 3

    def text_obstacle(self) -> str:
        """Why its text cannot be replaced without losing something; empty: it can."""
        if self.children:
            return f"`<{self.children[0].tag}>` stands in it"
        if "comment" in self.marks:
            return "a comment stands in it"
        if "instruction" in self.marks:
            return "an XML instruction stands in it"
        if "CDATA" in self.marks and not self.is_cdata:
            return "text and CDATA stand side by side in it"
        return ""

    def walk(self) -> Iterator[Node]:
        """It and all that it holds, in file order."""
        rest = [self]
        while rest:
            node = rest.pop()
            yield node
            rest += node.children[::-1]

    def written(self) -> bytes:
        """As it stands in the file."""
        return self.document.data[self.start : self.end]


class XmlDocument:
    """A file of acts or rules."""

    def __init__(self, data: bytes) -> None:
        """:raises NotXmlError: it is not well-formed, or has a DOCTYPE."""
        self.data = data
        self.root = _read(self)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(found.end() for found in _LINE_END.finditer(self.data))]

    def line(self, at: int) -> int:
        """The number of the line, from 1, in which a byte stands. Lines end with LF, CRLF or CR."""
        return bisect_right(self._line_starts, at)

    def node_at(self, start: int) -> Node:
        """The element that begins at a byte. :raises KeyError: none does."""
        node = self.root
        while node.start != start:
            index = bisect_right(node.children, start, key=_start_of) - 1
            if index < 0 or start >= node.children[index].end:
                raise KeyError(start)
            node = node.children[index]
        return node


def _start_of(node: Node) -> int:
    return node.start


def _without_blanks(data: bytes, start: int, end: int) -> tuple[int, int]:
    found = _BLANK_RUN.match(data, start, end)
    start = found.end() if found else start
    while end > start and data[end - 1] in _BYTE_BLANKS:
        end -= 1
    return start, end


_DOCUMENTS: ContentCache[XmlDocument] = ContentCache()


def read_document(data: bytes) -> XmlDocument:
    """A file's elements; the same content is not read again. :raises NotXmlError: it is no XML."""
    return _DOCUMENTS.get(data, len(data), lambda: XmlDocument(data))


class _Reader:
    """Makes nodes of what expat finds."""

    def __init__(self, document: XmlDocument) -> None:
        self.document = document
        self.outside = Node(document, "", {}, 0)
        self.open = [self.outside]
        self.pieces: list[str] = []
        self.parser = parser = expat.ParserCreate("utf-8")
        parser.buffer_text = True
        parser.StartElementHandler = self.on_start
        parser.EndElementHandler = self.on_end
        parser.CharacterDataHandler = self.pieces.append
        parser.CommentHandler = self.on_comment
        parser.ProcessingInstructionHandler = self.on_instruction
        parser.StartCdataSectionHandler = self.on_cdata
        parser.StartDoctypeDeclHandler = self.on_doctype

    def read(self) -> Node:
        data = self.document.data
        if data.startswith((b"\xff\xfe", b"\xfe\xff")) or data[:4].count(0) >= 2:
            raise NotXmlError("this file is UTF-16 or UTF-32; save it as UTF-8")
        try:
            self.parser.Parse(data, True)
        except expat.ExpatError as error:
            line, problem = error.lineno, expat.ErrorString(error.code)
            raise NotXmlError(f"line {line}: this is not well-formed XML ({problem})") from None
        return self.outside.children[0]

    def flush(self) -> None:
        if self.pieces:
            inside = self.open[-1]
            text = "".join(self.pieces)
            if inside.children:
                inside.children[-1].tail += text
            else:
                inside.text += text
            self.pieces.clear()

    def on_start(self, tag: str, attributes: dict[str, str]) -> None:
        self.flush()
        node = Node(self.document, tag, attributes, self.parser.CurrentByteIndex)
        node.parent = self.open[-1] if len(self.open) > 1 else None
        self.open[-1].children.append(node)
        self.open.append(node)
        if len(self.open) > _DEEPEST:
            raise NotXmlError(f"line {self.parser.CurrentLineNumber}: elements lie more than {_DEEPEST} deep here")

    def on_end(self, _tag: str) -> None:
        self.flush()
        node, data = self.open.pop(), self.document.data
        tag = _START_TAG.match(data, node.start)
        assert tag is not None, "expat has found a start tag here"
        node.inner_start = node.end = tag.end()
        if not data.endswith(b"/>", 0, node.end):
            node.end_tag = self.parser.CurrentByteIndex
            node.end = data.index(b">", node.end_tag) + 1

    def on_comment(self, _text: str) -> None:
        self.open[-1].marks.add("comment")

    def on_instruction(self, _target: str, _text: str) -> None:
        self.open[-1].marks.add("instruction")

    def on_cdata(self) -> None:
        self.open[-1].marks.add("CDATA")

    def on_doctype(self, *_: object) -> None:
        raise NotXmlError(
            f"line {self.parser.CurrentLineNumber}: a DOCTYPE is not allowed in scenario files; delete it"
        )


def _read(document: XmlDocument) -> Node:
    return _Reader(document).read()
