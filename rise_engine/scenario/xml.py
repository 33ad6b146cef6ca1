"""XML files of a scenario: their elements, those of templates among them, and where these stand, as findings say it.

An element that comes from a template knows which, and by which `<use>`. So a finding about it has its place in the
`<use>`, exactly in the value that is wrong where it came from there, and names the line of the template beside.
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
from rise_engine.scenario.model import SourceLocation, TemplateLocation
from rise_engine.scenario.source_files import FileReader, SourceFile
from rise_engine.syntax.xml import Element, XmlSyntaxError, XmlTree
from rise_engine.syntax.xml_repair import RepairedText

_MARK = re.compile(r"\$\$\{|\$\{([^{}$]*)(\}?)")


class XmlFile:
    """A file that is well-formed, perhaps after repair; or the same with its templates put in."""

    def __init__(
        self, source: SourceFile, tree: XmlTree, repaired: RepairedText | None = None, root: Element | None = None
    ) -> None:
        """`root`: what the templates have made of the tree's outermost element."""
        self.source = source
        self.tree = tree
        self.repaired = repaired
        """How the text of the tree came from that of the file; None: it is the same."""
        self.root = tree.root if root is None else root
        self.has_text = tree.has_text
        """Whether there may be visible text between tags."""
        self.may_define_templates = "<Template" in tree.text
        self.may_have_templates = self.may_define_templates or "<use" in tree.text
        """Whether it may have a `<Template>` or a `<use>`."""
        self.brought: dict[Element, list[Element]] = {}
        """What came of each `<use>` of the file."""
        self.incomplete: set[Element] = set()
        """Elements that do not hold all that they should: a `<use>` in them has come to nothing."""

    @property
    def is_expanded(self) -> bool:
        """Whether its templates have been put in."""
        return self.root is not self.tree.root

    def is_complete(self, element: Element) -> bool:
        """Whether the element holds all that it should."""
        return element not in self.incomplete

    def element_location(self, element: Element) -> SourceLocation:
        """Where an element's start tag begins."""
        return self._place(element, lambda origin: origin.start)

    def attribute_location(self, element: Element, name: str) -> SourceLocation:
        """Where an attribute's name stands."""
        return self._place(element, lambda origin: origin.attribute_offset(name))

    def value_location(self, element: Element, name: str, index: int = 0) -> SourceLocation:
        """Where the character number `index` (from 0) of an attribute's value stands in the file."""
        written = origin_of(element).attributes.get(name, "")
        return self._place_in(element, written, index, lambda origin, at: origin.value_offset(name, at))

    def text_location(self, element: Element, index: int = 0) -> SourceLocation:
        """Where the character number `index` of an element's text (up to its first child) stands in the file."""
        return self._place_in(element, origin_of(element).text, index, Element.text_offset)

    def tail_location(self, element: Element, index: int) -> SourceLocation:
        """Where the character number `index` of what stands behind an element stands in the file."""
        return self._place_in(element, origin_of(element).tail, index, Element.tail_offset)

    def written_location(self, element: Element, index: int) -> SourceLocation:
        """Where the character number `index` of an element as it is written stands in the file."""
        return self._place_in(element, origin_of(element).written, index, lambda origin, at: origin.start + at)

    def written(self, element: Element) -> str:
        """An element as it is written, with its tags, and with the values that a `<use>` gives."""
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
        """Where a character of a filled text stands: in the value that the `<use>` gives, if it came from there."""
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
    """Where it begins in what is written."""
    text: str
    parameter: str | None = None
    """The parameter that stands there instead, in `${...}`."""


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
        """The template's."""
        self.file = file
        """In which the template stands."""
        self.defaults = defaults
        """The template's parameters; None: the `<use>` gives a value."""
        self.use = use
        """The `<use>`, which may come from a template itself."""

    def piece_text(self, piece: TextPiece) -> str:
        """A parameter that the template does not have stays as it is written: that is a finding already."""
        if piece.parameter is None or piece.parameter not in self.defaults:
            return piece.text
        given = self.use.get(piece.parameter)
        return given if given is not None else self.defaults[piece.parameter] or ""

    def fill(self, written: str) -> str:
        """A text of the template with the values of the `<use>`."""
        return written if "${" not in written else "".join(map(self.piece_text, text_pieces(written)))

    def name_template(self, outer: SourceLocation, inner: SourceLocation) -> SourceLocation:
        """A place in the `<use>`, for something that stands at a place in the template."""
        return replace(outer, template=TemplateLocation(self.name, inner.file, inner.line, inner.column))


class ExpandedElement(Element):
    """An element that comes from a template, or in which one is put in."""

    __slots__ = ("call", "origin")

    def __init__(self, origin: Element, call: TemplateCall | None) -> None:
        """`call`: None for one that stands in the file."""
        attributes, text, tail = origin.attributes, origin.text, origin.tail
        if call is not None:
            attributes = {name: call.fill(value) for name, value in attributes.items()}
            text, tail = call.fill(text), call.fill(tail)
        super().__init__(origin.tag, attributes, origin.start, origin.tree, origin.parent)
        self.close, self.text, self.tail = origin.close, text, tail
        self.origin = origin
        self.call = call


def call_of(element: Element) -> TemplateCall | None:
    """The use of a template that an element comes from; None: it stands in its file."""
    return element.call if isinstance(element, ExpandedElement) else None


def origin_of(element: Element) -> Element:
    """An element as it is written, in its file or in a template."""
    return element.origin if isinstance(element, ExpandedElement) else element


def written_here(element: Element) -> Element:
    """What stands for an element in the file: itself, or the `<use>` that it comes from."""
    while (call := call_of(element)) is not None:
        element = call.use
    return origin_of(element)


def parameters_in(element: Element, written: str) -> Iterator[str]:
    """The parameters of the `<use>` in the file that a text of an element is made of, each as often as it stands."""
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
    """In how many places of what came of a `<use>` a parameter of it stands."""
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
    """The pieces of a text, and where each begins once it is filled in. About one text many places are asked."""
    pieces = text_pieces(written)
    lengths = (len(call.piece_text(piece)) for piece in pieces)
    return pieces, [0, *accumulate(lengths)][: len(pieces)]


# --- reading --------------------------------------------------------------------------------------------------------


def read_xml(source: SourceFile, diagnostics: Diagnostics) -> XmlFile | None:
    """Parse a file. What is wrong with its form becomes findings; with the common mistakes repaired it is read on."""
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
    """As `read_xml`, unless it was parsed before; findings go where those of `files` go."""
    return files.memo.read(("xml", source), files.diagnostics, partial(read_xml, source))
