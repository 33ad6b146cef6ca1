"""Puts the elements of templates where `<use>` stands, before anything is read as acts and rules: there is one reader.

An element that comes from a template knows which, and by which `<use>`. So a finding about it has its place in the
`<use>`, exactly in the value that is wrong where it came from there, and names the line of the template beside.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate
from typing import NamedTuple

from msgspec.structs import replace

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.element_templates import ElementTemplate, TemplateCollection, TextPiece, text_pieces
from rise_engine.scenario.model import SourceLocation, TemplateLocation
from rise_engine.scenario.xml import Element, XmlFile

MAX_ELEMENTS = 100_000
"""How many elements may come from templates in one scenario."""
MAX_CHARACTERS = 10_000_000
"""How many characters of attributes and texts may."""
MAX_LEVELS = 100
"""How deep elements may lie in each other, in a file with templates."""


class TemplateCall(NamedTuple):
    """One use of a template."""

    template: ElementTemplate
    use: Element
    """The `<use>`, which may come from a template itself."""

    def value(self, parameter: str) -> str:
        """What stands for a parameter."""
        given = self.use.get(parameter)
        return given if given is not None else self.template.parameters[parameter].attributes["default"]


class ExpandedElement(Element):
    """An element that comes from a template."""

    __slots__ = ("call", "origin")

    def __init__(self, origin: Element, call: TemplateCall) -> None:
        attributes = {name: _fill(value, call) for name, value in origin.attributes.items()}
        super().__init__(origin.tag, attributes, origin.start_offset)
        self.text = _fill(origin.text, call)
        self.tail = _fill(origin.tail, call)
        self.origin = origin
        self.call = call

    @property
    def length(self) -> int:
        """The characters of its attributes, of its text, and of what stands behind it."""
        return len(self.text) + len(self.tail) + sum(map(len, self.attributes.values()))


def _fill(written: str, call: TemplateCall) -> str:
    if "${" not in written:
        return written
    return "".join(_piece_text(piece, call) for piece in text_pieces(written))


def _piece_text(piece: TextPiece, call: TemplateCall) -> str:
    """A parameter that the template does not have stays as it is written: that is a finding already."""
    if piece.parameter is None or piece.parameter not in call.template.parameters:
        return piece.text
    return call.value(piece.parameter)


class ExpandedFile(XmlFile):
    """A file in which every `<use>` has become what it stands for."""

    def __init__(self, file: XmlFile) -> None:
        self.source = file.source
        self.has_text = file.has_text
        self.may_have_templates = self.may_define_templates = True
        self.root = file.root
        self._text = file._text
        self._repaired = file._repaired
        self.original = file
        self.replacements: dict[int, list[Element]] = {}
        """By the id of a `<use>` of the file: what came of it."""
        self.incomplete: set[int] = set()
        """The ids of elements in which a `<use>` has come to nothing."""
        self._asked_last: tuple[str, TemplateCall, list[TextPiece], list[int]] | None = None

    def is_complete(self, element: Element) -> bool:
        return id(element) not in self.incomplete

    def element_location(self, element: Element) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().element_location(element)
        inner = element.call.template.file.element_location(element.origin)
        return self._in_use(element.call, inner)

    def attribute_location(self, element: Element, name: str) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().attribute_location(element, name)
        inner = element.call.template.file.attribute_location(element.origin, name)
        return self._in_use(element.call, inner)

    def value_location(self, element: Element, name: str, index: int = 0) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().value_location(element, name, index)
        origin, file = element.origin, element.call.template.file
        written = origin.attributes.get(name, "")
        return self._piece_location(written, index, element.call, lambda at: file.value_location(origin, name, at))

    def text_location(self, element: Element, index: int = 0) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().text_location(element, index)
        origin, file = element.origin, element.call.template.file
        return self._piece_location(origin.text, index, element.call, lambda at: file.text_location(origin, at))

    def tail_location(self, element: Element, index: int) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().tail_location(element, index)
        origin, file = element.origin, element.call.template.file
        return self._piece_location(origin.tail, index, element.call, lambda at: file.tail_location(origin, at))

    def written(self, element: Element) -> str:
        """For an element that comes from a template: as it is written there, with the values of the `<use>`."""
        if not isinstance(element, ExpandedElement):
            return super().written(element)
        return _fill(element.call.template.file.written(element.origin), element.call)

    def written_location(self, element: Element, index: int) -> SourceLocation:
        if not isinstance(element, ExpandedElement):
            return super().written_location(element, index)
        origin, file = element.origin, element.call.template.file
        return self._piece_location(
            file.written(origin), index, element.call, lambda at: file.written_location(origin, at)
        )

    def _in_use(self, call: TemplateCall, inner: SourceLocation) -> SourceLocation:
        """The place of a `<use>`, for something that stands there in its template."""
        return _with_template(self.element_location(call.use), call, inner)

    def _piece_location(
        self, written: str, index: int, call: TemplateCall, locate: Callable[[int], SourceLocation]
    ) -> SourceLocation:
        """Where a character of a filled text stands: in the value that the `<use>` gives, if it came from there."""
        pieces, starts = self._pieces_of(written, call)
        if not pieces:
            return self._in_use(call, locate(index))
        which = max(bisect_right(starts, index) - 1, 0)
        piece, rest = pieces[which], index - starts[which]
        if piece.parameter is None:
            return self._in_use(call, locate(piece.start + rest))
        if piece.parameter in call.use.attributes:
            outer = self.value_location(call.use, piece.parameter, rest)
        else:
            outer = self.element_location(call.use)
        return _with_template(outer, call, locate(piece.start))

    def _pieces_of(self, written: str, call: TemplateCall) -> tuple[list[TextPiece], list[int]]:
        """The pieces of a text, and where each begins once it is filled in. About one text many places are asked."""
        if self._asked_last is None or self._asked_last[0] != written or self._asked_last[1].use is not call.use:
            pieces = list(text_pieces(written))
            lengths = (len(_piece_text(piece, call)) for piece in pieces)
            self._asked_last = written, call, pieces, [0, *accumulate(lengths)][: len(pieces)]
        return self._asked_last[2:]


def _with_template(outer: SourceLocation, call: TemplateCall, inner: SourceLocation) -> SourceLocation:
    place = TemplateLocation(call.template.name, inner.file, inner.line, inner.column)
    return replace(outer, template=place)


def expand_files(files: Sequence[XmlFile], templates: TemplateCollection) -> list[XmlFile]:
    """These files with their templates put in, within limits for all of them together."""
    expanded: list[XmlFile] = []
    elements = characters = 0
    for file in files:
        if not file.may_have_templates or file.root.tag == "Template":
            expanded.append(file)
            continue
        new, expander = templates.memo.get(
            ("expanded", file, templates.stamp_of(file)), partial(_expand, file, templates)
        )
        expanded.append(new)
        elements, characters = elements + expander.elements, characters + expander.characters
        if expander.is_full or elements > MAX_ELEMENTS or characters > MAX_CHARACTERS:
            whole = Expander(templates, templates.diagnostics)
            return [whole.expand(each) for each in files]
    return expanded


def _expand(file: XmlFile, templates: TemplateCollection) -> tuple[XmlFile, Expander]:
    expander = Expander(templates, Diagnostics())
    return expander.expand(file), expander


class Expander:
    """Expands files, within limits for all of them together."""

    def __init__(self, templates: TemplateCollection, diagnostics: Diagnostics) -> None:
        self.meant = templates.meant
        self.circular = templates.circular
        self.diagnostics = diagnostics
        self.elements = 0
        self.characters = 0
        self.is_full = False
        self._file: ExpandedFile
        """The one that is being expanded."""
        self._has_failed = False
        """Whether something has come to nothing in the element that is being expanded."""

    def expand(self, file: XmlFile) -> XmlFile:
        """The file with its templates put in; the same one when it has none."""
        if not file.may_have_templates or file.root.tag == "Template":
            return file
        self._file = ExpandedFile(file)
        self._has_failed = False
        root = Element(file.root.tag, file.root.attributes, file.root.start_offset)
        root.end_offset, root.text = file.root.end_offset, file.root.text
        self._add_content(root, file.root, None, 1)
        if self.is_full:  # half an act would only be called wrong
            root.clear()
            self._file.incomplete.add(id(root))
        self._file.root = root
        return self._file

    def _add_content(self, new: Element, old: Element, call: TemplateCall | None, level: int) -> None:
        """Give an element what the one holds that it is made of."""
        for child in old:
            if child.tag == "use":
                self._add_use(new, child, call, level)
            elif child.tag != "Template":
                self._add_copy(new, child, call, level)
        if self._has_failed:
            self._file.incomplete.add(id(new))

    def _add_copy(self, new: Element, child: Element, call: TemplateCall | None, level: int) -> None:
        if call is None:
            copy = Element(child.tag, child.attributes, child.start_offset)
            copy.end_offset, copy.text, copy.tail = child.end_offset, child.text, child.tail
        else:
            copy = ExpandedElement(child, call)
            self.elements += 1
            self.characters += copy.length
            if not self._check_limits(copy, level):
                return
        new.append(copy)
        outside, self._has_failed = self._has_failed, False
        if len(child):
            self._add_content(copy, child, call, level + 1)
        self._has_failed |= outside

    def _add_use(self, new: Element, child: Element, call: TemplateCall | None, level: int) -> None:
        template = self.meant.get(id(child))
        if template is None or template.name in self.circular:
            self._has_failed = True
            return
        use = child if call is None else ExpandedElement(child, call)
        inner = TemplateCall(template, use)
        if not self._check_limits(use, level):
            return
        self._file.has_text |= template.file.has_text
        before = len(new)
        for element in template.content:
            if element.tag == "use":
                self._add_use(new, element, inner, level + 1)
            elif element.tag != "Template":
                self._add_copy(new, element, inner, level)
        for element in new[before:]:
            element.tail = ""  # between what a template holds, text is a finding already
        if call is None:
            self._file.replacements[id(child)] = new[before:]

    def _check_limits(self, element: Element, level: int) -> bool:
        """Whether there may be more; the first time not, a finding."""
        problem = ("", "")
        if level > MAX_LEVELS:
            problem = ("too-deep", f"with its templates, this lies more than {MAX_LEVELS} elements deep")
        elif self.elements > MAX_ELEMENTS:
            problem = ("too-large", f"more than {MAX_ELEMENTS} elements would come of the templates of this scenario")
        elif self.characters > MAX_CHARACTERS:
            problem = ("too-large", f"more than {MAX_CHARACTERS} characters would come of the templates")
        if problem[0] and not self.is_full:
            self.is_full = True
            self.diagnostics.error(problem[0], self._file.element_location(element), problem[1])
        self._has_failed |= self.is_full
        return not self.is_full
