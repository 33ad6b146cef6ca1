"""Where in a study stands what an edit names; what it cannot change is refused with the reason."""

from __future__ import annotations

from typing import NoReturn

from rise_engine.author.edit.outline import Written, WrittenAct, WrittenAction, WrittenRule, WrittenState
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_state import StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.uses import UsedKind
from rise_engine.scenario.xml import XmlFile, count_places

_SHOWN = 5
"""Places that a sentence names."""


def xml_of(study: StudyState, file: str) -> XmlFile:
    """A file of acts or rules. :raises EditRefused: it is not there, or no XML."""
    if file not in study.files:
        raise EditRefused(f"there is no file `{file}`{did_you_mean(file, list(study.files))}")
    parts = study.checked.parts
    for each in (*parts.acts, *parts.rules):
        if each.source.name == file:
            return each
    problem = parts.unreadable.get(file, "it is not one of those that hold acts or rules")
    raise EditRefused(f"{file} cannot be changed here while it is no XML: {problem}")


def places_of_parameter(study: StudyState, use: Written, parameter: str) -> int:
    """In how many places of what comes of a `<use>` a parameter of it stands."""
    return count_places(xml_of(study, use.file).brought.get(use.node, ()), parameter)


def act_of(study: StudyState, name: str) -> WrittenAct:
    """An act by its name. :raises EditRefused: there is none."""
    act = study.outline.act(name)
    if act is None:
        refuse_unknown(study, "act", name, [each.name for each in study.outline.acts])
    return act


def rule_of(study: StudyState, name: str) -> WrittenRule:
    """A rule by its name. :raises EditRefused: there is none."""
    rule = study.outline.rule(name)
    if rule is None:
        refuse_unknown(study, "rule", name, [each.name for each in study.outline.rules])
    return rule


def refuse_unknown(study: StudyState, kind: str, name: str, known: list[str]) -> NoReturn:
    """:raises EditRefused: there is no such thing; files that cannot be read are named, it may be in one of them."""
    unread = "".join(f"; {file} cannot be read now" for file in study.outline.unreadable)
    raise EditRefused(f"there is no {kind} `{name}`{did_you_mean(name, known)}{unread}")


def state_of(study: StudyState, rule: str, name: str) -> tuple[WrittenRule, WrittenState]:
    """A rule and the first of its states with a name. :raises EditRefused: there is none."""
    found = rule_of(study, rule)
    state = next((each for each in found.states if each.id == name), None)
    if state is None:
        known = [each.id for each in found.states]
        raise EditRefused(f"there is no state `{name}` in the rule `{rule}`{did_you_mean(name, known)}")
    return found, state


def action_of(study: StudyState, act: str, name: str) -> tuple[WrittenAct, WrittenAction]:
    """An act and its action with an actionID. :raises EditRefused: there is none."""
    found = act_of(study, act)
    action = next((each for each in found.actions if each.id == name), None)
    if action is None:
        known = [each.id for each in found.actions if each.id]
        raise EditRefused(f"there is no action `{name}` in the act `{act}`{did_you_mean(name, known)}")
    return found, action


def check_changeable(what: str, reason: str, file: str = "", line: int = 0) -> None:
    """:raises EditRefused: a form cannot change it, and why; in which line it stands, if that is given."""
    if reason:
        where = f" ({file}, line {line})" if file else ""
        raise EditRefused(f"{what} cannot be changed: {reason}{where}")


def check_name(kind: str, name: str) -> str:
    """A new name without blanks around it. :raises EditRefused: it is empty, or cannot be shown."""
    name = name.strip()
    if not name:
        raise EditRefused(f"the {kind} needs a name")
    if not name.isprintable():
        raise EditRefused(f"the name of the {kind} holds a character that cannot be shown; leave it out")
    return name


def still_named(study: StudyState, kind: UsedKind, name: str, *, within: str = "") -> tuple[str, ...]:
    """Where something that goes is named elsewhere, in a sentence; nothing when it is nowhere.

    :param within: the act or rule that goes, or in which it stands: what stands there is not counted.
    """
    uses = study.checked.uses.of(kind, name)
    places = [
        f"{use.where} ({use.location.file}, line {use.location.line})"
        for use in uses
        if not use.defines and use.of != within
    ]
    if not places:
        return ()
    more = f" and {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
    return (f"`{name}` is still named in {'; '.join(places[:_SHOWN])}{more}",)
