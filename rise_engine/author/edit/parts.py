"""Edits of whole acts and rules, and of the parameters of a `<use>`."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Mapping

from msgspec import Struct

from rise_engine.author.edit.addresses import act_of, check_changeable, check_name, remaining_mentions, rule_of, xml_of
from rise_engine.author.edit.edits import (
    AddAct,
    AddRule,
    CopyAct,
    CopyRule,
    Edit,
    RemoveAct,
    RemoveRule,
    SetUseParameter,
)
from rise_engine.author.edit.outline import WrittenAct, WrittenRule, WrittenUse
from rise_engine.author.edit.plan import EditRefused, Files, Plan, Splice, StudyState
from rise_engine.author.edit.translations import follow_act
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_layout import DEFAULT_UNIT, gap_behind, gap_in, has_own_lines, lead_start, removal, wrap
from rise_engine.syntax.xml_writing import ACT_WRAPPERS, RULE_WRAPPERS, NewElement, set_attributes, set_value


def plan_set_use(edit: SetUseParameter, study: StudyState) -> Plan:
    """Plan to change, add or remove a parameter of a `<use>`; without one, its default applies."""
    use = _use_of(edit, study)
    was = use.values.get(edit.parameter)
    if edit.parameter not in use.parameters and was is None:
        near = did_you_mean(edit.parameter, use.parameters)
        raise EditRefused(f"the template `{use.template}` has no parameter `{edit.parameter}`{near}")
    if edit.value is None and use.parameters.get(edit.parameter, "") is None:
        raise EditRefused(f"the template `{use.template}` needs `{edit.parameter}`; it has no default")
    if edit.value is None and was is None:
        return Plan()
    before = f" (was “{was.text}”)" if was is not None else ""
    words = "has its default" if edit.value is None else f"is “{edit.value}”"
    says = f"{edit.parameter} of the {use.template} in {use.file}, line {use.line}, {words}{before}"
    return plan_use_parameter(use.node, edit.parameter, edit.value, says)


def _use_of(edit: SetUseParameter, study: StudyState) -> WrittenUse:
    """Find the `<use>` at the line, or the nearest one of its template in the file."""
    xml_of(study, edit.file)
    uses = [use for use in study.outline.uses if use.file == edit.file and use.template == edit.template]
    if not uses:
        known = [use.template for use in study.outline.uses if use.file == edit.file]
        raise EditRefused(
            f"{edit.file} has no use of the template `{edit.template}`{did_you_mean(edit.template, known)}"
        )
    return min(uses, key=lambda use: abs(use.line - edit.line))


def plan_use_parameter(use: Element, parameter: str, value: str | None, says: str) -> Plan:
    """Plan the value of a parameter of this `<use>`."""
    splices = set_attributes(use, {parameter: value}, (*use.attributes, parameter))
    return Plan(tuple(splices), says=(says,)) if splices else Plan()


# --- acts and rules --------------------------------------------------------------------------------------------------


_NO_FILE_NAME = re.compile(r'[\s/\\:*?"<>|\x00-\x1f.]+')


class _Kind(Struct, frozen=True):
    """Acts or rules."""

    word: str
    tag: str
    wrapper: str
    wrappers: tuple[str, ...]
    place: str
    """The key of their folder in `Scenario.paths`."""


_ACTS = _Kind("act", "Dialog", "Dialogs", ACT_WRAPPERS, "acts")
_RULES = _Kind("rule", "InteractionRule", "InteractionRules", RULE_WRAPPERS, "rules")


# --- new acts and rules -------------------------------------------------------------------------------------------


def plan_add_act(edit: AddAct, study: StudyState) -> Plan:
    """Plan a new act after another, or at the end of a file."""
    name = _new_name(_ACTS, edit.name, study)
    speech = NewElement("Speech", children=(NewElement("actionID", text="1"), NewElement("message", text=edit.text)))
    element = NewElement("Dialog", {"name": name}, children=(speech,) if edit.text.strip() else ())
    file = edit.file or (act_of(study, edit.after).file if edit.after else _last_file_of_acts(study))
    says = f"new act {name}" + (f", which says “{edit.text.strip()}”" if edit.text.strip() else "")
    return _add(_ACTS, element, edit.after, file, study, says)


def plan_add_rule(edit: AddRule, study: StudyState) -> Plan:
    """Plan a new rule with its first state."""
    name = _new_name(_RULES, edit.name, study)
    initial = check_name("first state", edit.initial)
    states = (NewElement("State", {"id": initial}),)
    element = NewElement("InteractionRule", {"name": name, "initial": initial}, children=states)
    file = edit.file or (rule_of(study, edit.after).file if edit.after else _new_file(_RULES, name, study))
    return _add(_RULES, element, edit.after, file, study, f"new rule {name}, which begins in {initial}")


def _new_name(kind: _Kind, name: str, study: StudyState) -> str:
    name = check_name(kind.word, name)
    there = study.outline.act(name) if kind is _ACTS else study.outline.rule(name)
    if there is not None:
        raise EditRefused(
            f"the {kind.word} `{name}` is there already ({there.file}, line {there.line}); choose another name"
        )
    return name


def place_of(kind: str, study: StudyState) -> str:
    """Return the folder, or the single file, of a study's acts or rules."""
    scenario = study.checked.scenario
    if scenario is not None:
        return posixpath.normpath(scenario.paths[kind])
    parts: tuple[WrittenAct | WrittenRule, ...] = study.outline.acts if kind == "acts" else study.outline.rules
    return posixpath.dirname(parts[0].file) if parts else DEFAULT_PATHS[kind]


