"""Reads a file of BML 1.0: one block, with its namespaces resolved. Everything else is reported with its location."""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import BLANKS
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.xml import XmlFile, read_xml
from rise_engine.scenario.model import SourceLocation
from rise_engine.syntax.xml import Element
from rise_exchange.bml.names import FORM, NO_ACTION, ConversionFindings
from rise_exchange.bml.vocabulary import (
    BEHAVIORS,
    BLOCK,
    COMPOSITIONS,
    DRAFT_ATTRIBUTES,
    DRAFT_NAMESPACES,
    END,
    EXTENSIONS,
    NAMESPACE,
    OWN_NAMESPACE,
    PARTS,
    START,
    ElementWords,
)

_XML = "http://www.w3.org/XML/1998/namespace"
_BML = frozenset({NAMESPACE, EXTENSIONS})


class BmlElement(list["BmlElement"]):
    """An element of a block, as a list of its children."""

    def __init__(self, element: Element, file: XmlFile, scope: dict[str, str], draft: bool) -> None:
        """
        :param scope: the namespaces that its parents have declared, by prefix.
        :param draft: whether the file follows a draft, whose elements need no namespace.
        """
        scope = {**scope, **_declared(element)}
        prefix, _, local = element.tag.rpartition(":")
        self.namespace = scope.get(prefix, "")
        self.tag = local
        self.is_bml = self.namespace in _BML or (draft and self.namespace in DRAFT_NAMESPACES)
        self.written = element
        self.file = file
        self.text = element.text
        """The text before its first child."""
        self.attributes: dict[str, str] = {}
        """The attributes of BML, which have no namespace."""
        self.own: dict[str, str] = {}
        """The attributes in our namespace."""
        self.foreign: list[str] = []
        """The names of all other attributes."""
        for name, value in element.attributes.items():
            prefix, colon, attribute = name.rpartition(":")
            if name == "xmlns" or prefix == "xmlns":
                continue
            if not colon:
                self.attributes[name] = value
            elif scope.get(prefix) == OWN_NAMESPACE:
                self.own[attribute] = value
            else:
                self.foreign.append(name)
        super().__init__(BmlElement(child, file, scope, draft) for child in element)

    def get(self, name: str) -> str | None:
        """The value of a BML attribute."""
        return self.attributes.get(name)

    @property
    def is_own(self) -> bool:
        return self.namespace == OWN_NAMESPACE

    @property
    def tail(self) -> str:
        """The text after it, before the next element."""
        return self.written.tail

    @property
    def location(self) -> SourceLocation:
        return self.file.element_location(self.written)

    def value_location(self, name: str) -> SourceLocation:
        """The location of an attribute's value."""
        return self.file.value_location(self.written, name)

    def attribute_location(self, name: str) -> SourceLocation:
        """The location of an attribute's name."""
        return self.file.attribute_location(self.written, name)

    def all_text(self) -> str:
        """Its text, with the text of everything inside it."""
        return self.text + "".join(child.all_text() + child.tail for child in self)


def _declared(element: Element) -> dict[str, str]:
    found = {"xml": _XML}
    for name, value in element.attributes.items():
        if name == "xmlns":
            found[""] = value
        elif name.startswith("xmlns:"):
            found[name[6:]] = value
    return found


def read_block(source: SourceFile, findings: ConversionFindings) -> BmlElement | None:
    """Read the block in a file; None, after a diagnostic: there is none.

    Anything outside BML 1.0 is an error, except that words of drafts and other namespaces are losses.
    """
    file = read_xml(source, findings.diagnostics)
    if file is None:
        return None
    root = BmlElement(file.root, file, {}, draft=False)
    if not root.is_bml and root.namespace in DRAFT_NAMESPACES:
        root = BmlElement(file.root, file, {}, draft=True)
        findings.lose(root.location, f'this block is not in the namespace of BML 1.0 ("{NAMESPACE}"); it is read as if')
    if not root.is_bml or root.tag != "bml":
        near = did_you_mean(root.tag, ["bml"])
        message = f"`<{file.root.tag}>` is not a block of BML 1.0{near}; the outermost element is <bml>"
        findings.diagnostics.error(FORM, root.location, message)
        return None
    _FormChecker(findings, draft=root.namespace in DRAFT_NAMESPACES).check_block(root)
    return root


