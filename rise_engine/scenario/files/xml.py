"""XML files of a scenario: their elements, including those from templates, and their places for diagnostics.

An element from a template knows its template and its `<use>`. So a diagnostic about it points to the `<use>`, if
possible to the wrong value there, and also gives the line of the template.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import accumulate
from typing import NamedTuple

from msgspec.structs import replace

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader, SourceFile
from rise_engine.scenario.model import SourceLocation, TemplateLocation
from rise_engine.syntax.xml import Element, XmlSyntaxError, XmlTree
from rise_engine.syntax.xml_repair import RepairedText

_MARK = re.compile(r"\$\$\{|\$\{([^{}$]*)(\}?)")


class XmlFile:
    """A file that is well-formed, perhaps after a repair, with or without its templates expanded."""

    def __init__(
        self, source: SourceFile, tree: XmlTree, repaired: RepairedText | None = None, root: Element | None = None
    ) -> None:
        """`root`: the outermost element after expansion."""
        self.source = source
        self.tree = tree
        self.repaired = repaired
        """The repair that converted the file's text to the tree's text; None: they are equal."""
        self.root = tree.root if root is None else root
        self.has_text = tree.has_text
        """Whether there may be visible text between tags."""
        self.may_define_templates = "<Template" in tree.text
        self.may_have_templates = self.may_define_templates or "<use" in tree.text
        """Whether it may contain a `<Template>` or a `<use>`."""
        self.brought: dict[Element, list[Element]] = {}
        """The elements that replaced each `<use>` of the file."""
        self.incomplete: set[Element] = set()
        """Elements that lack content, because a `<use>` in them could not be expanded."""

    @property
    def is_expanded(self) -> bool:
        """Whether its templates have been expanded."""
        return self.root is not self.tree.root

    def is_complete(self, element: Element) -> bool:
        """Whether an element has all its content."""
        return element not in self.incomplete

    def element_location(self, element: Element) -> SourceLocation:
        """The place of an element's start tag."""
        return self._place(element, lambda origin: origin.start)

    def attribute_location(self, element: Element, name: str) -> SourceLocation:
        """The place of an attribute's name."""
        return self._place(element, lambda origin: origin.attribute_offset(name))

    def value_location(self, element: Element, name: str, index: int = 0) -> SourceLocation:
        """The place of the character number `index` (from 0) of an attribute's value."""
        written = origin_of(element).attributes.get(name, "")
        return self._place_in(element, written, index, lambda origin, at: origin.value_offset(name, at))

    def text_location(self, element: Element, index: int = 0) -> SourceLocation:
        """The place of the character number `index` of an element's text (up to its first child)."""
        return self._place_in(element, origin_of(element).text, index, Element.text_offset)

    def tail_location(self, element: Element, index: int) -> SourceLocation:
        """The place of the character number `index` of an element's tail."""
        return self._place_in(element, origin_of(element).tail, index, Element.tail_offset)

    def written_location(self, element: Element, index: int) -> SourceLocation:
        """The place of the character number `index` of an element as written."""
        return self._place_in(element, origin_of(element).written, index, lambda origin, at: origin.start + at)

    def written(self, element: Element) -> str:
        """An element as written, with its tags and with the values of a `<use>`."""
        call = call_of(element)
        return element.written if call is None else call.fill(element.written)

    def _location(self, offset: int) -> SourceLocation:
        return self.source.location(offset if self.repaired is None else self.repaired.original_offset(offset))

    def _place(self, element: Element, offset: Callable[[Element], int]) -> SourceLocation:
        call = call_of(element)
        if call is None:
            return self._location(offset(element))
        inner = call.file._location(offset(origin_of(element)))
        return call.name_template(self.element_location(call.use), inner)

    def _place_in(
        self, element: Element, written: str, index: int, offset: Callable[[Element, int], int]
    ) -> SourceLocation:
        """The place of a character of a filled text: in the value of the `<use>` if it comes from there."""
        call, origin = call_of(element), origin_of(element)
        if call is None:
            return self._location(offset(origin, index))
        pieces, starts = _pieces_in(written, call)
        which = max(bisect_right(starts, index) - 1, 0)
        parameter = pieces[which].parameter if pieces else None
        if parameter is None:
            at = pieces[which].start + index - starts[which] if pieces else index
            return self._place(element, lambda origin: offset(origin, at))
        inner = call.file._location(offset(origin, pieces[which].start))
        outer = self.element_location(call.use)
        if parameter in call.use.attributes:
            outer = self.value_location(call.use, parameter, index - starts[which])
        return call.name_template(outer, inner)


# --- elements of templates ------------------------------------------------------------------------------------------


class TextPiece(NamedTuple):
    """A part of an attribute or text in a template."""

    start: int
    """Its offset in the written text."""
    text: str
    parameter: str | None = None
    """The parameter `${...}` whose value replaces it."""


@lru_cache(maxsize=1_000)
def text_pieces(written: str) -> tuple[TextPiece, ...]:
    """The literal parts of a text and the parameters between them; `$${` is a literal `${`."""
    return tuple(_read_pieces(written))


