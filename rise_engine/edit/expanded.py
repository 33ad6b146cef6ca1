"""Files of acts and rules with what their templates bring, each element knowing what it was written as.

As `rise_engine.scenario.expansion`, but for files that need not be right: what a template cannot be put in for is left
out, and nothing is reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache

from rise_engine.edit.documents import Node, NotXmlError, XmlDocument, read_document
from rise_engine.scenario.element_templates import LIBRARY, text_pieces
from rise_engine.scenario.expansion import MAX_ELEMENTS, MAX_LEVELS

_WRAPPERS = ("Dialogs", "AgentDialogs", "CommunicationRobotActs", "InteractionRules")


class Templates:
    """The templates of a study, found by name as the reader of scenarios finds them."""

    def __init__(self, own: Iterable[bytes], patterns: dict[str, bytes]) -> None:
        """:param own: the files of acts and rules. :param patterns: those of the folder `patterns/`, by template."""
        self._found: dict[str, Node] = {}
        self._patterns = {**_library(), **patterns}
        for data in own:
            self._add_file(data)

    def _add_file(self, data: bytes) -> None:
        try:
            root = read_document(data).root
        except NotXmlError:
            return
        for node in root.children if root.tag in _WRAPPERS else [root]:
            if node.tag == "Template" and node.get("name"):
                self._found.setdefault(node.get("name"), node)

    def find(self, name: str) -> Node | None:
        """The `<Template>` of this name."""
        if name not in self._found and name in self._patterns:
            self._add_file(self._patterns[name])
        return self._found.get(name)


@lru_cache(maxsize=1)
def _library() -> dict[str, bytes]:
    return {path.stem: path.read_bytes() for path in sorted(LIBRARY.glob("*.xml"))}


def parameters_of(template: Node) -> dict[str, str | None]:
    """A template's parameters, each with its default; None: it must be given."""
    found = (child for child in template.children if child.tag == "parameter")
    return {child.get("name"): child.attributes.get("default") for child in found if child.get("name")}


class Shown:
    """An element as it is read: one of the file, one that a template brings, or a `<use>` with what it brings."""

    __slots__ = ("attributes", "call", "children", "node", "origin", "tag", "text")

    def __init__(self, origin: Node, call: _Call | None) -> None:
        self.origin = origin
        """As it is written, in the file or in a template."""
        self.call = call
        self.node: Node = origin if call is None else call.outermost
        """What stands for it in the file: itself, or the `<use>`."""
        self.tag = origin.tag
        self.attributes = origin.attributes
        self.text = origin.text
        if call is not None:
            self.attributes = {name: call.fill(value) for name, value in origin.attributes.items()}
            self.text = call.fill(origin.text)
        self.children: list[Shown] = []

    def get(self, name: str) -> str:
        """The value of an attribute without blanks around it; empty: it has none."""
        return self.attributes.get(name, "").strip()

    @property
    def template(self) -> str:
        """The template that it comes from, as the `<use>` in the file names it; empty: it stands in the file."""
        return "" if self.call is None else self.node.get("template")

    @property
    def line(self) -> int:
        return self.node.line

    def contents(self) -> Iterator[Shown]:
        """What it holds, with what each `<use>` brings in its place."""
        for child in self.children:
            if child.tag == "use":
                yield from child.contents()
            else:
                yield child

    def text_parameter(self) -> str:
        """The parameter of the `<use>` in the file whose value its text is."""
        return "" if self.call is None else self.call.parameter_in(self.origin.text.strip())

    def attribute_parameter(self, name: str) -> str:
        """The parameter of the `<use>` in the file whose value an attribute is."""
        return "" if self.call is None else self.call.parameter_in(self.origin.attributes.get(name, ""))


class _Call:
    """One use of a template."""

    def __init__(self, use: Shown, template: Node) -> None:
        self.use = use
        self.defaults = parameters_of(template)
        self.outermost: Node = use.node
        self.within: frozenset[Node] = frozenset({template}) | (use.call.within if use.call else frozenset())
        """The templates that are being put in: none of them again, or there would be no end."""

    def value(self, parameter: str) -> str | None:
        given = self.use.attributes.get(parameter)
        return given if given is not None else self.defaults.get(parameter)

    def fill(self, written: str) -> str:
        if "${" not in written:
            return written
        pieces = []
        for piece in text_pieces(written):
            value = self.value(piece.parameter) if piece.parameter is not None else None
            pieces.append(piece.text if value is None else value)
        return "".join(pieces)

    def parameter_in(self, written: str) -> str:
        """The parameter of the outermost `<use>` that a text of the template is, alone."""
        pieces = list(text_pieces(written))
        if len(pieces) != 1 or (name := pieces[0].parameter) is None or name not in self.defaults:
            return ""
        if self.use.call is None:
            return name
        return self.use.attribute_parameter(name) if name in self.use.attributes else ""


class _Expander:
    def __init__(self, templates: Templates) -> None:
        self.templates = templates
        self.left = MAX_ELEMENTS

    def show(self, origin: Node, call: _Call | None, level: int) -> Shown:
        shown = Shown(origin, call)
        if call is not None:
            self.left -= 1
        if self.left < 0 or level > MAX_LEVELS:
            return shown
        if origin.tag == "use":
            template = self.templates.find(shown.get("template"))
            if template is not None and (call is None or template not in call.within):
                inner = _Call(shown, template)
                if all(inner.value(name) is not None for name in inner.defaults):
                    content = (child for child in template.children if child.tag != "parameter")
                    shown.children = [self.show(each, inner, level + 1) for each in content]
        elif origin.tag != "Template":
            shown.children = [self.show(each, call, level + 1) for each in origin.children]
        return shown


def expand(document: XmlDocument, templates: Templates) -> Shown:
    """A file's outermost element, with what its templates bring."""
    return _Expander(templates).show(document.root, None, 1)
