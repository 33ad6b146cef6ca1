"""XML as a tree with the places of all parts in its text, so that unchanged parts keep their characters.

expat builds the tree and gives the offset of every element. lxml describes the errors of texts that expat cannot read,
and checks what the two disagree on: prefixes of names, and deeply nested elements.

Reading takes linear time for any text: no pattern backtracks far, and results that are often needed for one element are
computed once.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple, TypeAlias
from xml.parsers import expat

from rise_engine.base.errors import RiseError
from rise_engine.base.text import BLANKS, character_name, match_end

PieceKind: TypeAlias = Literal["text", "comment", "instruction", "CDATA"]
ENTITY = re.compile(r"&(?:#x([0-9A-Fa-f]+)|#([0-9]+)|([A-Za-z]+));")
CDATA = "<![CDATA["
_NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}
_TAG = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|</[^>]*>|<[^!?/>\"'][^>\"']*(?:\"[^\"]*\"[^>\"']*|'[^']*'[^>\"']*)*>",
    re.DOTALL,
)
_PIECE = re.compile(
    r"(?P<comment><!--.*?-->)|(?P<CDATA><!\[CDATA\[.*?\]\]>)|(?P<instruction><\?.*?\?>)|(?P<text>[^<]+)", re.DOTALL
)
_MAYBE_TEXT = re.compile(r">[ \t\r\n]*+[^< \t\r\n]")
_ATTRIBUTE = re.compile(r"(?<=\s)([^\s=/<>\"']++)\s*+=\s*+(?:\"([^\"]*)\"|'([^']*)')")
_CHARACTER = re.compile(rf"{ENTITY.pattern}|\r\n")
"""One character of a value that takes several in the file."""
_LINE_END = re.compile(r"\r\n?|\n")
_CRLF = re.compile(r"\r\n")
_DOCTYPE = re.compile(r"(?:\s++|<\?(?>.*?\?>)|<!--(?>.*?-->))*+<!DOCTYPE", re.DOTALL)
_DECLARED = re.compile(r"""\s*+<\?xml[^>]*?\sencoding\s*=\s*["']([^"']*)["']""")
_USUAL_DECLARATION = re.compile(r"""<\?xml version=["']1\.0["'](?: encoding=["'][Uu][Tt][Ff]-?8["'])? ?\?>""")
_PREFIX = re.compile(r"<[^\s<>/!?]*:|(?<=\s)[^\s=/<>\"']*:[^\s=/<>\"']*+\s*+=\s*+[\"']|(?<=\s)xmlns\b")
_CHECKED_DEPTH = 200
"""Nesting of elements from which lxml checks them. libxml2 allows 256."""
_LONG = 40_000
"""Length of a name from which lxml checks it. libxml2 allows 50,000 characters."""


class XmlSyntaxError(RiseError, ValueError):
    """A text is not XML, or not accepted: the first error as a sentence, and its place."""

    def __init__(self, code: str, offset: int, message: str, *, is_final: bool = False) -> None:
        super().__init__(message)
        self.code = code
        """The code of a diagnostic."""
        self.offset = offset
        self.is_final = is_final
        """Whether no repair is possible."""


