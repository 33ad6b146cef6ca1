"""The base of the readers of acts and rules: elements, attributes, and times (semantics.md 5.5)."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from functools import partial

from rise_engine.base.nearest_name import Correction, nearest_name, suggest
from rise_engine.base.text import BLANKS, character_name, find_unseen
from rise_engine.expression import EvaluationError, Expression, ExpressionError
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Definition, ScenarioDraft
from rise_engine.scenario.durations import MAX_SECONDS, UNITS, parse_time, seconds_from
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.scenario.grammar import form_of
from rise_engine.scenario.model import Act, Delay, Rule, SourceLocation
from rise_engine.scenario.reading.expression_checks import expression_message, note_expression
from rise_engine.syntax.xml import Element


class ElementReader:
    """Reads elements of a file into a draft and reports mistakes."""

    tables: Collection[str] = ()
    """The names of the scenario's tables."""

    def __init__(self, file: XmlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.file = file
        self.draft = draft
        self.diagnostics = diagnostics

    def report_error(self, code: str, element: Element, message: str, suggestion: Correction | None = None) -> None:
        """Report an error at the beginning of an element."""
        self.diagnostics.error(code, self.file.element_location(element), message, suggestion)

    def report_value(
        self, code: str, element: Element, attribute: str, message: str, suggestion: Correction | None = None
    ) -> None:
        """Report an error at the value of an attribute."""
        self.diagnostics.error(code, self.file.value_location(element, attribute), message, suggestion)

    def report_attribute(
        self, code: str, element: Element, attribute: str, message: str, suggestion: Correction | None = None
    ) -> None:
        """Report an error at the name of an attribute."""
        self.diagnostics.error(code, self.file.attribute_location(element, attribute), message, suggestion)

    def report_warning(self, code: str, element: Element, message: str) -> None:
        """Report a warning at the beginning of an element."""
        self.diagnostics.warning(code, self.file.element_location(element), message)

    def read_parts(
        self,
        tag: str,
        wrappers: tuple[str, ...],
        definitions: list[Definition],
        read: Callable[[Element], Act | Rule | None],
    ) -> None:
        """Add the acts or the rules of the file to `definitions`."""
        for element in self.top_elements(tag, wrappers):
            part = read(element)
            if part is not None:
                definitions.append(Definition(part, partial(self.file.value_location, element, "name")))

    def top_elements(self, tag: str, wrappers: tuple[str, ...]) -> Iterator[Element]:
        """Yield the elements called `tag`: the outermost element itself, or the children of a wrapper."""
        root = self.file.root
        if root.tag == tag:
            yield root
            return
        if root.tag == "Template":  # a file with a single template
            return
        if root.tag not in wrappers:
            near = suggest(root.tag, (tag, *wrappers)).words
            self.report_error("unknown-element", root, f"`<{root.tag}>` cannot be the outermost element here{near}")
            return
        for name in root.attributes:
            self.report_attribute("unknown-attribute", root, name, f"`<{root.tag}>` has no attributes")
        self.check_no_text(root)
        for child in root:
            if child.tag == tag:
                yield child
            else:
                message = f"`<{child.tag}>` is not allowed here; `<{root.tag}>` holds `<{tag}>`"
                self.report_error("unknown-element", child, message)

    def check_attributes(self, element: Element, known: Collection[str] | None = None) -> dict[str, str]:
        """Return an element's attributes, and report each that is not `known` (None: not in the grammar)."""
        known = form_of(element.tag).attributes if known is None else known
        for name in element.attributes:
            if name not in known:
                self.report_unknown_attribute(element, name, known)
        return element.attributes

    def report_unknown_attribute(self, element: Element, name: str, known: Collection[str]) -> None:
        """Report an unknown attribute."""
        message, instead = f"`<{element.tag}>` has no attribute `{name}`", form_of(element.tag).foreign.get(name)
        if instead is not None:
            self.report_attribute("unknown-attribute", element, name, f"{message}: {instead}")
        else:
            self.report_attribute("unknown-attribute", element, name, message, suggest(name, sorted(known)))

    def report_missing(
        self, names: Collection[str], element: Element, message: str, code: str = "missing-attribute"
    ) -> None:
        """Report that an element has none of these attributes, unless a misspelt one was reported."""
        if all(self.read_meant(element, name) is None for name in names):
            self.report_error(code, element, message)

    def read_meant(self, element: Element, name: str) -> str | None:
        """Return the value of an attribute, even if its name is misspelt, which was reported and must cause no further
        errors. None: there is none."""
        known = form_of(element.tag).attributes
        values = (value for each, value in element.attributes.items() if each == name)
        meant = (v for each, v in element.attributes.items() if each not in known and nearest_name(each, known) == name)
        return next(iter((*values, *meant)), None)

    def check_no_text(self, element: Element) -> None:
        """Report text between the children of an element that may contain only elements."""
        if not self.file.has_text:
            return
        stray, behind = element.text.strip(BLANKS), None
        if not stray:
            for behind in element:
                if behind.tail and (stray := behind.tail.strip(BLANKS)):
                    break
            else:
                return
        whole = element.text if behind is None else behind.tail
        index = len(whole) - len(whole.lstrip(BLANKS))
        location = self.file.text_location(element, index) if behind is None else self.file.tail_location(behind, index)
        if find_unseen(stray) == 0:
            name = character_name(stray[0])
            message = f"the character {name} is not allowed here; delete it, or write an ordinary blank"
        else:
            message = f"text is not allowed here: `{' '.join(stray[:1000].split())[:60]}`"
        self.diagnostics.error("unexpected-text", location, message)


# --- times: `8s`, `{pause}`, `{patience}ms` ---------------------------------------------------------------------------


_COMPUTED = re.compile(r"(\s*\{)(.*)\}\s*(ms|s|min)?\s*\Z", re.DOTALL)
_NUMBER = re.compile(r"\s*\d+(?:\.\d+)?\s*\Z", re.ASCII)
MIN_SECONDS = 0.001
"""The minimum time: a transition after 0 s would not wait."""


def read_delay(reader: ElementReader, element: Element, attribute: str) -> Delay:
    """Read the time in an attribute. An invalid one is reported and becomes a delay without seconds and expression."""
    text = element.attributes[attribute]
    computed = _COMPUTED.match(text)
    if computed is None:
        return Delay(text.strip(), read_seconds(reader, element, attribute))
    try:
        expression = Expression.parse(computed.group(2))
    except ExpressionError as error:
        location = reader.file.value_location(element, attribute, len(computed.group(1)) + error.column - 1)
        reader.diagnostics.error("time", location, expression_message(error), error.suggestion)
        return Delay(text.strip())
    locate = partial(_locate, reader, element, attribute, len(computed.group(1)))
    note_expression(expression, locate, reader.draft, reader.diagnostics)
    unit = UNITS[computed.group(3)] if computed.group(3) else None
    if not expression.keys:
        _check_constant(reader, element, attribute, expression, unit)
    return Delay(text.strip(), None, expression, unit)


def computed_part(text: str) -> tuple[str, int] | None:
    """The expression of a computed time and its offset: `pause` and 1 for `{pause}ms`."""
    computed = _COMPUTED.match(text)
    return (computed.group(2), computed.start(2)) if computed is not None else None


def _check_constant(
    reader: ElementReader, element: Element, attribute: str, expression: Expression, unit: float | None
) -> None:
    """Check an expression without memory keys, whose value is known now unless it draws random numbers."""
    try:
        seconds = seconds_from(expression.value({}), unit)
    except EvaluationError:
        return
    if seconds is None or seconds > MAX_SECONDS:
        text = element.attributes[attribute].strip()
        message = f"`{text}` is never a time of at most 24 hours; write {{2}}, {{'2s'}} or {{1500}}ms"
        reader.report_value("wrong-type", element, attribute, message)


def read_seconds(reader: ElementReader, element: Element, attribute: str) -> float | None:
    """Read a literal time; None, after a diagnostic, if it is invalid."""
    text = element.attributes[attribute]
    seconds = parse_time(text)
    if seconds is None:
        remedy = "write 500ms, 2s, 1.5s or 3min"
        if _NUMBER.match(text):
            remedy = f"write {text.strip()}ms or {text.strip()}s"
        reader.report_value("time", element, attribute, f"`{text}` is not a time; {remedy}")
        return None
    if MIN_SECONDS <= seconds <= MAX_SECONDS:
        return seconds
    at_once = seconds == 0 and attribute == "after"
    remedy = "; without `after` and with a condition, a transition is taken at once" if at_once else ""
    message = f"`{attribute}` is from 1ms to 24 hours (1440min); `{text.strip()[:40]}` is outside{remedy}"
    reader.report_value("out-of-range", element, attribute, message)
    return None


def _locate(reader: ElementReader, element: Element, attribute: str, start: int, index: int = 0) -> SourceLocation:
    return reader.file.value_location(element, attribute, start + index)
