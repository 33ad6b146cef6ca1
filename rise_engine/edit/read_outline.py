"""Reads what is written in a study's acts and rules, right or wrong (`outline.Outline`)."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.edit.content_cache import ContentCache
from rise_engine.edit.documents import NotXmlError, read_document
from rise_engine.edit.edits import CallForm, TransitionForm
from rise_engine.edit.expanded import Shown, Templates, expand, parameters_of
from rise_engine.edit.outline import (
    Outline,
    Span,
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
from rise_engine.edit.plan import Files
from rise_engine.scenario.acts import COMMON
from rise_engine.scenario.acts import WRAPPERS as ACT_WRAPPERS
from rise_engine.scenario.blocks import FUNCTIONS
from rise_engine.scenario.element_templates import PATTERNS
from rise_engine.scenario.file_names import DEFAULT_PATHS
from rise_engine.scenario.rules import WRAPPERS as RULE_WRAPPERS

_ID = re.compile(r"[^,;\s]+")


class _FileOutline(Struct, frozen=True):
    acts: tuple[WrittenAct, ...] = ()
    rules: tuple[WrittenRule, ...] = ()
    uses: tuple[WrittenUse, ...] = ()
    unreadable: str = ""


def read_outline(files: Files, paths: Mapping[str, str] | None = None) -> Outline:
    """All that is written in a study's acts and rules.

    :param files: the study's files; those of acts, of rules and of `patterns/` are read.
    :param paths: where acts and rules lie, as `Scenario.paths` says; without it, where they usually do.

    Never raises: a file that is no XML is in `Outline.unreadable`. What has not changed since the last call is not read
    again.
    """
    paths = {**DEFAULT_PATHS, **(paths or {})}
    names = {kind: written_files(files, paths[kind]) for kind in ("acts", "rules")}
    own = tuple(files[name] for kind in names for name in names[kind] if b"<Template" in files[name])
    patterns = tuple(
        (posixpath.splitext(posixpath.basename(name))[0], files[name])
        for name in sorted(files)
        if posixpath.dirname(name) == PATTERNS and name.endswith(".xml")
    )
    templates = _templates(own, patterns)
    read = [(name, _outline_of(kind == "acts", name, files[name], templates)) for kind in names for name in names[kind]]
    return Outline(
        tuple(act for _, found in read for act in found.acts),
        tuple(rule for _, found in read for rule in found.rules),
        tuple(use for _, found in read for use in found.uses),
        {name: found.unreadable for name, found in read if found.unreadable},
    )


def written_files(files: Files, path: str) -> list[str]:
    """The XML files of a folder in the order of their names, or the one file that is named."""
    path = posixpath.normpath(path)
    if path in files:
        return [path]
    folder = "" if path == "." else path
    names = (name for name in files if posixpath.dirname(name) == folder and name.lower().endswith(".xml"))
    return sorted(name for name in names if not posixpath.basename(name).startswith("."))


@lru_cache(maxsize=8)
def _templates(own: tuple[bytes, ...], patterns: tuple[tuple[str, bytes], ...]) -> Templates:
    return Templates(own, dict(patterns))


_OUTLINES: ContentCache[_FileOutline] = ContentCache()


def _outline_of(has_acts: bool, name: str, data: bytes, templates: Templates) -> _FileOutline:
    key = has_acts, name, data, templates
    return _OUTLINES.get(key, len(data), lambda: _read_file(has_acts, name, data, templates))


def _read_file(has_acts: bool, name: str, data: bytes, templates: Templates) -> _FileOutline:
    try:
        document = read_document(data)
    except NotXmlError as error:
        return _FileOutline(unreadable=str(error))
    root = expand(document, templates)
    tag, wrappers = ("Dialog", ACT_WRAPPERS) if has_acts else ("InteractionRule", RULE_WRAPPERS)
    parts = [root] if root.tag == tag else list(root.contents()) if root.tag in wrappers else []
    parts = [part for part in parts if part.tag == tag]
    return _FileOutline(
        tuple(_read_act(part, name) for part in parts) if has_acts else (),
        () if has_acts else tuple(_read_rule(part, name) for part in parts),
        tuple(_uses(root, name, templates)),
    )


def _uses(root: Shown, file: str, templates: Templates) -> Iterator[WrittenUse]:
    rest = [root]
    while rest:
        shown = rest.pop()
        if shown.tag != "use":
            rest += shown.children[::-1]
            continue
        node, template = shown.node, templates.find(shown.get("template"))
        values = {
            name: WrittenValue(node.attributes[name], Span(each.value_start, each.value_end))
            for name, each in node.written_attributes().items()
            if name != "template"
        }
        parameters = {} if template is None else parameters_of(template)
        yield WrittenUse(shown.get("template"), values, parameters, file, _span(shown), node.line)


def _span(shown: Shown) -> Span:
    return Span(shown.node.start, shown.node.end)


def _from_template(shown: Shown) -> str:
    return f"it comes from the template `{shown.template}`, used here" if shown.call is not None else ""


# --- acts -----------------------------------------------------------------------------------------------------------


def _read_act(shown: Shown, file: str) -> WrittenAct:
    return WrittenAct(
        shown.get("name"),
        tuple(_read_action(child) for child in shown.contents()),
        file,
        _span(shown),
        shown.line,
        _from_template(shown),
        shown.template,
        shown.attribute_parameter("name"),
    )


def _read_action(shown: Shown) -> WrittenAction:
    common: dict[str, Shown] = {}
    for child in shown.children:
        if child.tag in COMMON:
            common.setdefault(child.tag, child)
    is_variants = shown.tag == "Variants"
    calls = [child for child in shown.children if child.tag not in COMMON] if is_variants else [shown]
    texts = {name: child.text.strip() for name, child in common.items()}
    return WrittenAction(
        texts.get("actionID", ""),
        tuple(_read_call(call) for call in calls),
        tuple(dict.fromkeys(_ID.findall(texts.get("waitForActions", "")))),
        texts.get("onFailure") == "continue",
        _span(shown),
        shown.line,
        is_variants,
        _from_template(shown),
    )


def _read_call(shown: Shown) -> WrittenCall:
    parameters: dict[str, WrittenValue] = {}
    for child in shown.children:
        if child.tag in COMMON:
            continue
        if child.tag in parameters:
            reason = parameters[child.tag].reason or "it stands here twice"
            parameters[child.tag] = replace(parameters[child.tag], reason=reason)
        else:
            parameters[child.tag] = _read_value(child)
    return WrittenCall(shown.tag, _span(shown), parameters)


def _read_value(shown: Shown) -> WrittenValue:
    """A parameter's text, as the reader of acts takes it."""
    node = shown.origin
    is_markup = len(node.children) == 1 and node.children[0].tag == "speak" and node.tag == "message"
    if is_markup:
        text = node.children[0].written().decode()
        text = text if shown.call is None else shown.call.fill(text)
    else:
        text = shown.text.strip()
    if "\n" in text or "\r" in text:
        text = " ".join(text.split())
    if shown.call is not None:
        parameter = "" if node.children else shown.text_parameter()
        return WrittenValue(text, _span(shown), _from_template(shown), parameter)
    return WrittenValue(text, Span(*node.text_span()), "" if is_markup else node.text_obstacle())


