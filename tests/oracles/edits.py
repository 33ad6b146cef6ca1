"""Edits of every kind of the shipped studies, which are read with lxml alone: nothing of ours is believed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from lxml import etree

Edit: TypeAlias = dict[str, Any]
_TRIGGERS = ("eventTopic", "after", "cond", "while", "target")
_FORM = {"eventTopic": "event", "cond": "condition", "while": "held"}
_MAX_EDITS = 2
"""How many of a file's acts, and of a rule's states, are edited."""


def edits_of(folder: Path) -> Iterator[Edit]:
    """Edits of a study, in a fixed order; some cannot be made, which is to be said of them."""
    for path in sorted(folder.glob("acts/**/*.xml")):
        yield from _some(_named(path, "Dialog", "name"), _edits_of_act)
    for path in sorted(folder.glob("rules/**/*.xml")):
        for rule in _named(path, "InteractionRule", "name"):
            yield from _edits_of_rule(rule)
    yield from _edits_of_data(folder)


def _named(path: Path, tag: str, attribute: str) -> list[Any]:
    return [each for each in etree.parse(path).iter(tag) if "{" not in each.get(attribute, "{")]


def _some(found: list[Any], make: Callable[[Any], Iterator[Edit]]) -> Iterator[Edit]:
    for each in found[:: max(1, len(found) // _MAX_EDITS)][:_MAX_EDITS]:
        yield from make(each)


def _edits_of_act(act: Any) -> Iterator[Edit]:
    name = act.get("name")
    yield {"edit": "add_act", "name": "New & <first>", "text": 'Hello, it\'s "me".', "after": name}
    yield {"edit": "add_act", "name": "Own", "file": "acts/own.xml"}
    yield {"edit": "copy_act", "act": name, "name": f"{name} again"}
    yield {"edit": "remove_act", "act": name}
    yield {"edit": "rename", "kind": "act", "old": name, "new": "R_Renamed"}
    yield {"edit": "add_action", "act": name, "type": "Speech", "parameters": {"message": "Two\nlines & more"}}
    ids = [each.findtext("actionID", "") for each in act if isinstance(each.tag, str)]
    for element, id in zip([each for each in act if isinstance(each.tag, str)], ids, strict=True):
        at = {"act": name, "action": id}
        parts = [each for each in element if each.tag not in ("actionID", "waitForActions", "onFailure")]
        for parameter in parts[:2]:
            yield {"edit": "set_parameter", **at, "parameter": parameter.tag, "value": "Grün & <b>"}
            yield {"edit": "set_parameter", **at, "parameter": parameter.tag, "value": None}
        yield {"edit": "set_waits", **at, "wait_for": [other for other in ids if other != id][:2]}
        yield {"edit": "set_waits", **at, "wait_for": []}
        yield {"edit": "set_action_failure", **at, "continues": True}
        yield {"edit": "set_action_type", **at, "type": "Wait"}
        yield {"edit": "add_variant", **at, "parameters": {"message": "Or this"}}
        yield {"edit": "remove_variant", **at, "variant": 0}
        yield {"edit": "remove_action", **at}
        yield {"edit": "add_action", "act": name, "type": "Wait", "parameters": {"duration": "100"}, "after": id}
    if ids:
        yield {"edit": "rename", "kind": "action", "old": f"{name}/{ids[0]}", "new": "77"}


def _edits_of_rule(rule: Any) -> Iterator[Edit]:
    name = rule.get("name")
    yield {"edit": "add_rule", "name": "New rule", "initial": "Begin"}
    yield {"edit": "add_rule", "name": "Behind", "initial": "Begin", "after": name}
    yield {"edit": "copy_rule", "rule": name, "name": f"{name} again"}
    yield {"edit": "remove_rule", "rule": name}
    yield {"edit": "set_priority", "rule": name, "priority": "3"}
    yield {"edit": "rename", "kind": "rule", "old": name, "new": "Renamed"}
    yield from _some(
        [each for each in rule.iter("State") if each.get("id")], lambda state: _edits_of_state(name, state)
    )


def _form(transition: Any) -> Edit:
    return {_FORM.get(each, each): transition.get(each) for each in _TRIGGERS if transition.get(each) is not None}


def _edits_of_state(rule: str, state: Any) -> Iterator[Edit]:
    id = state.get("id")
    at = {"rule": rule, "state": id}
    form = {"event": "hey", "condition": "1 < 2 && 'a' = 'b'", "target": id}
    yield {"edit": "set_initial", **at}
    yield {"edit": "add_state", "rule": rule, "state": "After <all>", "after": id}
    yield {"edit": "remove_state", **at}
    yield {"edit": "rename", "kind": "state", "old": f"{rule}/{id}", "new": "Renamed"}
    yield {"edit": "add_transition", **at, "transition": form}
    yield {"edit": "add_transition", **at, "transition": {"after": "2s", "held": "1 < 2", "target": id}, "at": 0}
    for number, transition in enumerate(state.findall("transition")[:2]):
        if transition.get("ended") is None:
            here = {**at, "index": number, "was": _form(transition)}
            yield {"edit": "set_transition", **here, "transition": form}
            yield {"edit": "remove_transition", **here}
            yield {"edit": "move_transition", **here, "to": 1 - number}
        if transition.get("eventTopic"):
            yield {"edit": "rename", "kind": "event", "old": transition.get("eventTopic"), "new": "/renamed"}
        yield from _edits_of_statement({**at, "place": "transition", "transition": number, "path": [0]})
    for place in ("onEntry", "onExit"):
        yield from _edits_of_statement({**at, "place": place, "path": [0]})


def _edits_of_statement(at: Edit) -> Iterator[Edit]:
    call = {"statement": "call", "function": "raiseEventTopic", "argument": "go", "keep": "2s"}
    branches = [{"condition": "1 < 2", "statements": [call]}, {"condition": None}]
    inner = {**at, "path": [0, 0]}
    yield {"edit": "add_statement", "at": at, "statement": call}
    yield {"edit": "add_statement", "at": at, "statement": {"statement": "if", "branches": branches}}
    yield {"edit": "add_statement", "at": at, "statement": {"statement": "oneOf", "choices": [call, call]}}
    yield {"edit": "set_call", "at": at, "call": call}
    yield {"edit": "move_statement", "at": at, "to": 1}
    yield {"edit": "remove_statement", "at": at}
    yield {"edit": "add_branch", "at": inner, "condition": "2 < 3"}
    yield {"edit": "set_branch_condition", "at": inner, "condition": "2 < 3"}


def _edits_of_data(folder: Path) -> Iterator[Edit]:
    for key in list(json.loads((folder / "memory.json").read_text("utf-8")))[:3]:
        yield {"edit": "set_start_value", "key": key, "value": {"a": [1, "ä", None]}}
        yield {"edit": "remove_start_value", "key": key}
        yield {"edit": "rename", "kind": "key", "old": key, "new": "renamed_key"}
    yield {"edit": "set_start_value", "key": "new_key", "value": 0.5}
    yield {"edit": "set_setting", "path": ["title"], "value": 'Another "title"'}
    yield {"edit": "set_setting", "path": ["act", "New", "filler"], "value": True}
    yield {"edit": "set_setting", "path": ["keys"], "value": None}
    yield {"edit": "set_setting", "path": ["keys", "ö"], "value": {"event": "/go", "label": "Go"}}
    yield {"edit": "rename_setting", "path": ["title"], "name": "titel"}
    yield {"edit": "add_language", "language": "fr"}
    yield {"edit": "replace_file", "file": "notes.md", "text": "ä\n"}
    yield {"edit": "replace_file", "file": "../notes.md", "text": "x"}
    for path in sorted(folder.glob("tables/*.csv")):
        table, columns = path.stem, path.read_text("utf-8").splitlines()[0].split(",")
        yield {"edit": "set_cell", "table": table, "row": 0, "column": columns[-1], "value": 'a "b", c'}
        yield {"edit": "add_row", "table": table, "values": {columns[0]: "new"}, "at": 1}
        yield {"edit": "remove_row", "table": table, "row": 0}
        yield {"edit": "add_column", "table": table, "column": "more"}
    for path in sorted(folder.glob("texts/*.toml")):
        act = _named(min(folder.glob("acts/**/*.xml")), "Dialog", "name")[0].get("name")
        yield {"edit": "set_translation", "language": path.stem, "act": act, "text": "1", "value": 'Says "this"'}
    for path in sorted(folder.glob("**/*.xml")):
        for use in list(etree.parse(path).iter("use"))[:3]:
            file = path.relative_to(folder).as_posix()
            parameter = next(each for each in use.attrib if each != "template")
            at = {"file": file, "line": use.sourceline, "template": use.get("template"), "parameter": parameter}
            yield {"edit": "set_use_parameter", **at, "value": "a < b & c"}
