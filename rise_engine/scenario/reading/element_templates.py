"""Templates: elements written once, with parameters, and used many times (docs/reference/templates.md).

    <Template name="Say"><parameter name="text"/><Speech>...<message>${text}</message></Speech></Template>
    <use template="Say" text="Hello"/>

This module reports errors in templates and uses, once and at their places. `expansion.py` then replaces each `<use>`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from rise_engine.base.nearest_name import suggest
from rise_engine.base.text import BLANKS
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.xml import TextPiece, XmlFile, text_pieces, xml_of
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.reading.element_reader import ElementReader
from rise_engine.scenario.reading.graph import find_cycles
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import WRAPPERS

LIBRARY = Path(__file__).parents[1] / "patterns"
"""The patterns of the program: one template per file, named like the template."""
PATTERNS = "patterns"
"""The folder of a scenario that overrides the library. A session keeps its used patterns there."""
_NAME = re.compile(r"[^\W\d][\w-]*\Z")
_TEMPLATE = frozenset({"name"})
_PARAMETER = frozenset({"name", "default"})
HOLDERS = frozenset(WRAPPERS) | frozenset(
    {
        *("Dialog", "InteractionRule", "State", "transitions", "transition", "onEntry", "onExit"),
        *("if", "elseif", "else", "oneOf", "Template"),
    }
)
"""The elements that may contain `<use>`: those with acts, actions, rules, states, transitions or functions."""


class ElementTemplate:
    """A template."""

    def __init__(self, name: str, file: XmlFile, element: Element) -> None:
        self.name = name
        self.file = file
        self.element = element
        self.parameters: dict[str, Element] = {}
        self.content = [child for child in element if child.tag != "parameter"]
        self.uses: set[str] = set()
        """The names of the templates that its content uses."""

    @property
    def defaults(self) -> dict[str, str | None]:
        """The defaults of its parameters; None: the parameter is required."""
        return {name: element.get("default") for name, element in self.parameters.items()}


class TemplateCollection:
    """The templates of a scenario, and the template of each `<use>`."""

    def __init__(self, files: FileReader, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.files = files
        self.memo = files.memo
        self.draft = draft
        self.diagnostics = diagnostics
        self.templates: dict[str, ElementTemplate] = {}
        self.own: set[str] = set()
        """The names of the templates in the files of acts and rules."""
        self.meant: dict[Element, ElementTemplate] = {}
        """The template of each correct `<use>`."""
        self.circular: set[str] = set()
        """Templates that use each other in a circle and cannot be expanded."""
        self._library: dict[str, Path] | None = None

    def read(self, files: Iterable[XmlFile]) -> None:
        """Find the templates of these files, and check them and every `<use>`."""
        files = list(files)
        for file in files:
            if file.may_define_templates:
                _TemplateReader(file, self, self.diagnostics).read_templates()
        self.own.update(self.templates)
        used: set[str] = set()
        for file in files:
            used |= self._check("uses", file, file.root, None)
        for template in pending(self.templates):
            template.uses = self._check(template.name, template.file, template.element, template)
            used |= template.uses
        for cycle in find_cycles(self._uses_of_templates()):
            first = self.templates[cycle[0]]
            message = f"these templates use each other: {' -> '.join((*cycle, cycle[0]))}; none of them would ever end"
            self.diagnostics.error("cycle", first.file.value_location(first.element, "name"), message)
            self.circular.update(cycle)
        for name in sorted(self.own - used):
            location = self.templates[name].file.value_location(self.templates[name].element, "name")
            self.diagnostics.warning("unused-template", location, f"nothing uses the template `{name}`")

    def _check(self, what: str, file: XmlFile, element: Element, template: ElementTemplate | None) -> set[str]:
        """Check the uses in an element, and the content of a template. Returns the names of the used templates."""
        names = self.memo.get(("names", file, what), lambda: frozenset(_names_used(element)))

        def make(diagnostics: Diagnostics) -> tuple[set[str], dict[Element, ElementTemplate]]:
            reader = _TemplateReader(file, self, diagnostics)
            if template is not None:
                reader.check_content(template)
            reader.check_uses(element)
            return reader.used, reader.meant

        key = ("checked", file, what, self._stamp(names))
        used, meant = self.memo.read(key, self.diagnostics, make)
        self.meant.update(meant)
        return used

    def _stamp(self, names: Iterable[str]) -> tuple[object, ...]:
        """The dependencies of a check of elements that use these templates: the templates' files."""
        found = [(name, self.find(name)) for name in sorted(names)]
        files = tuple((name, template and template.file) for name, template in found)
        if all(template for _, template in found):
            return files
        return files, frozenset(self.templates), frozenset(self.library), bool(self.draft.unreadable_parts)

    def stamp_of(self, file: XmlFile) -> tuple[object, ...]:
        """The dependencies of the expansion of a file: the files of all templates that it uses, directly or not."""
        names: set[str] = set()
        rest = [*self.memo.get(("names", file, "uses"), lambda: frozenset(_names_used(file.root)))]
        while rest:
            if (name := rest.pop()) not in names:
                names.add(name)
                rest += self.templates[name].uses if name in self.templates else ()
        return (*self._stamp(names), frozenset(self.circular & names))

    def _uses_of_templates(self) -> dict[str, list[str]]:
        """The templates that each template uses, by name."""
        return {name: sorted(each.uses & self.templates.keys()) for name, each in self.templates.items()}

    def find(self, name: str) -> ElementTemplate | None:
        """The template of this name: the scenario's own, or else the library's, which is read on demand."""
        if name not in self.templates and name in self.library:
            source = self.files.read(self.library[name])
            if source is not None and (file := xml_of(source, self.files)) is not None:
                _TemplateReader(file, self, self.diagnostics).read_templates()
        return self.templates.get(name)

    @property
    def library(self) -> dict[str, Path]:
        """The files of the library, by the names of their templates."""
        if self._library is None:
            folders = (LIBRARY, self.files.folder / PATTERNS)
            self._library = {path.stem: path for folder in folders for path in self._xml_files(folder)}
        return self._library

    def _xml_files(self, folder: Path) -> list[Path]:
        try:
            return [folder / name for name in self.files.tree.names(folder) if name.endswith(".xml")]
        except OSError:
            return []


