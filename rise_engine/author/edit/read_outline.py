"""Reads the written form of a study's acts and rules, right or wrong (`outline.Outline`)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from weakref import WeakKeyDictionary

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.edit.edits import CallForm, TransitionForm
from rise_engine.author.edit.outline import (
    Outline,
    WrittenAct,
    WrittenAction,
    WrittenBranch,
    WrittenCall,
    WrittenRule,
    WrittenState,
    WrittenStatement,
    WrittenTransition,
    WrittenUse,
    WrittenValue,
)
from rise_engine.scenario.files.xml import XmlFile, call_of, origin_of, text_pieces, written_here
from rise_engine.scenario.grammar import COMMON, FUNCTIONS
from rise_engine.scenario.loader import WrittenParts
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import ACT_WRAPPERS, RULE_WRAPPERS

_ID = re.compile(r"[^,;\s]+")


class _FileOutline(Struct, frozen=True):
    acts: tuple[WrittenAct, ...] = ()
    rules: tuple[WrittenRule, ...] = ()
    uses: tuple[WrittenUse, ...] = ()


_ACTS: WeakKeyDictionary[XmlFile, _FileOutline] = WeakKeyDictionary()
_RULES: WeakKeyDictionary[XmlFile, _FileOutline] = WeakKeyDictionary()
"""Outlines of files that still exist."""


def read_outline(parts: WrittenParts) -> Outline:
    """Read everything that a study's acts and rules contain.

    :param parts: the result of the study's check (`LoadResult.parts`). A file that is not XML goes into
        `Outline.unreadable`. Files that have not changed since the last call are not read again.
    """
    read = [_ACTS.get(file) or _read_file(file, parts, _ACTS) for file in parts.acts]
    read += [_RULES.get(file) or _read_file(file, parts, _RULES) for file in parts.rules]
    return Outline(
        tuple(act for found in read for act in found.acts),
        tuple(rule for found in read for rule in found.rules),
        tuple(use for found in read for use in found.uses),
        dict(parts.unreadable),
    )


def _read_file(file: XmlFile, parts: WrittenParts, known: WeakKeyDictionary[XmlFile, _FileOutline]) -> _FileOutline:
    has_acts = known is _ACTS
    tag, wrappers = ("Dialog", ACT_WRAPPERS) if has_acts else ("InteractionRule", RULE_WRAPPERS)
    root = file.root
    found = [each for each in ([root] if root.tag == tag else root if root.tag in wrappers else []) if each.tag == tag]
    known[file] = read = _FileOutline(
        tuple(map(_read_act, found)) if has_acts else (),
        () if has_acts else tuple(map(_RuleOutline(file).read, found)),
        tuple(_uses(file, parts.templates)),
    )
    return read


def _uses(file: XmlFile, templates: Mapping[str, Mapping[str, str | None]]) -> Iterator[WrittenUse]:
    rest = [file.tree.root]
    while rest:
        element = rest.pop()
        if element.tag == "use":
            values = {
                name: WrittenValue(value, node=element)
                for name, value in element.attributes.items()
                if name != "template"
            }
            template = _value(element, "template")
            yield WrittenUse(template, values, dict(templates.get(template, {})), node=element)
        elif element.tag != "Template":
            rest += element[::-1]


def _value(element: Element, name: str) -> str:
    """Return the value of an attribute without surrounding blanks; empty: there is none."""
    return element.attributes.get(name, "").strip()


def _template(element: Element) -> str:
    """Return the template of an element's `<use>`; empty: the file has the element itself."""
    return "" if call_of(element) is None else _value(written_here(element), "template")


def _where(element: Element) -> dict[str, Any]:
    """Return the element that represents this one in the file, and why a form cannot change it."""
    template = _template(element)
    reason = f"it comes from the template `{template}`, used here" if template else ""
    return {"node": written_here(element), "reason": reason}


def _parameter(element: Element, written: str) -> str:
    """Return the parameter of the `<use>` that is the whole of a text; empty: there is none."""
    call, pieces = call_of(element), text_pieces(written)
    if call is None or len(pieces) != 1 or (name := pieces[0].parameter) is None or name not in call.defaults:
        return ""
    outer = origin_of(call.use).attributes.get(name)
    return name if call_of(call.use) is None else "" if outer is None else _parameter(call.use, outer)