# --- rules ----------------------------------------------------------------------------------------------------------


def _read_rule(shown: Shown, file: str) -> WrittenRule:
    states: list[WrittenState] = []
    shared: dict[str, list[WrittenTransition]] = {}
    for child in shown.contents():
        if child.tag == "State":
            states.append(_read_state(child))
        elif child.tag == "transitions":
            names = tuple(dict.fromkeys(name.strip() for name in child.get("in").split("|") if name.strip()))
            ways = [_read_transition(each, names) for each in child.contents() if each.tag == "transition"]
            for name in names:
                shared.setdefault(name, []).extend(ways)
    for index, state in enumerate(states):
        if ways := shared.pop(state.id, []):
            states[index] = replace(state, transitions=(*state.transitions, *ways))
    priority = shown.attributes.get("priority")
    return WrittenRule(
        shown.get("name"),
        shown.get("initial"),
        priority,
        tuple(states),
        file,
        _span(shown),
        shown.line,
        _from_template(shown),
        shown.template,
        shown.attribute_parameter("name"),
    )


def _read_state(shown: Shown) -> WrittenState:
    blocks: dict[str, tuple[WrittenStatement, ...]] = {"onEntry": (), "onExit": ()}
    ways: list[WrittenTransition] = []
    for child in shown.contents():
        if child.tag == "transition":
            ways.append(_read_transition(child))
        elif child.tag in blocks:
            blocks[child.tag] += read_statements(child)
    return WrittenState(
        shown.get("id"),
        blocks["onEntry"],
        blocks["onExit"],
        tuple(ways),
        _span(shown),
        shown.line,
        _from_template(shown),
        shown.template,
    )