def pending(templates: dict[str, ElementTemplate]) -> Iterator[ElementTemplate]:
    """Yield all templates, including those found meanwhile."""
    done: set[str] = set()
    while rest := [each for name, each in templates.items() if name not in done]:
        for template in rest:
            done.add(template.name)
            yield template


class _TemplateReader(ElementReader):
    """Reads the templates of a file."""

    def __init__(self, file: XmlFile, collection: TemplateCollection, diagnostics: Diagnostics) -> None:
        super().__init__(file, collection.draft, diagnostics)
        self.collection = collection
        self.used: set[str] = set()
        """The names of the used templates."""
        self.meant: dict[Element, ElementTemplate] = {}
        """As in the collection."""

    def read_templates(self) -> None:
        root = self.file.root
        for element in root if root.tag in WRAPPERS else [root]:
            if element.tag == "Template":
                self.read_template(element)

    def read_template(self, element: Element) -> None:
        self.check_attributes(element, _TEMPLATE)
        self.check_no_text(element)
        name = (element.get("name") or "").strip()
        known = self.collection.templates.get(name)
        if not name:
            self.report_error("missing-attribute", element, 'a template needs a name: <Template name="...">')
        elif known is not None:
            first = known.file.element_location(known.element)
            message = f"there is another template `{name}` in {first.file}, line {first.line}"
            self.report_value("duplicate-name", element, "name", message)
        template = ElementTemplate(name, self.file, element)
        for child in element:
            if child.tag == "parameter":
                self.read_parameter(child, template)
        if not template.content:
            self.report_warning("no-effect", element, f"the template `{name}` holds nothing")
        if name and known is None:
            self.collection.templates[name] = template

    def read_parameter(self, element: Element, template: ElementTemplate) -> None:
        self.check_attributes(element, _PARAMETER)
        self.check_no_text(element)
        for child in element:
            self.report_error(
                "unknown-element", child, f"nothing is allowed inside `<parameter>`; move `<{child.tag}>` after it"
            )
        name = (element.get("name") or "").strip()
        if not name:
            self.report_error("missing-attribute", element, 'a parameter needs a name: <parameter name="..."/>')
        elif not _NAME.match(name) or name == "template":
            reserved = "; `template` says which template is used" if name == "template" else ""
            message = f"a parameter's name is one word of letters, digits, _ and -, not `{name}`{reserved}"
            self.report_value("bad-name", element, "name", message)
        elif name in template.parameters:
            self.report_value("duplicate-parameter", element, "name", f"the parameter `{name}` is given twice here")
        else:
            template.parameters[name] = element
        default = element.get("default") or ""
        if (at := default.find("${")) >= 0:
            location = self.file.value_location(element, "default", at)
            self.diagnostics.error("template", location, "a default is a plain text; it cannot name other parameters")

    def check_content(self, template: ElementTemplate) -> None:
        """Check every `${...}` in a template."""
        read: set[str] = set()
        for element in _elements(template.content):
            for name, value in element.attributes.items():
                for piece in _parameters(value):
                    at = self.file.value_location(element, name, piece.start)
                    self.check_piece(piece, template, at, read)
            for piece in _parameters(element.text):
                self.check_piece(piece, template, self.file.text_location(element, piece.start), read)
            for piece in _parameters(element.tail):
                self.check_piece(piece, template, self.file.tail_location(element, piece.start), read)
        for name, element in template.parameters.items():
            if name not in read:
                message = f"the template `{template.name}` makes no use of its parameter `{name}`"
                self.diagnostics.warning("unused-parameter", self.file.value_location(element, "name"), message)

    def check_piece(self, piece: TextPiece, template: ElementTemplate, at: SourceLocation, read: set[str]) -> None:
        name = piece.parameter or ""
        read.add(name)
        if not piece.text.endswith("}"):
            message = "a `${` without its `}`; write `$${` for the characters themselves"
            self.diagnostics.error("template", at, message)
        elif name not in template.parameters:
            message = f"the template `{template.name}` has no parameter `{name}`"
            self.diagnostics.error("unknown-parameter", at, message, suggest(name, template.parameters))

    def check_uses(self, parent: Element) -> None:
        """Check every `<use>` inside an element, except in templates within it."""
        for child in parent:
            if child.tag in ("use", "Template"):
                self.check_no_tail(child)
            if child.tag == "use":
                self.check_use(child, parent)
            elif child.tag != "Template":
                self.check_uses(child)
            elif parent is not self.file.root or parent.tag not in WRAPPERS:
                message = "`<Template>` is not allowed here; it belongs beside the acts or rules of a file"
                self.report_error("unknown-element", child, message)

    def check_no_tail(self, element: Element) -> None:
        """Report text after an element that is replaced before its parent is read."""
        if stray := element.tail.strip(BLANKS):
            location = self.file.tail_location(element, element.tail.index(stray))
            message = f"text is not allowed here: `{' '.join(stray[:1000].split())[:60]}`"
            self.diagnostics.error("unexpected-text", location, message)

    def check_use(self, element: Element, parent: Element) -> None:
        self.check_no_text(element)
        for child in element:
            message = f"nothing is allowed inside `<use>`; delete `<{child.tag}>`"
            self.report_error("unknown-element", child, message)
        name = (element.get("template") or "").strip()
        self.used.add(name)
        if parent.tag not in HOLDERS:
            message = f"`<use>` is not allowed in `<{parent.tag}>`; it belongs where acts, actions, rules, states, "
            self.report_error("misplaced", element, message + "transitions or functions are")
        elif not name:
            self.report_error("missing-attribute", element, '`<use>` needs a template: <use template="..."/>')
        elif "${" in name:
            self.report_value("wrong-value", element, "template", "write the template's name itself, without `${...}`")
        elif (template := self.collection.find(name)) is not None:
            self.check_arguments(element, template)
        elif not self.collection.draft.unreadable_parts:
            known = [*self.collection.templates, *self.collection.library]
            near = suggest(name, sorted(known), limit=0)
            code = unknown_code("unknown-template", name, known)
            self.report_value(code, element, "template", f"there is no template `{name}`", near)

    def check_arguments(self, element: Element, template: ElementTemplate) -> None:
        required = {name for name, default in template.defaults.items() if default is None}
        missing = [name for name in template.parameters if name in required and name not in element.attributes]
        for name in element.attributes:
            if name != "template" and name not in template.parameters:
                near = suggest(name, template.parameters)
                message = f"the template `{template.name}` has no parameter `{name}`"
                self.report_attribute("unknown-parameter", element, name, message, near)
                missing = [each for each in missing if each != near.meant]
        if missing:
            names = ", ".join(f"`{name}`" for name in missing)
            where = template.file.element_location(template.element)
            message = f"the template `{template.name}` ({where.file}, line {where.line}) needs {names}"
            self.report_error("missing-parameter", element, message)
        if required <= element.attributes.keys():
            self.meant[element] = template


def _elements(elements: Iterable[Element]) -> Iterator[Element]:
    """Yield these elements and their contents."""
    rest = list(elements)[::-1]
    while rest:
        element = rest.pop()
        yield element
        rest += element[::-1]


def _names_used(parent: Element) -> Iterator[str]:
    """Yield the names of the templates that an element uses, except in templates within it."""
    rest = [child for child in parent if child.tag != "Template"]
    while rest:
        element = rest.pop()
        if element.tag == "use":
            yield (element.get("template") or "").strip()
        rest += (child for child in element if child.tag != "Template")


def _parameters(written: str) -> Iterator[TextPiece]:
    if "${" in written:
        yield from (piece for piece in text_pieces(written) if piece.parameter is not None)
