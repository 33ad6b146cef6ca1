"""Uses of names in a scenario: of acts, rules, states, events, memory keys and actions, with their places.

This module finds those in files of acts and rules, even in files with errors.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property, partial
from typing import Literal, TypeAlias

from msgspec import UNSET, Struct

from rise_engine.expression.key_places import KeyPlace, keys_in_assignment, keys_in_expression, keys_in_slots
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.scenario.grammar import COMMON, form_of
from rise_engine.scenario.model import RobotProfile, SourceLocation, normal_topic
from rise_engine.scenario.parameters import is_bare_key
from rise_engine.scenario.reading.element_reader import computed_part
from rise_engine.syntax.xml import ENTITY, Element, read_entity

UsedKind: TypeAlias = Literal["act", "rule", "state", "event", "key", "action"]
"""A state is `RULE/STATE` here, an action `ACT/ID`. Events have no slash; a key is a memory key."""


class Use(Struct, frozen=True):
    """A place where a name is used."""

    kind: UsedKind
    name: str
    location: SourceLocation
    """The first character of the name. For a name from a template: the `<use>`, with the template's place."""
    length: int
    """Characters of the name in the file, with entities; 0: the name is composed of several pieces."""
    defines: bool
    """Whether this place defines the name (like a key's start value), or only uses it."""
    where: str
    """The place without the name, for a list: "rule Table setting, state Start, on entry", "key 2"."""
    of: str = ""
    """The name of the act or rule that contains it; empty: another place."""
    in_template: bool = False
    """Whether the name is written in the template (`place`), not in the `<use>`."""

    may_be_text: bool = False
    """Whether it is the only word on the right of an assignment: a key if the scenario has it, else a text."""

    @property
    def place(self) -> SourceLocation:
        """The place of the name itself: in the template's file, unless the `<use>` contains the name."""
        template = self.location.template
        place = template if self.in_template and template is not UNSET else self.location
        return SourceLocation(place.file, place.line, place.column)


class Uses:
    """All uses of a scenario, by kind and name, searched on demand."""

    def __init__(self, uses: Iterable[Use]) -> None:
        self._uses = uses

    def of(self, kind: UsedKind, name: str) -> list[Use]:
        """The uses of a name in reading order, definitions first."""
        return self._by_name.get((kind, name), [])

    def names(self, kind: UsedKind) -> list[str]:
        """All names of a kind that are defined or used, sorted."""
        return sorted(name for known, name in self._by_name if known == kind)

    def at(self, file: str, line: int, column: int) -> Use | None:
        """The use at a character of a file, or directly before it, for "go to the definition"."""
        for use in self._by_line.get((file, line), []):
            if 0 <= column - use.place.column <= use.length:
                return use
        return None

    @cached_property
    def _by_name(self) -> dict[tuple[UsedKind, str], list[Use]]:
        found: dict[tuple[UsedKind, str], list[Use]] = {}
        for use in sorted(self._uses, key=_order):
            found.setdefault((use.kind, use.name), []).append(use)
        return found

    @cached_property
    def _by_line(self) -> dict[tuple[str, int], list[Use]]:
        found: dict[tuple[str, int], list[Use]] = {}
        for uses in self._by_name.values():
            for use in uses:
                if use.length:
                    found.setdefault((use.place.file, use.place.line), []).append(use)
        return found


def _order(use: Use) -> tuple[bool, str, int, int]:
    return not use.defines, use.location.file, use.location.line, use.location.column


# --- uses in acts and rules -------------------------------------------------------------------------------------------


Sources = Mapping[str, SourceFile]
"""By name. Templates may be in other files than their `<use>`."""
_ID = re.compile(r"[^,;\s]+")
_PART = re.compile(r"[^|]+")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


def written_length(text: str, offset: int, name: str) -> int:
    """The length of a name at an offset of an XML text, with entities; 0: another text is there.

    >>> written_length('x="a&amp;b"', 3, "a&b")
    7
    """
    at = offset
    for character in name:
        if (entity := ENTITY.match(text, at)) is not None and read_entity(entity.group()) == character:
            at = entity.end()
        elif text.startswith(character, at):
            at += 1
        else:
            return 0
    return at - offset


def uses_in_acts(file: XmlFile, robot: RobotProfile, sources: Sources) -> list[Use]:
    """The uses in a file of acts with its templates expanded."""
    finder = _UseFinder(file, sources)
    for element in _parts(file.root, "Dialog"):
        finder.find_in_act(element, robot)
    return finder.found


def uses_in_rules(file: XmlFile, sources: Sources) -> list[Use]:
    """The uses in a file of rules with its templates expanded."""
    finder = _UseFinder(file, sources)
    for element in _parts(file.root, "InteractionRule"):
        finder.find_in_rule(element)
    return finder.found


def _parts(root: Element, tag: str) -> Iterator[Element]:
    return (element for element in ([root] if root.tag == tag else root) if element.tag == tag)