def _read_pieces(written: str) -> Iterator[TextPiece]:
    at = 0
    for mark in _MARK.finditer(written):
        if mark.start() > at:
            yield TextPiece(at, written[at : mark.start()])
        if mark.group().startswith("$$"):
            yield TextPiece(mark.start(), "${")
        else:
            yield TextPiece(mark.start(), mark.group(), mark.group(1).strip())
        at = mark.end()
    if at < len(written):
        yield TextPiece(at, written[at:])


class TemplateCall:
    """One use of a template."""

    def __init__(self, name: str, file: XmlFile, defaults: Mapping[str, str | None], use: Element) -> None:
        self.name = name
        """The name of the template."""
        self.file = file
        """The file of the template."""
        self.defaults = defaults
        """The defaults of the template's parameters; None: the parameter is required."""
        self.use = use
        """The `<use>`, which may come from a template itself."""

    def piece_text(self, piece: TextPiece) -> str:
        """The text of a piece. An unknown parameter stays as written, because it is reported elsewhere."""
        if piece.parameter is None or piece.parameter not in self.defaults:
            return piece.text
        given = self.use.get(piece.parameter)
        return given if given is not None else self.defaults[piece.parameter] or ""

    def fill(self, written: str) -> str:
        """Fill a text of the template with the values of the `<use>`."""
        return written if "${" not in written else "".join(map(self.piece_text, text_pieces(written)))

    def name_template(self, outer: SourceLocation, inner: SourceLocation) -> SourceLocation:
        """A place in the `<use>`, with the place in the template."""
        return replace(outer, template=TemplateLocation(self.name, inner.file, inner.line, inner.column))


class ExpandedElement(Element):
    """An element from a template, or one that contains an expanded one."""

    __slots__ = ("call", "origin")

    def __init__(self, origin: Element, call: TemplateCall | None) -> None:
        """`call`: None for an element that is written in the file."""
        attributes, text, tail = origin.attributes, origin.text, origin.tail
        if call is not None:
            attributes = {name: call.fill(value) for name, value in attributes.items()}
            text, tail = call.fill(text), call.fill(tail)
        super().__init__(origin.tag, attributes, origin.start, origin.tree, origin.parent)
        self.close, self.text, self.tail = origin.close, text, tail
        self.origin = origin
        self.call = call


def call_of(element: Element) -> TemplateCall | None:
    """The use of an element's template; None: it is written in its file."""
    return element.call if isinstance(element, ExpandedElement) else None


def origin_of(element: Element) -> Element:
    """An element as written, in its file or in a template."""
    return element.origin if isinstance(element, ExpandedElement) else element


def written_here(element: Element) -> Element:
    """The element in the file: this element, or the `<use>` that it comes from."""
    while (call := call_of(element)) is not None:
        element = call.use
    return origin_of(element)


def parameters_in(element: Element, written: str) -> Iterator[str]:
    """Yield the parameters of the file's `<use>` that occur in a text of an element, once per occurrence."""
    call = call_of(element)
    for piece in text_pieces(written) if call is not None else ():
        name = piece.parameter
        if call is None or name is None or name not in call.defaults:
            continue
        if call_of(call.use) is None:
            yield name
        else:
            yield from parameters_in(call.use, origin_of(call.use).attributes.get(name, ""))


def count_places(brought: Iterable[Element], parameter: str) -> int:
    """Count the occurrences of a parameter in the elements that replaced a `<use>`."""
    return sum(
        name == parameter
        for top in brought
        for element in top.walk()
        for origin in (origin_of(element),)
        for written in (origin.text, origin.tail, *origin.attributes.values())
        for name in parameters_in(element, written)
    )


@lru_cache(maxsize=1)
def _pieces_in(written: str, call: TemplateCall) -> tuple[Sequence[TextPiece], list[int]]:
    """The pieces of a text, and their offsets after filling. Cached for several places of one text."""
    pieces = text_pieces(written)
    lengths = (len(call.piece_text(piece)) for piece in pieces)
    return pieces, [0, *accumulate(lengths)][: len(pieces)]


# --- reading --------------------------------------------------------------------------------------------------------


def read_xml(source: SourceFile, diagnostics: Diagnostics) -> XmlFile | None:
    """Parse a file. Syntax errors are reported; common ones are repaired, so that the rest is read."""
    try:
        return XmlFile(source, XmlTree(source.text, source.name))
    except XmlSyntaxError as first:
        error = first
    if error.is_final:
        diagnostics.error(error.code, source.location(error.offset), str(error))
        return None
    repaired = RepairedText(source.text)
    for mistake in repaired.mistakes:
        diagnostics.error(mistake.code, source.location(mistake.offset), mistake.message)
    if repaired.mistakes:
        try:
            return XmlFile(source, XmlTree(repaired.text, source.name), repaired)
        except XmlSyntaxError as second:
            error = second
    diagnostics.error(error.code, source.location(repaired.original_offset(error.offset)), str(error))
    return None


def xml_of(source: SourceFile, files: FileReader) -> XmlFile | None:
    """Like `read_xml`, but parses a file only once. Diagnostics go to those of `files`."""
    return files.memo.read(("xml", source), files.diagnostics, partial(read_xml, source))
