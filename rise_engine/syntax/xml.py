"""XML as a tree that knows where everything stands in its text, so that what nobody changes keeps its characters.

expat makes the tree: it tells the offset of every element. lxml is asked about what expat cannot read, for the words in
which the mistake is told, and about what the two do not agree on: prefixes of names, and elements very deep.

Whatever a text holds, reading it takes time in proportion to its length: no pattern here goes back over what it has
passed, and what is asked often of one element is worked out once.
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
"""What is one character of a value and several of the file."""
_LINE_END = re.compile(r"\r\n?|\n")
_CRLF = re.compile(r"\r\n")
_DOCTYPE = re.compile(r"(?:\s++|<\?(?>.*?\?>)|<!--(?>.*?-->))*+<!DOCTYPE", re.DOTALL)
_DECLARED = re.compile(r"""\s*+<\?xml[^>]*?\sencoding\s*=\s*["']([^"']*)["']""")
_USUAL_DECLARATION = re.compile(r"""<\?xml version=["']1\.0["'](?: encoding=["'][Uu][Tt][Ff]-?8["'])? ?\?>""")
_PREFIX = re.compile(r"<[^\s<>/!?]*:|(?<=\s)[^\s=/<>\"']*:[^\s=/<>\"']*+\s*+=\s*+[\"']|(?<=\s)xmlns\b")
_DEEP = 200
"""Elements in each other. libxml2 takes 256."""
_LONG = 40_000
"""Characters of a name. libxml2 takes 50,000."""


class XmlSyntaxError(RiseError, ValueError):
    """A text that is no XML, or none that is read here: what is wrong with it first, as a sentence, and where."""

    def __init__(self, code: str, offset: int, message: str, *, is_final: bool = False) -> None:
        super().__init__(message)
        self.code = code
        """Of a finding."""
        self.offset = offset
        self.is_final = is_final
        """Whether nothing can be repaired."""


class Element(list["Element"]):
    """An element: a list of its children."""

    __slots__ = ("attributes", "close", "parent", "start", "tag", "tail", "text", "tree")

    def __init__(self, tag: str, attributes: dict[str, str], start: int, tree: XmlTree, parent: Element | None) -> None:
        self.tag = tag
        self.attributes = attributes
        """In file order, as XML reads them."""
        self.start = start
        """Where its start tag begins in the text of its tree."""
        self.close = start
        """Where its end tag begins; of `<empty/>`, where it begins or ends itself."""
        self.text = ""
        """What stands before its first child. Comments leave no trace."""
        self.tail = ""
        """What stands behind it, before the next element."""
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
        """Behind its start tag."""
        return match_end(_TAG, self.tree.text, self.start)

    @property
    def inner_end(self) -> int:
        """Where its end tag begins; of `<empty/>`, behind it."""
        return self.inner_start if self.is_closed else self.close

    @property
    def end(self) -> int:
        """Behind it."""
        return self.inner_start if self.is_closed else self.tree.text.index(">", self.close) + 1

    @property
    def line(self) -> int:
        """The number of the line in which it begins, from 1."""
        return self.tree.line(self.start)

    @property
    def written(self) -> str:
        """As it is written, with its tags."""
        return self.tree.text[self.start : self.end]

    def walk(self) -> Iterator[Element]:
        """It and all that it holds, in file order."""
        rest = [self]
        while rest:
            element = rest.pop()
            yield element
            rest += element[::-1]

    # --- what is written in it ----------------------------------------------------------------------------------------

    def written_attributes(self) -> dict[str, WrittenAttribute]:
        """Where its attributes stand, by name, in file order."""
        return _attributes_at(self.tree.text, self.start)

    def gaps(self) -> list[tuple[int, int]]:
        """The stretches between its tags and those of its children."""
        starts = [self.inner_start, *(child.end for child in self)]
        return list(zip(starts, [*(child.start for child in self), self.inner_end], strict=True))

    def marks(self) -> set[PieceKind]:
        """What stands in it besides text and elements."""
        found = {piece.kind for gap in self.gaps() for piece in pieces(self.tree.text, *gap)}
        return found - {"text"}

    def text_span(self) -> tuple[int, int]:
        """Where its text stands, without the blanks around it; inside the marks of a CDATA section that is all."""
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
        """Why its text cannot be replaced without losing something; empty: it can."""
        if self:
            return f"`<{self[0].tag}>` is in it"
        marks = self.marks()
        if "comment" in marks:
            return "a comment is in it"
        if "instruction" in marks:
            return "an XML instruction is in it"
        return "text and CDATA are side by side in it" if "CDATA" in marks and not self.is_cdata else ""

    # --- where the characters of what is read stand -------------------------------------------------------------------

    def attribute_at(self, offset: int) -> WrittenAttribute | None:
        """The attribute in whose value, or at whose end, a character stands."""
        attributes = self.written_attributes().values()
        return next((each for each in attributes if each.value_start <= offset <= each.value_end), None)

    def attribute_offset(self, name: str) -> int:
        """Where an attribute's name stands; without it, where the element begins."""
        found = self.written_attributes().get(name)
        return found.name_start if found else self.start

    def value_offset(self, name: str, index: int = 0) -> int:
        """Where the character number `index` (from 0) of an attribute's value stands."""
        found = self.written_attributes().get(name)
        if found is None:
            return self.start
        return _value_offset_map(self.tree.text, found.value_start, found.value_end).offset(index)

    def text_offset(self, index: int = 0) -> int:
        """Where the character number `index` of its text (up to its first child) stands."""
        return _text_offset_map(self.tree.text, self.start).offset(index)

    def tail_offset(self, index: int) -> int:
        """Where the character number `index` of what stands behind it stands."""
        return _text_offset_map(self.tree.text, self.close).offset(index)