class Element(list["Element"]):
    """An element: a list of its children."""

    __slots__ = ("attributes", "close", "parent", "start", "tag", "tail", "text", "tree")

    def __init__(self, tag: str, attributes: dict[str, str], start: int, tree: XmlTree, parent: Element | None) -> None:
        self.tag = tag
        self.attributes = attributes
        """In file order, with entities resolved."""
        self.start = start
        """The start of its start tag in the text of its tree."""
        self.close = start
        """The start of its end tag; for `<empty/>`, the offset that expat reports."""
        self.text = ""
        """The text before its first child. Comments leave no trace."""
        self.tail = ""
        """The text after it, before the next element."""
        self.tree = tree
        self.parent = parent

    def __eq__(self, other: object) -> bool:
        return self is other

    def __ne__(self, other: object) -> bool:
        return self is not other

    def __hash__(self) -> int:  # type: ignore[override]
        return id(self)

    def get(self, name: str) -> str | None:
        """The value of an attribute."""
        return self.attributes.get(name)

    @property
    def is_closed(self) -> bool:
        """Whether it is written `<empty/>`."""
        return self.tree.text.startswith("/>", self.inner_start - 2)

    @property
    def inner_start(self) -> int:
        """The offset after its start tag."""
        return match_end(_TAG, self.tree.text, self.start)

    @property
    def inner_end(self) -> int:
        """The start of its end tag; for `<empty/>`, the offset after it."""
        return self.inner_start if self.is_closed else self.close

    @property
    def end(self) -> int:
        """The offset after its last character."""
        return self.inner_start if self.is_closed else self.tree.text.index(">", self.close) + 1

    @property
    def line(self) -> int:
        """The number of the line in which it begins, from 1."""
        return self.tree.line(self.start)

    @property
    def written(self) -> str:
        """Its written form, with its tags."""
        return self.tree.text[self.start : self.end]

    def walk(self) -> Iterator[Element]:
        """Yield it and its contents, in file order."""
        rest = [self]
        while rest:
            element = rest.pop()
            yield element
            rest += element[::-1]

    # --- its written content ------------------------------------------------------------------------------------------

    def written_attributes(self) -> dict[str, WrittenAttribute]:
        """The places of its attributes, by name, in file order."""
        return _attributes_at(self.tree.text, self.start)

    def gaps(self) -> list[tuple[int, int]]:
        """The ranges between its tags and those of its children."""
        starts = [self.inner_start, *(child.end for child in self)]
        return list(zip(starts, [*(child.start for child in self), self.inner_end], strict=True))

    def marks(self) -> set[PieceKind]:
        """The kinds of pieces in it other than text and elements."""
        found = {piece.kind for gap in self.gaps() for piece in pieces(self.tree.text, *gap)}
        return found - {"text"}

    def text_span(self) -> tuple[int, int]:
        """The range of its text without surrounding blanks, or within the marks of its only CDATA section."""
        text = self.tree.text
        start, end = without_blanks(text, self.inner_start, self.inner_end)
        if self._is_cdata(start, end):
            start, end = without_blanks(text, start + len(CDATA), end - 3)
        return start, end

    @property
    def is_cdata(self) -> bool:
        """Whether its text is one CDATA section and nothing else."""
        return self._is_cdata(*without_blanks(self.tree.text, self.inner_start, self.inner_end))

    def _is_cdata(self, start: int, end: int) -> bool:
        return self.tree.text.startswith(CDATA, start, end) and self.tree.text.find("]]>", start) == end - 3

    def text_obstacle(self) -> str:
        """Why replacing its text would lose content; empty: it would not."""
        if self:
            return f"`<{self[0].tag}>` is in it"
        marks = self.marks()
        if "comment" in marks:
            return "a comment is in it"
        if "instruction" in marks:
            return "an XML instruction is in it"
        return "text and CDATA are side by side in it" if "CDATA" in marks and not self.is_cdata else ""

    # --- places of characters -----------------------------------------------------------------------------------------

    def attribute_at(self, offset: int) -> WrittenAttribute | None:
        """The attribute whose value, or end of value, contains an offset."""
        attributes = self.written_attributes().values()
        return next((each for each in attributes if each.value_start <= offset <= each.value_end), None)

    def attribute_offset(self, name: str) -> int:
        """The start of an attribute's name; if there is none, of the element."""
        found = self.written_attributes().get(name)
        return found.name_start if found else self.start

    def value_offset(self, name: str, index: int = 0) -> int:
        """The offset of the character number `index` (from 0) of an attribute's value."""
        found = self.written_attributes().get(name)
        if found is None:
            return self.start
        return _value_offset_map(self.tree.text, found.value_start, found.value_end).offset(index)

    def text_offset(self, index: int = 0) -> int:
        """The offset of the character number `index` of its text (up to its first child)."""
        return _text_offset_map(self.tree.text, self.start).offset(index)

    def tail_offset(self, index: int) -> int:
        """The offset of the character number `index` of its tail."""
        return _text_offset_map(self.tree.text, self.close).offset(index)