class _FormChecker:
    def __init__(self, findings: ConversionFindings, *, draft: bool) -> None:
        self.findings = findings
        self.draft = draft

    def error(self, location: SourceLocation, message: str) -> None:
        self.findings.diagnostics.error(FORM, location, message)

    def check_block(self, root: BmlElement) -> None:
        required = () if self.draft else BLOCK.required
        self.check_attributes(root, required, BLOCK.optional + BLOCK.required)
        composition = root.get("composition")
        if composition is not None and composition.upper() not in COMPOSITIONS:
            near = did_you_mean(composition, COMPOSITIONS)
            self.error(root.value_location("composition"), f"there is no composition `{composition}`{near}")
        for child in root:
            if child.is_bml and child.tag == "required":
                self.check_no_text(child)
                for inner in child:
                    self.check_inside(inner)
            else:
                self.check_inside(child)
        self.check_no_text(root)

    def check_inside(self, element: BmlElement) -> None:
        """Check a behaviour or a constraint."""
        words = BEHAVIORS.get(element.tag)
        if not element.is_bml:
            return
        if element.tag == "constraint":
            self.check_constraint(element)
        elif words is None:
            self.findings.diagnostics.error(
                NO_ACTION,
                element.location,
                f"`<{element.tag}>` is not a behaviour of BML 1.0{did_you_mean(element.tag, BEHAVIORS)}",
            )
        else:
            required = words.required if self.draft else ("id", *words.required)
            self.check_attributes(
                element, required, ("id", START, *words.points, END, *words.required, *words.optional)
            )
            if element.tag != "speech":
                self.check_no_text(element)
                self.check_children(element, words)

    def check_constraint(self, element: BmlElement) -> None:
        self.check_attributes(element, (), ("id",))
        self.check_children(element, ElementWords(children=("synchronize", "before", "after")))
        for relation in element:
            words = PARTS.get(relation.tag)
            if not relation.is_bml or words is None:
                continue
            self.check_attributes(relation, words.required, (*words.required, *words.optional))
            self.check_children(relation, words)
            for sync in relation:
                if sync.is_bml and sync.tag == "sync":
                    self.check_attributes(sync, ("ref",), ("ref",))

    def check_children(self, element: BmlElement, words: ElementWords) -> None:
        for child in element:
            if child.is_bml and child.tag not in (*words.children, "description"):
                known = (*words.children, "description")
                message = f"`<{child.tag}>` is not allowed in `<{element.tag}>`{did_you_mean(child.tag, known)}"
                self.error(child.location, message)
            elif child.is_bml and child.tag in ("lexeme", "stance", "pose"):
                part = PARTS[child.tag]
                self.check_attributes(child, part.required, (*part.required, *part.optional))

    def check_attributes(self, element: BmlElement, required: tuple[str, ...], known: tuple[str, ...]) -> None:
        tolerated = DRAFT_ATTRIBUTES.get(element.tag, ()) if self.draft else ()
        for name in element.attributes:
            if name in known:
                continue
            if name in tolerated:
                if name != "language":
                    message = f"`{name}` of `<{element.tag}>` is of a draft of BML; acts have nothing for it"
                    self.findings.lose(element.attribute_location(name), message)
                continue
            near = did_you_mean(name, known)
            message = f"`<{element.tag}>` has no attribute `{name}`{near}"
            self.error(element.attribute_location(name), message)
        for name in element.foreign:
            message = f"`{name}` is in a namespace of its own; its meaning is unknown here"
            self.findings.lose(element.attribute_location(name), message)
        for name in required:
            if name not in element.attributes:
                self.error(element.location, f"`<{element.tag}>` needs the attribute `{name}`")

    def check_no_text(self, element: BmlElement) -> None:
        for text in _texts(element):
            if text.strip(BLANKS):
                shown = " ".join(text[:1000].split())[:60]
                self.error(element.location, f"text is not allowed in `<{element.tag}>`: `{shown}`")
                return


def _texts(element: BmlElement) -> Iterator[str]:
    yield element.text
    yield from (child.tail for child in element)