class XmlTree:
    """A text that is well-formed, and its elements."""

    def __init__(self, text: str, name: str = "") -> None:
        """
        :param text: without byte order mark.
        :param name: of the file that it stands in.
        :raises XmlSyntaxError: it is not well-formed, has a DOCTYPE, or is in another encoding by its own account.
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
        """The number of the line, from 1, in which a character stands. Lines end with LF, CRLF or CR."""
        return bisect_right(self._line_starts, offset)

    def element_at(self, offset: int) -> Element:
        """The innermost element that a character stands in; beside all of them, the outermost one."""
        found = self.root
        while (index := bisect_right(found, offset, key=lambda child: child.start)) and offset < found[index - 1].end:
            found = found[index - 1]
        return found


class WrittenAttribute(NamedTuple):
    """An attribute as it stands in its start tag."""

    name: str
    start: int
    """Where the blanks before it begin."""
    name_start: int
    value_start: int
    """Between its quotation marks."""
    value_end: int
    quote: str

    @property
    def end(self) -> int:
        """Behind its closing quotation mark."""
        return self.value_end + 1


class XmlPiece(NamedTuple):
    """What stands beside elements."""

    kind: PieceKind
    start: int
    end: int


def pieces(text: str, start: int, end: int) -> Iterator[XmlPiece]:
    """The texts, comments, instructions and CDATA sections of a stretch without tags."""
    while start < end and (found := _PIECE.match(text, start, end)) is not None:
        kind: PieceKind = found.lastgroup  # type: ignore[assignment]  # the names of its groups
        yield XmlPiece(kind, start, found.end())
        start = found.end()


def comments_of(text: str) -> Iterator[str]:
    """The comments of a well-formed text in their order, with single blanks."""
    for found in _PIECE.finditer(text):
        if found.lastgroup == "comment":
            yield " ".join(found.group().split())


def without_blanks(text: str, start: int, end: int) -> tuple[int, int]:
    """A stretch without the blanks at its ends."""
    inner = text[start:end]
    end = start + len(inner.rstrip(BLANKS))
    return min(start + len(inner) - len(inner.lstrip(BLANKS)), end), end


def read_entity(written: str) -> str:
    """The character that an entity stands for; anything else as it is."""
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
        """The offset in `text` of what is being read."""
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
        found = _ask_lxml(text) or _odd_name(text, data[: max(parser.ErrorByteIndex, 0)], error)
        raise found from None
    is_doubtful = deepest > _DEEP or _PREFIX.search(text) is not None
    is_doubtful |= text.lstrip().startswith("<?xml") and _USUAL_DECLARATION.match(text) is None
    is_doubtful |= len(text) > _LONG and any(
        len(name) > _LONG for each in outside[0].walk() for name in (each.tag, *each.attributes)
    )
    if is_doubtful and (problem := _ask_lxml(text)) is not None:
        raise problem
    outside[0].parent = None
    return outside[0]


def _ask_lxml(text: str) -> XmlSyntaxError | None:
    from rise_engine.syntax.xml_errors import find_syntax_error  # lxml takes long to import, and is rarely asked

    found = find_syntax_error(text)
    return None if found is None else XmlSyntaxError(*found)


def _odd_name(text: str, before: bytes, error: expat.ExpatError) -> XmlSyntaxError:
    """What lxml accepts and expat does not: a character that no name can have."""
    at = len(before.decode(errors="ignore"))
    character = text[at : at + 1]
    if character.isascii():  # nothing is known that leads here
        message = f"this is not well-formed XML: {expat.ErrorString(error.code)}"
    else:
        shown = f"`{character}`, {character_name(character)}," if character.isprintable() else character_name(character)
        message = f"the character {shown} is not allowed in a name; take it out, or write another letter"
    return XmlSyntaxError("not-well-formed", at, message, is_final=True)


# --- places ---------------------------------------------------------------------------------------------------------


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


# Of one element many places may be asked for in a row: each of these remembers what it worked out last.


@lru_cache(maxsize=1)
def _attributes_at(text: str, start: int) -> dict[str, WrittenAttribute]:
    """The attributes of the start tag that begins there, by name."""
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
        if inner.group().startswith(CDATA):
            stretches.add(text, inner.start() + len(CDATA), inner.end() - 3, _CRLF)
        at = inner.end()