# --- acts -----------------------------------------------------------------------------------------------------------


def _read_act(element: Element) -> WrittenAct:
    return WrittenAct(
        _value(element, "name"),
        tuple(map(_read_action, element)),
        _template(element),
        _parameter(element, origin_of(element).attributes.get("name", "")),
        **_where(element),
    )


def _read_action(element: Element) -> WrittenAction:
    common: dict[str, str] = {}
    for child in element:
        if child.tag in COMMON:
            common.setdefault(child.tag, child.text.strip())
    is_variants = element.tag == "Variants"
    calls = [child for child in element if child.tag not in COMMON] if is_variants else [element]
    return WrittenAction(
        common.get("actionID", ""),
        tuple(map(_read_call, calls)),
        tuple(dict.fromkeys(_ID.findall(common.get("waitForActions", "")))),
        common.get("onFailure") == "continue",
        is_variants,
        **_where(element),
    )


def _read_call(element: Element) -> WrittenCall:
    parameters: dict[str, WrittenValue] = {}
    for child in element:
        if child.tag in parameters:
            reason = parameters[child.tag].reason or "it is given twice here"
            parameters[child.tag] = replace(parameters[child.tag], reason=reason)
        elif child.tag not in COMMON:
            parameters[child.tag] = _read_value(child)
    return WrittenCall(element.tag, parameters, **_where(element))


def _read_value(element: Element) -> WrittenValue:
    """Read a parameter's text like the reader of acts."""
    call, origin, where = call_of(element), origin_of(element), _where(element)
    is_markup = len(origin) == 1 and origin[0].tag == "speak" and origin.tag == "message"
    text = element.text.strip()
    if is_markup:
        text = origin[0].written if call is None else call.fill(origin[0].written)
    if "\n" in text or "\r" in text:
        text = " ".join(text.split())
    parameter = "" if origin else _parameter(element, origin.text.strip())
    if call is None and not is_markup:
        where["reason"] = origin.text_obstacle()
    return WrittenValue(text, parameter, **where)


# --- rules ----------------------------------------------------------------------------------------------------------