def _last_file_of_acts(study: StudyState) -> str:
    if study.outline.acts:
        return study.outline.acts[-1].file
    place = place_of("acts", study)
    names = [file.source.name for file in study.checked.parts.acts]
    return names[-1] if names else place if place.endswith(".xml") else f"{place}/acts.xml"


def _new_file(kind: _Kind, name: str, study: StudyState) -> str:
    """Choose a new file name after its content; or the single file, if there is only one."""
    place = place_of(kind.place, study)
    if place.lower().endswith(".xml"):
        return place
    base = _NO_FILE_NAME.sub("_", name.lower()).strip("_") or kind.word
    taken = {each.lower() for each in study.files}
    candidates = (f"{place}/{base}{ending}.xml" for ending in ("", *(f"_{number}" for number in range(2, 10_000))))
    return next(each for each in candidates if each.lower() not in taken)


def _add(kind: _Kind, element: NewElement, after: str, file: str, study: StudyState, says: str) -> Plan:
    file = posixpath.normpath(file)
    if file not in study.files:
        _check_new_file(kind, file, study)
        return Plan(written={file: new_file([element], kind.wrapper, study.files)}, says=(f"{says} ({file})",))
    if after:
        before = _part(kind, after, study)
        if before.file != file:
            raise EditRefused(f"the {kind.word} `{after}` is in {before.file}, not in {file}")
        return Plan((*_splices(kind, element, before.node, file, study),), says=(says,))
    return Plan((*_splices(kind, element, None, file, study),), says=(says,))


def _part(kind: _Kind, name: str, study: StudyState) -> WrittenAct | WrittenRule:
    return act_of(study, name) if kind is _ACTS else rule_of(study, name)


def _check_new_file(kind: _Kind, file: str, study: StudyState) -> None:
    place = place_of(kind.place, study)
    right = file == place or (posixpath.dirname(file) == place and file.lower().endswith(".xml"))
    if not right:
        example = place if place.lower().endswith(".xml") else f"{place}/NAME.xml"
        raise EditRefused(f"{kind.word}s in `{file}` would not be read; they belong in {example}")


def _splices(kind: _Kind, element: NewElement, sibling: Element | None, file: str, study: StudyState) -> list[Splice]:
    """Insert an act or a rule after another, or at the end of a file."""
    root = xml_of(study, file).tree.root
    if root.tag in kind.wrappers:
        last = sibling
        if last is None and root:
            last = next((each for each in root[::-1] if each.tag in (kind.tag, "use")), root[-1])
        gap = gap_in(root) if last is None else gap_behind(last, blank_line=True, alone_apart=True)
        return [gap.insert(element)]
    if root.tag != kind.tag:
        raise EditRefused(f"{file} holds `<{root.tag}>` and can hold no {kind.word}; choose another file")
    return wrap(root, kind.wrapper, element)


