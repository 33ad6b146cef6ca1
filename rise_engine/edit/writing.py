"""New pieces of XML: elements, values and texts, and the smallest splice that makes one text another."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from msgspec import Struct

from rise_engine.edit.documents import CDATA, Node
from rise_engine.edit.layout import WritingGap
from rise_engine.edit.plan import EditRefused, Splice
from rise_engine.text import character_name

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TEXT_UNIT = re.compile(r"&(?:#x[0-9A-Fa-f]+|#[0-9]+|[A-Za-z]+);|\s+|.", re.DOTALL)
_VALUE_UNIT = re.compile(r"&(?:#x[0-9A-Fa-f]+|#[0-9]+|[A-Za-z]+);|\r\n|.", re.DOTALL)
_ENTITY = re.compile(r"&(?:#x([0-9A-Fa-f]+)|#([0-9]+)|([A-Za-z]+));")
_NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}


class NewElement(Struct, frozen=True):
    """An element that is to be written."""

    tag: str
    attributes: Mapping[str, str] = {}
    text: str | None = None
    children: tuple[NewElement, ...] = ()
    markup: bool = False
    """Whether the text is XML and is written as it is."""


def check_characters(text: str) -> None:
    """:raises EditRefused: a character that no XML file can hold."""
    if (found := _NO_XML.search(text)) is not None:
        raise EditRefused(f"the character {character_name(found.group())} cannot stand in a file; leave it out")


def escape_text(text: str) -> str:
    """A text between tags."""
    check_characters(text)
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("]]>", "]]&gt;").replace("\r", "&#13;")


def escape_value(text: str, quote: str) -> str:
    """A value between quotation marks of this kind."""
    check_characters(text)
    text = text.replace("&", "&amp;").replace("<", "&lt;")
    text = text.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")
    return text.replace(quote, "&quot;" if quote == '"' else "&apos;")


def quoted(value: str) -> str:
    """A value with quotation marks: double ones, but around a text in which only such stand."""
    quote = "'" if '"' in value and "'" not in value else '"'
    return f"{quote}{escape_value(value, quote)}{quote}"


def one_line(text: str) -> str:
    """A text as it is read: without blanks around it, and a line break is a blank."""
    text = text.strip()
    return " ".join(text.split()) if "\n" in text or "\r" in text else text


# --- elements -----------------------------------------------------------------------------------------------------


def start_tag(element: NewElement) -> str:
    """Without its end: `<State id="A"`."""
    return f"<{element.tag}" + "".join(f" {name}={quoted(value)}" for name, value in element.attributes.items())


def render(element: NewElement, gap: WritingGap, *, flat: bool = False) -> bytes:
    """An element as it stands in a gap: what it holds in lines of its own, unless it is `flat`, or the gap is none."""
    line_end, unit = gap.line_end.decode(), gap.unit.decode()
    return _render(element, gap.indent.decode(), unit, line_end, flat or not gap.own_line).encode()


def _render(element: NewElement, indent: str, unit: str, line_end: str, flat: bool) -> str:
    opening = start_tag(element)
    if element.children:
        inside = "" if flat else line_end + indent + unit
        outside = "" if flat else line_end + indent
        inner = "".join(inside + _render(each, indent + unit, unit, line_end, flat) for each in element.children)
        return f"{opening}>{inner}{outside}</{element.tag}>"
    if element.text is None:
        return f"{opening}/>"
    return f"{opening}>{element.text if element.markup else escape_text(element.text)}</{element.tag}>"


def insert(file: str, gap: WritingGap, elements: Iterable[NewElement], *, flat: bool = False) -> Splice:
    """The splice that puts new elements into a gap, in lines of their own where it has them."""
    between = gap.line_end + gap.indent if gap.own_line else b""
    return gap.splice(file, between.join(render(element, gap, flat=flat) for element in elements))


# --- texts and values ---------------------------------------------------------------------------------------------


def text_splice(file: str, node: Node, text: str) -> Splice:
    """The splice that makes a text the text of an element, which holds nothing else (`Node.text_obstacle`)."""
    text = one_line(text)
    check_characters(text)
    data = node.document.data
    if node.is_closed:
        start = len(data[: node.end - 2].rstrip())
        return Splice(file, start, node.end, f">{escape_text(text)}</{node.tag}>".encode())
    start, end = node.text_span()
    if node.is_cdata:
        opening = data.rfind(CDATA, 0, start + 1)
        if not text or "]]>" in text:
            return Splice(file, opening, data.index(b"]]>", end) + 3, escape_text(text).encode())
        return _smallest(file, start, data[start:end].decode(), text, _CDATA)
    return _smallest(file, start, data[start:end].decode(), text, _TEXT)


def value_splice(file: str, node: Node, name: str, value: str) -> Splice:
    """The splice that gives an attribute that is there another value. Its quotation marks stay where they can."""
    check_characters(value)
    written = node.written_attributes()[name]
    quote, other = written.quote, "'" if written.quote == '"' else '"'
    if quote in value and other not in value:
        data = f"{other}{escape_value(value, other)}{other}".encode()
        return Splice(file, written.value_start - 1, written.value_end + 1, data)
    raw = node.document.data[written.value_start : written.value_end].decode()
    notation = _Notation(_VALUE_UNIT, lambda piece: escape_value(piece, quote), _read_value)
    return _smallest(file, written.value_start, raw, value, notation)


class _Notation(Struct, frozen=True):
    """How a kind of text is written."""

    unit: re.Pattern[str]
    """What stands for one stretch of the text that is read."""
    escape: Callable[[str], str]
    read: Callable[[str, bool], str]
    """A unit as it is read; the second says whether the text goes over several lines."""


def _read_entity(unit: str) -> str:
    found = _ENTITY.fullmatch(unit)
    if found is None:
        return unit
    if found.group(1):
        return chr(int(found.group(1), 16))
    return chr(int(found.group(2))) if found.group(2) else _NAMED.get(found.group(3), unit)


def _read_text(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else _read_entity(unit)


def _read_cdata(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else unit


def _read_value(unit: str, _broken: bool) -> str:
    return " " if unit in ("\t", "\n", "\r", "\r\n") else _read_entity(unit)


_TEXT = _Notation(_TEXT_UNIT, escape_text, _read_text)
_CDATA = _Notation(_TEXT_UNIT, lambda piece: piece, _read_cdata)


def _smallest(file: str, start: int, raw: str, new: str, notation: _Notation) -> Splice:
    """What differs between a written text and a new one, and nothing before and after it."""
    units = notation.unit.findall(raw)
    broken = "\n" in raw or "\r" in raw
    read = [notation.read(unit, broken) for unit in units]
    head = at = 0
    while head < len(read) and new.startswith(read[head], at):
        at += len(read[head])
        head += 1
    tail, end = len(read), len(new)
    while tail > head and end - len(read[tail - 1]) >= at and new.endswith(read[tail - 1], at, end):
        tail -= 1
        end -= len(read[tail])
    before, changed, after = ("".join(part) for part in (units[:head], units[head:tail], units[tail:]))
    piece = notation.escape(new[at:end])
    whole = before + piece + after
    broken = "\n" in whole or "\r" in whole
    if "".join(notation.read(unit, broken) for unit in notation.unit.findall(whole)) != new or "]]>" in new:
        return Splice(file, start, start + len(raw.encode()), notation.escape(new).encode())
    begin = start + len(before.encode())
    return Splice(file, begin, begin + len(changed.encode()), piece.encode())
