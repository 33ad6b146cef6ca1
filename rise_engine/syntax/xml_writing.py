"""New XML: elements, values and texts, and the smallest change that turns one text into another."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence, Set

from msgspec import Struct

from rise_engine.base.text import character_name
from rise_engine.syntax.changes import EditRefused, Splice
from rise_engine.syntax.xml import CDATA, ENTITY, Element, WrittenAttribute, read_entity

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TEXT_UNIT = re.compile(rf"{ENTITY.pattern}|\s+|.", re.DOTALL)
_VALUE_UNIT = re.compile(rf"{ENTITY.pattern}|\r\n|.", re.DOTALL)


class NewElement(Struct, frozen=True):
    """A new element, to be written."""

    tag: str
    attributes: Mapping[str, str] = {}
    text: str | None = None
    children: tuple[NewElement, ...] = ()

    def write(self, indent: str, unit: str, line_end: str, *, flat: bool) -> str:
        """Write it. Its children get their own lines, indented by `unit`, unless it is `flat`."""
        opening = f"<{self.tag}" + "".join(f" {name}={quoted(value)}" for name, value in self.attributes.items())
        if self.children:
            inside, outside = ("", "") if flat else (line_end + indent + unit, line_end + indent)
            inner = "".join(inside + each.write(indent + unit, unit, line_end, flat=flat) for each in self.children)
            return f"{opening}>{inner}{outside}</{self.tag}>"
        return f"{opening}/>" if self.text is None else f"{opening}>{escape_text(self.text)}</{self.tag}>"


def check_characters(text: str) -> None:
    """:raises EditRefused: a character that no XML file can hold."""
    if (found := _NO_XML.search(text)) is not None:
        raise EditRefused(f"the character {character_name(found.group())} is not allowed in a file; leave it out")


def escape_text(text: str) -> str:
    """Escape a text between tags."""
    check_characters(text)
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("]]>", "]]&gt;").replace("\r", "&#13;")


def escape_value(text: str, quote: str) -> str:
    """Escape a value between quotation marks of this kind."""
    check_characters(text)
    text = text.replace("&", "&amp;").replace("<", "&lt;")
    text = text.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")
    return text.replace(quote, "&quot;" if quote == '"' else "&apos;")


def quoted(value: str) -> str:
    """A value with quotation marks: double ones, unless only double ones occur in it."""
    quote = "'" if '"' in value and "'" not in value else '"'
    return f"{quote}{escape_value(value, quote)}{quote}"


def one_line(text: str) -> str:
    """A text as it is read: without blanks around it, and with line breaks as blanks."""
    text = text.strip()
    return " ".join(text.split()) if "\n" in text or "\r" in text else text


# --- texts and values ---------------------------------------------------------------------------------------------


def set_text(element: Element, text: str) -> Splice:
    """Set the text of an element that contains nothing else (`Element.text_obstacle`)."""
    text = one_line(text)
    check_characters(text)
    file, written = element.tree.name, element.tree.text
    if element.is_closed:
        start = len(written[: element.end - 2].rstrip())
        return Splice(file, start, element.end, f">{escape_text(text)}</{element.tag}>")
    start, end = element.text_span()
    if element.is_cdata:
        opening = written.rfind(CDATA, 0, start + 1)
        if not text or "]]>" in text:
            return Splice(file, opening, written.index("]]>", end) + 3, escape_text(text))
        return _smallest(file, start, written[start:end], text, _CDATA)
    return _smallest(file, start, written[start:end], text, _TEXT)


def set_value(element: Element, name: str, value: str) -> Splice:
    """Set an existing attribute. Its quotation marks stay if possible."""
    check_characters(value)
    written, file = element.written_attributes()[name], element.tree.name
    quote, other = written.quote, "'" if written.quote == '"' else '"'
    if quote in value and other not in value:
        new = f"{other}{escape_value(value, other)}{other}"
        return Splice(file, written.value_start - 1, written.value_end + 1, new)
    raw = element.tree.text[written.value_start : written.value_end]
    notation = _Notation(_VALUE_UNIT, lambda piece: escape_value(piece, quote), _read_value)
    return _smallest(file, written.value_start, raw, value, notation)


class _Notation(Struct, frozen=True):
    """How one kind of text is written."""

    unit: re.Pattern[str]
    """Matches the written form of one unit of the text."""
    escape: Callable[[str], str]
    read: Callable[[str, bool], str]
    """Returns the value of a unit. The second argument says whether the text has several lines."""


def _read_text(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else read_entity(unit)


def _read_cdata(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else unit


def _read_value(unit: str, _broken: bool) -> str:
    return " " if unit in ("\t", "\n", "\r", "\r\n") else read_entity(unit)


_TEXT = _Notation(_TEXT_UNIT, escape_text, _read_text)
_CDATA = _Notation(_TEXT_UNIT, lambda piece: piece, _read_cdata)


def _smallest(file: str, start: int, raw: str, new: str, notation: _Notation) -> Splice:
    """Replace only the part that differs between a written text and a new one."""
    units = [found.group() for found in notation.unit.finditer(raw)]
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
    if "".join(notation.read(found.group(), broken) for found in notation.unit.finditer(whole)) != new or "]]>" in new:
        return Splice(file, start, start + len(raw), notation.escape(new))
    return Splice(file, start + len(before), start + len(before) + len(changed), piece)


# --- attributes ---------------------------------------------------------------------------------------------------


def set_attributes(element: Element, values: Mapping[str, str | None], order: Sequence[str]) -> list[Splice]:
    """Set attributes of an element; those that are not named stay unchanged.

    :param values: None removes the attribute. An attribute that has the value already is not changed.
    :param order: all possible attributes: a new one goes after the last one that precedes it here.
    """
    written, file = element.written_attributes(), element.tree.name
    gone = {name for name, value in values.items() if value is None and name in written}
    new = {name: str(values[name]) for name in order if values.get(name) is not None and name not in written}
    splices = [
        set_value(element, name, value)
        for name, value in values.items()
        if value is not None and name in written and element.attributes[name] != value
    ]
    replaced: dict[str, str] = {}
    kept = [order.index(each) for each in written if each in order and each not in gone]
    for name in list(new):  # an attribute that replaces another takes its place
        if (old := _place_of_gone(name, gone - replaced.keys(), kept, order)) is not None:
            replaced[old] = f"{name}={quoted(new.pop(name))}"
    for name in sorted(gone, key=list(written).index):
        place, instead = written[name], replaced.get(name)
        start = place.start if instead is None else place.name_start
        splices.append(Splice(file, start, place.end, instead or ""))
    at_places: dict[int, str] = {}
    for name, value in new.items():
        before = [each for each in written if each in order and order.index(each) < order.index(name)]
        at = max((written[each].end for each in before), default=element.start + 1 + len(element.tag))
        blanks = _blanks(element, written[before[-1]]) if before else " "
        at_places[at] = f"{at_places.get(at, '')}{blanks}{name}={quoted(value)}"
    return splices + [Splice(file, at, at, piece) for at, piece in at_places.items()]


def _place_of_gone(name: str, gone: Set[str], kept: list[int], order: Sequence[str]) -> str | None:
    """The removed attribute whose place a new one takes: the first, if none that stays belongs between them."""
    rank = order.index(name)
    for each in sorted(gone, key=order.index):
        between = range(*sorted((rank, order.index(each))))
        if not any(other in between for other in kept):
            return each
    return None


def _blanks(element: Element, attribute: WrittenAttribute) -> str:
    """The blanks before an attribute: one blank, or a line end with indentation."""
    return element.tree.text[attribute.start : attribute.name_start]