class _UseFinder:
    def __init__(self, file: XmlFile, sources: Sources) -> None:
        self.file = file
        self.sources = sources
        self.found: list[Use] = []
        self.of = ""
        self.where = ""

    def add(
        self,
        kind: UsedKind,
        name: str,
        shown: str,
        location: SourceLocation,
        *,
        defines: bool = False,
        may_be_text: bool = False,
    ) -> None:
        """Add a use of `name` (`RULE/STATE`), which is written as `shown` (`STATE`)."""
        length = self.length_at(location.file, location.line, location.column, shown)
        in_template = False
        if not length and (template := location.template) is not UNSET:
            length = self.length_at(template.file, template.line, template.column, shown)
            in_template = length > 0
        use = Use(kind, name, location, length, defines, self.where, self.of, in_template, may_be_text)
        self.found.append(use)

    def length_at(self, file: str, line: int, column: int, name: str) -> int:
        source = self.sources.get(file)
        return written_length(source.text, source.offset(line, column), name) if source is not None else 0

    def add_keys(self, places: Iterable[KeyPlace], locate: Callable[[int], SourceLocation]) -> None:
        for place in places:
            self.add("key", place.key, place.key, locate(place.start), may_be_text=place.may_be_text)

    def add_attribute(
        self, kind: UsedKind, element: Element, attribute: str, of: str = "", *, defines: bool = False
    ) -> None:
        """Add the name that is the whole value of an attribute."""
        value = element.get(attribute)
        if value is None or not (name := normal_topic(value) if kind == "event" else value.strip()):
            return
        location = self.file.value_location(element, attribute, value.index(name))
        self.add(kind, f"{of}/{name}" if of else name, name, location, defines=defines)

    # --- acts ---------------------------------------------------------------------------------------------------------

    def find_in_act(self, element: Element, robot: RobotProfile) -> None:
        self.of = (element.get("name") or "").strip()
        self.where = f"act {self.of}"
        self.find_in_attributes(element)
        for action in element:
            common = {child.tag: child for child in action if child.tag in COMMON}
            id_element, wait = common.get("actionID"), common.get("waitForActions")
            id = id_element.text.strip() if id_element is not None else ""
            if id_element is not None and id:
                location = self.file.text_location(id_element, id_element.text.index(id))
                self.add("action", f"{self.of}/{id}", id, location, defines=True)
            self.where = f"act {self.of}, action {id or action.tag}"
            if wait is not None:
                for wanted in _ID.finditer(wait.text):
                    location = self.file.text_location(wait, wanted.start())
                    self.add("action", f"{self.of}/{wanted.group()}", wanted.group(), location)
            for call in [each for each in action if each.tag not in COMMON] if action.tag == "Variants" else [action]:
                self.find_in_call(call, robot)
            self.where = f"act {self.of}"

    def find_in_call(self, call: Element, robot: RobotProfile) -> None:
        spec = robot.actions.get(call.tag)
        where = self.where
        for child in call:
            if child.tag in COMMON:
                continue
            self.where = f"{where}: {child.tag}"
            parameter = spec.parameters.get(child.tag) if spec is not None else None
            text = child.text
            if parameter is not None and is_bare_key(parameter, text.strip()):
                key = text.strip()
                self.add("key", key, key, self.file.text_location(child, text.index(key)))
            elif len(child):  # SSML
                written = _COMMENT.sub(lambda found: " " * len(found.group()), self.file.written(child[0]))
                self.add_keys(keys_in_slots(written), partial(self.file.written_location, child[0]))
            else:
                self.add_keys(keys_in_slots(text), partial(self.file.text_location, child))
        self.where = where

    # --- rules --------------------------------------------------------------------------------------------------------

    def find_in_rule(self, element: Element) -> None:
        self.of = (element.get("name") or "").strip()
        top = self.where = f"rule {self.of}"
        self.find_in_attributes(element)
        for child in element:
            if child.tag == "State":
                inside = f"{top}, state {(child.get('id') or '').strip()}"
            elif child.tag == "transitions":
                self.where = inside = f"{top}, transitions of several states"
            else:
                continue
            self.find_in_attributes(child)
            number = 0
            for part in child:
                number += part.tag == "transition"
                names = {"onEntry": "on entry", "onExit": "on exit"}
                self.where = f"{inside}, {names.get(part.tag, f'transition {number}')}"
                self.find_in_statement(part)
            self.where = top

    def find_in_statement(self, element: Element) -> None:
        """Find uses in a transition, a block or a function, and in its contents."""
        rest = [element]
        while rest:
            each = rest.pop()
            rest += each[::-1]
            self.find_in_attributes(each)

    def find_in_attributes(self, element: Element) -> None:
        """Find the names in the attributes of an element, by their kind (`grammar`)."""
        forms = form_of(element.tag).attributes
        for name, value in element.attributes.items():
            if (form := forms.get(name)) is None:
                continue
            locate = partial(self.file.value_location, element, name)
            match form.holds:
                case "act" | "rule" | "event":
                    self.add_attribute(form.holds, element, name, defines=form.defines)
                case "state":
                    rule = (element.get(form.of) or "").strip() if form.of else self.of
                    self.add_attribute("state", element, name, rule, defines=form.defines)
                case "states":
                    for found in _PART.finditer(value):
                        if state := found.group().strip():
                            at = found.start() + found.group().index(state)
                            self.add("state", f"{self.of}/{state}", state, locate(at))
                case "expression":
                    self.add_keys(keys_in_expression(value), locate)
                case "assignment":
                    self.add_keys(keys_in_assignment(value), locate)
                case "delay" if (computed := computed_part(value)) is not None:
                    self.add_keys(keys_in_expression(*computed), locate)