class XmlTree:
    """A well-formed text and its elements."""

    def __init__(self, text: str, name: str = "") -> None:
        """
        :param text: without byte order mark.
        :param name: of the file with this text.
        :raises XmlSyntaxError: it is not well-formed, has a DOCTYPE, or declares another encoding.
        """
        _check_prolog(text)
        self.text = text
        self.name = name
        self.has_text = CDATA in text or _MAYBE_TEXT.search(text) is not None
        """Whether there may be visible text between tags."""
        self.root = _read(self)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(found.end() for found in _LINE_END.finditer(self.text))]

    def line(self, offset: int) -> int:
        """The number of the line, from 1, of an offset. Lines end with LF, CRLF or CR."""
        return bisect_right(self._line_starts, offset)

    def element_at(self, offset: int) -> Element:
        """The innermost element that contains an offset; the outermost element if none does."""
        found = self.root
        while (index := bisect_right(found, offset, key=lambda child: child.start)) and offset < found[index - 1].end:
            found = found[index - 1]
        return found


class WrittenAttribute(NamedTuple):
    """An attribute as written in its start tag."""

    name: str
    start: int
    """The start of the blanks before it."""
    name_start: int
    value_start: int
    """Between its quotation marks."""
    value_end: int
    quote: str

    @property
    def end(self) -> int:
        """After its closing quotation mark."""
        return self.value_end + 1


class XmlPiece(NamedTuple):
    """A piece of a text that is not an element."""

    kind: PieceKind
    start: int
    end: int


def pieces(text: str, start: int, end: int) -> Iterator[XmlPiece]:
    """The texts, comments, instructions and CDATA sections of a range without tags."""
    while start < end and (found := _PIECE.match(text, start, end)) is not None:
        kind: PieceKind = found.lastgroup  # type: ignore[assignment]  # the names of its groups
        yield XmlPiece(kind, start, found.end())
        start = found.end()


def comments_of(text: str) -> Iterator[str]:
    """The comments of a well-formed text in order, with single blanks."""
    for found in _PIECE.finditer(text):
        if found.lastgroup == "comment":
            yield " ".join(found.group().split())


def without_blanks(text: str, start: int, end: int) -> tuple[int, int]:
    """A range without the blanks at its ends."""
    inner = text[start:end]
    end = start + len(inner.rstrip(BLANKS))
    return min(start + len(inner) - len(inner.lstrip(BLANKS)), end), end


def read_entity(written: str) -> str:
    """The character of an entity; any other text unchanged."""
    found = ENTITY.fullmatch(written)
    if found is None:
        return written
    code, number, name = found.groups()
    return _NAMED.get(name, written) if name else chr(int(code, 16) if code else int(number))


def is_element_name(name: str) -> bool:
    """Whether an element can have this name."""
    try:
        return XmlTree(f"<{name}/>").root.tag == name
    except (XmlSyntaxError, UnicodeEncodeError):
        return False


# --- reading --------------------------------------------------------------------------------------------------------


def _check_prolog(text: str) -> None:
    if (doctype := _DOCTYPE.match(text)) is not None:
        message = "a DOCTYPE is not allowed in scenario files; delete it"
        raise XmlSyntaxError("doctype", doctype.end() - 9, message, is_final=True)
    declared = _DECLARED.match(text)
    if declared is not None and declared.group(1).lower() not in ("utf-8", "utf8", "us-ascii"):
        message = f'this file declares the encoding {declared.group(1)}; save it as UTF-8 and declare encoding="UTF-8"'
        raise XmlSyntaxError("encoding", declared.start(1), message, is_final=True)


