"""Fixes for diagnostics, as edits: for quick fixes in editors and the list of diagnostics in the terminal.

A remedy is one edit, like a form's. The code of the diagnostic determines the remedies: see `_REMEDIES`, and
`written_remedies.WRITTEN` for those that change the text at its place. Only possible edits are offered, and none that
need an author's answer.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from string import ascii_lowercase, ascii_uppercase, digits

from msgspec import UNSET, Struct
from msgspec.structs import replace

from rise_engine.author.edit.edits import (
    AddAct,
    AddRule,
    AddState,
    AnyEdit,
    MoveTransition,
    RemoveAct,
    RemoveState,
    RemoveTransition,
    Rename,
    RenameSetting,
    SetInitial,
    SetParameter,
    SetSetting,
    SetStartValue,
    SetTransition,
    SetTranslation,
    SetUseParameter,
    SetWaits,
)
from rise_engine.author.edit.memory import value_text
from rise_engine.author.edit.plan import EditRefused, StudyState
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.written_remedies import WRITTEN, FindingPlace, StateTransition, place_of
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.syntax.toml import KeyPath, toml_path_at

_NO_LETTER = re.compile(r"[^\w.]+")
_LABEL = re.compile(r"""[^\r\n]*?label\s*=\s*["']([^"'\r\n]*)""")
_FIRST_STATE = "Start"
_MAX_KEYS = 2
"""Maximum number of free keys that are offered."""
_START_VALUES: tuple[bool | int | str, ...] = (0, False, "")


class Remedy(Struct, frozen=True):
    """An edit that resolves a diagnostic."""

    title: str
    """Its effect, for a list: "make the act R_Yes"."""
    edit: AnyEdit
    is_likely: bool = False
    """Whether the author probably meant it; only the first of several can be likely."""


def remedies(finding: Diagnostic, study: StudyState) -> list[Remedy]:
    """Return the remedies for a diagnostic, the likeliest first; empty: it needs the author's own words.

    :param finding: one of `study.checked.diagnostics`.
    :param study: the study in its present state.
    """
    place = place_of(finding, study)
    if place is None:
        return []
    found: dict[str, Remedy] = {}
    for each in _proposed(place):
        if each.title not in found and _can_be_made(each.edit, study):
            found[each.title] = each
    return list(found.values())


def _can_be_made(edit: AnyEdit, study: StudyState) -> bool:
    try:
        planned = plan(edit, study)
    except EditRefused:
        return False
    return bool(planned.splices or planned.written)


def _proposed(place: FindingPlace) -> Iterator[Remedy]:
    for read in WRITTEN:
        found = list(read(place))
        for title, edit in found:
            yield Remedy(title, edit, is_likely=len(found) == 1)
    find = _REMEDIES.get(place.finding.code)
    if find is not None:
        yield from find(place)


# --- names ----------------------------------------------------------------------------------------------------------


def _make_act(place: FindingPlace) -> Iterator[Remedy]:
    use = place.use("act")
    if use is not None and use.name not in place.study.checked.draft.rules:
        yield Remedy(f"make the act {use.name}", AddAct(use.name))


def _make_rule(place: FindingPlace) -> Iterator[Remedy]:
    use = place.use("rule")
    if use is not None and use.name not in place.study.checked.draft.acts:
        yield Remedy(f"make the rule {use.name}", AddRule(use.name, _FIRST_STATE))


def _make_state(place: FindingPlace) -> Iterator[Remedy]:
    if (use := place.use("state")) is not None:
        rule, _, state = use.name.partition("/")
        yield Remedy(f"make the state {state} in the rule {rule}", AddState(rule, state))


def _give_start_value(place: FindingPlace) -> Iterator[Remedy]:
    if (use := place.use("key")) is not None:
        for value in _START_VALUES:
            yield Remedy(f"give {use.name} the start value {value_text(value)}", SetStartValue(use.name, value))


def _make_key_writable(place: FindingPlace) -> Iterator[Remedy]:
    try:
        key = json.loads(place.written)
    except ValueError:
        return
    if isinstance(key, str):
        new = _NO_LETTER.sub("_", key).strip("_.")
        yield Remedy(f"rename the key to {new}, everywhere", Rename("key", key, new), is_likely=True)


# --- acts -----------------------------------------------------------------------------------------------------------


def _remove_act(place: FindingPlace) -> Iterator[Remedy]:
    act = place.act
    if act is not None and all(use.defines for use in place.study.checked.uses.of("act", act.name)):
        yield Remedy(f"remove the act {act.name}, which nothing names", RemoveAct(act.name))


def _wait_for_others(place: FindingPlace) -> Iterator[Remedy]:
    found, use = place.action, place.use("action")
    if found is None or use is None:
        return
    (act, action), gone = found, use.name.partition("/")[2]
    left = tuple(each for each in action.wait_for if each != gone)
    yield Remedy(f"do not wait for {gone}", SetWaits(act.name, action.id, left))


def _remove_parameter(place: FindingPlace) -> Iterator[Remedy]:
    for use in place.study.outline.uses:
        if place.is_in(use) and place.written in use.values:
            edit = SetUseParameter(use.file, use.line, use.template, place.written, None)
            yield Remedy(f"remove {place.written}", edit)
            return
    found, name = place.action, place.written.strip("<>/ ")
    if found is None:
        return
    act, action = found
    for variant, call in enumerate(action.calls):
        if name in call.parameters and place.is_in(call):
            yield Remedy(f"remove {name}", SetParameter(act.name, action.id, name, None, variant))


# --- rules ----------------------------------------------------------------------------------------------------------


def _begin_rule(place: FindingPlace) -> Iterator[Remedy]:
    rule = place.rule
    if rule is not None and not rule.initial and rule.states and place.start == rule.node.start:
        first = rule.states[0].id
        yield Remedy(f"let {rule.name} begin in {first}", SetInitial(rule.name, first), is_likely=True)


def _make_reachable(place: FindingPlace) -> Iterator[Remedy]:
    """Offer remedies for a transition that is never taken."""
    transition = place.transition
    if transition is None:
        return
    form = transition.written.form
    earlier = place.finding.related
    if earlier is UNSET and form.ended is not None and len(form.outcomes) < 2:  # its rule does not start the act
        ending = form.outcomes[0] if form.outcomes else "end"
        heard = replace(form, ended=None, outcomes=(), event=f"/{form.ended}_{ending}")
        edit = SetTransition(transition.rule.name, transition.state.id, transition.index, form, heard)
        yield Remedy(f"wait for {heard.event}, whoever starts the act", edit, is_likely=True)
    if earlier is not UNSET and form.condition is not None:
        before = [index for index, each in enumerate(transition.state.transitions) if each.line == earlier.line]
        for index in before[:1]:
            title = f"try it before the transition in line {earlier.line}"
            yield Remedy(
                title,
                MoveTransition(transition.rule.name, transition.state.id, transition.index, form, index),
                is_likely=True,
            )
    yield _without(transition)


def _remove_transition(place: FindingPlace) -> Iterator[Remedy]:
    if (
        (transition := place.transition) is not None
        and transition.written.form.target is None
        and not transition.written.statements
    ):
        yield _without(transition)


def _without(transition: StateTransition) -> Remedy:
    edit = RemoveTransition(transition.rule.name, transition.state.id, transition.index, transition.written.form)
    return Remedy("remove this transition from the state", edit)


def _remove_state(place: FindingPlace) -> Iterator[Remedy]:
    rule = place.rule
    for state in rule.states if rule is not None else ():
        if rule is not None and state.node.start == place.start:
            yield Remedy(f"remove the state {state.id}", RemoveState(rule.name, state.id))


def _notice_failure(place: FindingPlace) -> Iterator[Remedy]:
    transition = place.transition
    event = transition.written.form.event if transition is not None else None
    if transition is not None and event is not None and event.endswith("_end"):
        form = transition.written.form
        heard = replace(form, event=f"{event.removesuffix('_end')}_succeeded")
        edit = SetTransition(transition.rule.name, transition.state.id, transition.index, form, heard)
        yield Remedy(f"wait for {heard.event}", edit)
    yield Remedy('ask the wizard: on_failure = "ask"', SetSetting(("on_failure",), "ask"))


# --- settings, translations -----------------------------------------------------------------------------------------


def _toml_path(place: FindingPlace) -> KeyPath | None:
    return toml_path_at(place.text, place.start) if place.file.endswith(".toml") else None


def _take_free_key(place: FindingPlace) -> Iterator[Remedy]:
    path = _toml_path(place)
    if path is None or len(path) != 2 or path[0] != "keys":
        return
    for key in _free_keys(place)[:_MAX_KEYS]:
        yield Remedy(f"use the key {key} instead", RenameSetting(path, key))


def _free_keys(place: FindingPlace) -> list[str]:
    """List unused keys, starting with letters of the label."""
    label = _LABEL.match(place.text, place.end)
    letters = [each for each in (label.group(1) if label else "").lower() if each in ascii_lowercase]
    taken = {_name_of_key(each) for each in tomllib.loads(place.text)["keys"]}
    candidates = dict.fromkeys([*letters, *ascii_lowercase, *digits, *ascii_uppercase])
    return [key for key in candidates if _name_of_key(key) not in {*taken, ""}]


def _name_of_key(written: str) -> str:
    """Return a key's name for comparison; empty: it cannot be used."""
    try:
        return bindable_key_name(written)
    except KeyRefusedError:
        return ""


def _remove_setting(place: FindingPlace) -> Iterator[Remedy]:
    path = _toml_path(place)
    if path is not None:
        yield Remedy(f"remove {path[-1]} from {place.file}", SetSetting(path, None, place.file))


def _keep_translation(place: FindingPlace) -> Iterator[Remedy]:
    language, path = place.file.rpartition("/")[2].removesuffix(".toml"), _toml_path(place)
    if path is None or len(path) < 2:
        return
    act, text = path[:2]
    value = tomllib.loads(place.text).get(act, {}).get(text, {}).get("text")
    if isinstance(value, str):
        yield Remedy(
            "the translation is still right: update `of` to the present text",
            SetTranslation(language, act, text, value),
        )


_REMEDIES: Mapping[str, Callable[[FindingPlace], Iterable[Remedy]]] = {
    "empty-act": _remove_act,
    "key-refused": _take_free_key,
    "key-taken": _take_free_key,
    "key-twice": _take_free_key,
    "missing-attribute": _begin_rule,
    "no-effect": _remove_transition,
    "stale-translation": _keep_translation,
    "unknown-act": _make_act,
    "unknown-id": _wait_for_others,
    "unknown-key": _remove_setting,
    "unknown-parameter": _remove_parameter,
    "unknown-rule": _make_rule,
    "unknown-state": _make_state,
    "unknown-text": _remove_setting,
    "unnoticed-failure": _notice_failure,
    "unreachable-state": _remove_state,
    "unreachable-transition": _make_reachable,
    "unset-key": _give_start_value,
    "unwritable-key": _make_key_writable,
}
"""The remedies for each code of diagnostics."""