def transition_form(attributes: Mapping[str, str]) -> TransitionForm:
    """A way out as its form has it."""

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


def _read_transition(shown: Shown, shared_by: tuple[str, ...] = ()) -> WrittenTransition:
    form = transition_form(shown.attributes)
    return WrittenTransition(form, read_statements(shown), _span(shown), shown.line, shared_by, _from_template(shown))


# --- statements -----------------------------------------------------------------------------------------------------

_Branches: TypeAlias = list[WrittenBranch]


class _Block(list[WrittenStatement]):
    """Statements in the making; the last may be an `if` that goes on behind itself."""

    later: _Branches
    """Branches that belong to the `if` in which these statements stand."""

    def __init__(self) -> None:
        super().__init__()
        self.later = []


def read_statements(shown: Shown) -> tuple[WrittenStatement, ...]:
    """What stands in `onEntry`, `onExit` or `transition`."""
    return tuple(_read_block(shown, chain=False))


def _read_block(shown: Shown, *, chain: bool) -> _Block:
    """As `BlockReader.read_statements` reads it: with `chain`, an `else` belongs to the `if` around it."""
    block, follows_if = _Block(), False
    children = shown.children if shown.call is None else shown.contents()
    for child in _without_brought_branches(children):
        if child.tag in ("else", "elseif"):
            if chain:
                block.later += _read_branches(child)
            elif follows_if:
                before, branches = block[-1], _read_branches(child)
                span = Span(before.span.start, max(before.span.end, child.node.end))
                block[-1] = replace(before, branches=(*before.branches, *branches), span=span)
            else:
                block.append(WrittenStatement(_span(child), child.line, reason=f"`<{child.tag}>` has no `<if>` before"))
            follows_if = follows_if and not chain
            continue
        follows_if = child.tag == "if"
        block.append(_read_statement(child))
    return block


def _without_brought_branches(children: list[Shown] | Iterator[Shown]) -> Iterator[Shown]:
    """A `<use>` that brings branches is not a statement, but those."""
    for child in children:
        if child.tag == "use" and (inner := list(child.contents())) and inner[0].tag in ("else", "elseif"):
            yield from inner
        else:
            yield child


def _read_branches(shown: Shown) -> _Branches:
    block = _read_block(shown, chain=shown.tag != "else")
    condition = None if shown.tag == "else" else shown.get("cond")
    return [WrittenBranch(condition, tuple(block), _span(shown), shown.line, _from_template(shown)), *block.later]


def _read_statement(shown: Shown) -> WrittenStatement:
    span, line, reason = _span(shown), shown.line, _from_template(shown)
    if shown.tag == "function":
        call, problem = read_call(shown.attributes)
        return WrittenStatement(span, line, call=call, reason=reason or problem)
    if shown.tag == "if":
        return WrittenStatement(span, line, branches=tuple(_read_branches(shown)), reason=reason)
    if shown.tag == "oneOf":
        return WrittenStatement(span, line, choices=tuple(_read_block(shown, chain=False)), reason=reason)
    if shown.tag == "use":
        name = shown.get("template")
        brings = tuple(_read_block(shown, chain=False))
        problem = f"the template `{name}` brings it" if brings else f"nothing comes of the template `{name}`"
        return WrittenStatement(span, line, reason=problem, template=name, brings=brings)
    return WrittenStatement(span, line, reason=f"`<{shown.tag}>` is no statement of a rule")


def read_call(attributes: Mapping[str, str]) -> tuple[CallForm | None, str]:
    """A function as its form has it, and why it cannot be changed there."""
    names = [name for name in FUNCTIONS if name in attributes]
    if not names:
        return None, "it names no function that there is"
    form = CallForm(
        names[0],
        attributes[names[0]].strip(),
        state=attributes["state"].strip() if "state" in attributes else None,
        enter=attributes.get("enter", "yes").strip() != "no",
        keep=attributes["keep"].strip() if "keep" in attributes else None,
    )
    return form, "it names two functions" if len(names) > 1 else ""