def _read(tree: XmlTree) -> Element:
    text, data = tree.text, tree.text.encode()
    parser = expat.ParserCreate("utf-8")
    outside = Element("", {}, 0, tree, None)
    open_elements = [outside]
    strings: list[str] = []
    ascii_only = len(data) == len(text)
    done = offset = deepest = 0

    def current_offset() -> int:
        """The offset in `text` of the current event."""
        nonlocal done, offset
        at = parser.CurrentByteIndex
        if ascii_only:
            return at
        offset += len(data[done:at].decode())
        done = at
        return offset

    def flush_text() -> None:
        if strings:
            inside = open_elements[-1]
            if inside:
                inside[-1].tail = "".join(strings)
            else:
                inside.text = "".join(strings)
            strings.clear()

    def on_start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal deepest
        flush_text()
        parent = open_elements[-1]
        element = Element(tag, attributes, current_offset(), tree, parent)
        parent.append(element)
        open_elements.append(element)
        if len(open_elements) > deepest:
            deepest = len(open_elements)

    def on_end(tag: str) -> None:
        flush_text()
        open_elements.pop().close = current_offset()

    parser.StartElementHandler = on_start
    parser.EndElementHandler = on_end
    if tree.has_text:
        parser.buffer_text = True
        parser.CharacterDataHandler = strings.append
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        found = _ask_lxml(text) or _invalid_name_error(text, data[: max(parser.ErrorByteIndex, 0)], error)
        raise found from None
    is_doubtful = deepest > _CHECKED_DEPTH or _PREFIX.search(text) is not None
    is_doubtful |= text.lstrip().startswith("<?xml") and _USUAL_DECLARATION.match(text) is None
    is_doubtful |= len(text) > _LONG and any(
        len(name) > _LONG for each in outside[0].walk() for name in (each.tag, *each.attributes)
    )
    if is_doubtful and (problem := _ask_lxml(text)) is not None:
        raise problem
    outside[0].parent = None
    return outside[0]


def _ask_lxml(text: str) -> XmlSyntaxError | None:
    from rise_engine.syntax.xml_errors import find_syntax_error  # lxml is slow to import and rarely needed

    found = find_syntax_error(text)
    return None if found is None else XmlSyntaxError(*found)


def _invalid_name_error(text: str, before: bytes, error: expat.ExpatError) -> XmlSyntaxError:
    """The error for a character that no name can contain, which lxml accepts and expat does not."""
    at = len(before.decode(errors="ignore"))
    character = text[at : at + 1]
    if character.isascii():  # no known text leads here
        message = f"this is not well-formed XML: {expat.ErrorString(error.code)}"
    else:
        shown = f"`{character}`, {character_name(character)}," if character.isprintable() else character_name(character)
        message = f"the character {shown} is not allowed in a name; take it out, or write another letter"
    return XmlSyntaxError("not-well-formed", at, message, is_final=True)


# --- places ---------------------------------------------------------------------------------------------------------


class _OffsetMap:
    """Maps each character of a value to its offset in the text, in runs of consecutive characters."""

    def __init__(self) -> None:
        self.length = 0
        """The length of the value."""
        self.starts: list[int] = []
        self.offsets: list[int] = []
        self.end = 0

    def add(self, text: str, start: int, end: int, units: re.Pattern[str]) -> None:
        """Append the characters from `start` to `end` of the text to the value."""
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


# Several places of one element may be needed in a row: each function caches its last result.


@lru_cache(maxsize=1)
def _attributes_at(text: str, start: int) -> dict[str, WrittenAttribute]:
    """The attributes of the start tag that begins at `start`, by name."""
    found = {}
    for each in _ATTRIBUTE.finditer(text, start, match_end(_TAG, text, start)):
        which = 2 if each.group(2) is not None else 3
        before = each.start()
        while text[before - 1] in BLANKS:
            before -= 1
        found[each.group(1)] = WrittenAttribute(
            each.group(1), before, each.start(), *each.span(which), '"' if which == 2 else "'"
        )
    return found


@lru_cache(maxsize=1)
def _value_offset_map(text: str, start: int, end: int) -> _OffsetMap:
    """The offsets of an attribute's value."""
    stretches = _OffsetMap()
    stretches.add(text, start, end, _CHARACTER)
    return stretches


@lru_cache(maxsize=1)
def _text_offset_map(text: str, tag: int) -> _OffsetMap:
    """The offsets of the text after the tag that begins at `tag`, up to the next tag, without comments."""
    stretches = _OffsetMap()
    at = match_end(_TAG, text, tag)
    while True:
        end = text.find("<", at)
        end = end if end >= 0 else len(text)
        stretches.add(text, at, end, _CHARACTER)
        inner = _TAG.match(text, end)
        if inner is None or not inner.group().startswith(("<!", "<?")):
            return stretches
        if inner.group().startswith(CDATA):
            stretches.add(text, inner.start() + len(CDATA), inner.end() - 3, _CRLF)
        at = inner.end()