def new_file(elements: list[NewElement], wrapper: str, files: Files) -> bytes:
    """Write a new file of acts or rules with the line ends of the others."""
    line_end = next(("\r\n" for name, data in files.items() if name.endswith(".xml") and b"\r\n" in data), "\n")
    root = NewElement(wrapper, children=tuple(elements))
    if len(elements) == 1 and wrapper == _RULES.wrapper:
        root = elements[0]
    return (root.write("", DEFAULT_UNIT, line_end, flat=False) + line_end).encode()


# --- copying and removing -----------------------------------------------------------------------------------------


def plan_copy_act(edit: CopyAct, study: StudyState) -> Plan:
    """Plan a copy of an act after it, with its comments and its layout."""
    return _copy(_ACTS, edit.act, edit.name, study)


def plan_copy_rule(edit: CopyRule, study: StudyState) -> Plan:
    """Plan a copy of a rule after it, with its comments and its layout."""
    return _copy(_RULES, edit.rule, edit.name, study)


def _copy(kind: _Kind, old: str, new: str, study: StudyState) -> Plan:
    part = _part(kind, old, study)
    name = _new_name(kind, new, study)
    attribute = "name"
    if part.template:
        attribute = part.name_parameter
        if not attribute or _count_same_place(kind, part, study) > 1:
            raise EditRefused(
                f"`{old}` cannot be copied: {part.reason}, and its name is not a parameter of its own there"
            )
    node, splice = part.node, set_value(part.node, attribute, name)
    text = node.tree.text
    written = text[node.start : splice.start] + splice.text + text[splice.end : node.end]
    says = (f"new {kind.word} {name}, a copy of {old}",)
    if node.parent is None:
        return Plan(tuple(wrap(node, kind.wrapper, written)), says=says)
    return Plan((gap_behind(node, blank_line=True).put(written),), says=says)


def _count_same_place(kind: _Kind, part: WrittenAct | WrittenRule, study: StudyState) -> int:
    """Count the acts or rules with the same place: a template can make several."""
    parts: tuple[WrittenAct | WrittenRule, ...] = study.outline.acts if kind is _ACTS else study.outline.rules
    return sum(each.node is part.node for each in parts)


def plan_remove_act(edit: RemoveAct, study: StudyState) -> Plan:
    """Plan the removal of an act, and report the places that still name it."""
    return _remove(_ACTS, edit.act, study)


def plan_remove_rule(edit: RemoveRule, study: StudyState) -> Plan:
    """Plan the removal of a rule, and report the places that still name it."""
    return _remove(_RULES, edit.rule, study)


def _remove(kind: _Kind, name: str, study: StudyState) -> Plan:
    part = _part(kind, name, study)
    if part.template and _count_same_place(kind, part, study) > 1:
        check_changeable(f"`{name}`", f"{part.reason}, together with others")
    says = (f"the {kind.word} {name} is removed",)
    node = part.node
    noticed = remaining_mentions(study, "act" if kind is _ACTS else "rule", name, within=name)
    translations = follow_act(study, name, lambda _: None) if kind is _ACTS else ()
    if node.parent is None:
        return Plan(translations, written={part.file: None}, says=says, noticed=noticed)
    comment = (f"the comment above it in {part.file} stays",) if has_own_lines(node) and _has_lead(node) else ()
    return Plan((removal(node), *translations), says=says, noticed=(*noticed, *comment))


def _has_lead(node: Element) -> bool:
    return bool(node.tree.text[lead_start(node) : node.start].strip())


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    SetUseParameter: plan_set_use,
    AddAct: plan_add_act,
    CopyAct: plan_copy_act,
    RemoveAct: plan_remove_act,
    AddRule: plan_add_rule,
    CopyRule: plan_copy_rule,
    RemoveRule: plan_remove_rule,
}