class _RuleOutline:
    """Reads the rules of a file."""

    def __init__(self, file: XmlFile) -> None:
        self.file = file

    def read(self, element: Element) -> WrittenRule:
        states: list[WrittenState] = []
        shared: dict[str, list[WrittenTransition]] = {}
        for child in element:
            if child.tag == "State":
                states.append(self.read_state(child))
            elif child.tag == "transitions":
                names = tuple(dict.fromkeys(name.strip() for name in _value(child, "in").split("|") if name.strip()))
                transitions = [self.read_transition(each, names) for each in child if each.tag == "transition"]
                for name in names:
                    shared.setdefault(name, []).extend(transitions)
        for index, state in enumerate(states):
            if transitions := shared.pop(state.id, []):
                states[index] = replace(state, transitions=(*state.transitions, *transitions))
        return WrittenRule(
            _value(element, "name"),
            _value(element, "initial"),
            element.get("priority"),
            tuple(states),
            _template(element),
            _parameter(element, origin_of(element).attributes.get("name", "")),
            **_where(element),
        )

    def read_state(self, element: Element) -> WrittenState:
        blocks: dict[str, tuple[WrittenStatement, ...]] = {"onEntry": (), "onExit": ()}
        transitions: list[WrittenTransition] = []
        for child in element:
            if child.tag == "transition":
                transitions.append(self.read_transition(child))
            elif child.tag in blocks:
                blocks[child.tag] += self.read_statements(child)
        return WrittenState(
            _value(element, "id"),
            blocks["onEntry"],
            blocks["onExit"],
            tuple(transitions),
            _template(element),
            **_where(element),
        )

    def read_transition(self, element: Element, shared_by: tuple[str, ...] = ()) -> WrittenTransition:
        form = transition_form(element.attributes)
        return WrittenTransition(form, self.read_statements(element), shared_by, **_where(element))

    def read_statements(self, element: Element) -> tuple[WrittenStatement, ...]:
        """Read the contents of `onEntry`, `onExit` or `transition`."""
        return tuple(self.read_block(self.inside(element), chain=False))

    def inside(self, element: Element) -> Iterable[Element]:
        """Yield the contents of an element; for an element of the file, a `<use>` instead of its result."""
        if call_of(element) is not None:
            yield from element
            return
        rest = iter(element)
        for child in origin_of(element):
            if child.tag == "use":
                for _ in self.file.brought.get(child, ()):
                    next(rest)
                yield child
            elif child.tag != "Template":
                yield next(rest)

    def read_block(self, inside: Iterable[Element], *, chain: bool) -> _Block:
        """Read a block like `BlockReader.read_statements`; with `chain`, an `else` belongs to the `if` around it."""
        block, follows_if = _Block(), False
        for child in self.with_brought_branches(inside):
            if child.tag in ("else", "elseif"):
                if chain:
                    block.later += self.read_branches(child)
                elif follows_if:
                    before, here = block[-1], written_here(child)
                    branches = (*before.branches, *self.read_branches(child))
                    behind = here if here.end > before.last.end else before.behind
                    block[-1] = replace(before, branches=branches, behind=behind)
                else:
                    reason = f"`<{child.tag}>` has no `<if>` before"
                    block.append(WrittenStatement(node=written_here(child), reason=reason))
                follows_if = follows_if and not chain
                continue
            follows_if = child.tag == "if"
            block.append(self.read_statement(child))
        return block

    def with_brought_branches(self, inside: Iterable[Element]) -> Iterator[Element]:
        """Replace a `<use>` that makes branches by those branches."""
        for child in inside:
            brought = self.file.brought.get(child) if child.tag == "use" else None
            if brought and brought[0].tag in ("else", "elseif"):
                yield from brought
            else:
                yield child

    def read_branches(self, element: Element) -> list[WrittenBranch]:
        block = self.read_block(self.inside(element), chain=element.tag != "else")
        condition = None if element.tag == "else" else _value(element, "cond")
        return [WrittenBranch(condition, tuple(block), **_where(element)), *block.later]

    def read_statement(self, element: Element) -> WrittenStatement:
        where = _where(element)
        if element.tag == "function":
            call, problem = read_call(element.attributes)
            return WrittenStatement(call, node=where["node"], reason=where["reason"] or problem)
        if element.tag == "if":
            return WrittenStatement(branches=tuple(self.read_branches(element)), **where)
        if element.tag == "oneOf":
            return WrittenStatement(choices=self.read_statements(element), **where)
        if element.tag == "use":
            name = _value(element, "template")
            brings = tuple(self.read_block(self.file.brought.get(element, ()), chain=False))
            reason = f"the template `{name}` brings it" if brings else f"nothing comes of the template `{name}`"
            return WrittenStatement(template=name, brings=brings, node=element, reason=reason)
        return WrittenStatement(node=where["node"], reason=f"`<{element.tag}>` is not a statement of a rule")


class _Block(list[WrittenStatement]):
    """Statements in progress; the last may be an `if` that continues after its own element."""

    def __init__(self) -> None:
        super().__init__()
        self.later: list[WrittenBranch] = []
        """Branches of the `if` that contains these statements."""


def transition_form(attributes: Mapping[str, str]) -> TransitionForm:
    """Return a transition in its form."""

    def text(name: str) -> str | None:
        return attributes[name].strip() if name in attributes else None

    outcomes = tuple(word.strip() for word in attributes.get("outcome", "").split("|") if word.strip())
    return TransitionForm(
        event=text("eventTopic"),
        ended=text("ended"),
        outcomes=outcomes,
        after=text("after"),
        held=text("while"),
        condition=text("cond"),
        target=text("target"),
    )


def read_call(attributes: Mapping[str, str]) -> tuple[CallForm | None, str]:
    """Return a function in its form, and why the form cannot change it."""
    names = [name for name in FUNCTIONS if name in attributes]
    if not names:
        return None, "it names no known function"
    form = CallForm(
        names[0],
        attributes[names[0]].strip(),
        state=attributes["state"].strip() if "state" in attributes else None,
        enter=attributes.get("enter", "yes").strip() != "no",
        keep=attributes["keep"].strip() if "keep" in attributes else None,
    )
    return form, "it names two functions" if len(names) > 1 else ""
