"""Edits of acts: their actions, waits, parameters and wordings."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence

from msgspec.structs import replace

from rise_engine.author.edit.addresses import act_of, action_of, check_changeable, places_of_parameter
from rise_engine.author.edit.edits import (
    AddAction,
    AddVariant,
    Edit,
    RemoveAction,
    RemoveVariant,
    SetActionFailure,
    SetActionType,
    SetParameter,
    SetWaits,
)
from rise_engine.author.edit.outline import WrittenAct, WrittenAction
from rise_engine.author.edit.parts import plan_use_parameter
from rise_engine.author.edit.plan import EditRefused, Plan, Splice, StudyState
from rise_engine.author.edit.translations import follow_act, follow_action
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.scenario.grammar import COMMON
from rise_engine.scenario.model import ActionSpec
from rise_engine.scenario.speech.spoken_texts import SpokenText, text_key
from rise_engine.syntax.changes import changed_text
from rise_engine.syntax.xml import Element, XmlSyntaxError, XmlTree
from rise_engine.syntax.xml_layout import (
    gap_before,
    gap_behind,
    gap_in,
    has_own_lines,
    indent_of,
    indent_unit,
    is_one_line,
    line_end_near,
    removal,
    removal_or_collapse,
    removals,
)
from rise_engine.syntax.xml_writing import NewElement, escape_text, one_line, set_text

_ID = re.compile(r"[^,;\s]+")


def spec_of(study: StudyState, type: str) -> ActionSpec:
    """Return an action of the study's robot. :raises EditRefused: it has none of this name."""
    robot = study.checked.robot
    spec = robot.actions.get(type)
    if spec is None:
        usable = [each.name for each in robot.actions.values() if each.supported]
        raise EditRefused(f"there is no action `{type}`{did_you_mean(type, usable)}")
    if not spec.supported:
        raise EditRefused(f"the robot {robot.title} (`{robot.name}`) has no `{type}`")
    return spec


def _check_parameter(spec: ActionSpec, name: str) -> None:
    if name not in spec.parameters:
        raise EditRefused(f"`{spec.name}` has no parameter `{name}`{did_you_mean(name, spec.parameters)}")


def _changeable(study: StudyState, act: str, action: str) -> WrittenAction:
    _, written = action_of(study, act, action)
    check_changeable(f"the action {action} of {act}", written.reason, written.file, written.line)
    return written


# --- actions ------------------------------------------------------------------------------------------------------


def plan_add_action(edit: AddAction, study: StudyState) -> Plan:
    """Plan a new action after another, or at the end of the act."""
    act, spec = act_of(study, edit.act), spec_of(study, edit.type)
    check_changeable(f"the act {edit.act}", act.reason, act.file, act.line)
    name = edit.id.strip() or next_id(act)
    if not _ID.fullmatch(name):
        raise EditRefused(f"an actionID is one word or number, not `{name}`")
    if any(each.id == name for each in act.actions):
        raise EditRefused(f"there is an action `{name}` in {edit.act} already; choose another one")
    _check_ids(act, edit.wait_for)
    for parameter in edit.parameters:
        _check_parameter(spec, parameter)
    children = [NewElement("actionID", text=name)]
    if edit.wait_for:
        children.append(NewElement("waitForActions", text=", ".join(edit.wait_for)))
    children += [
        NewElement(each, text=one_line(edit.parameters[each])) for each in spec.parameters if each in edit.parameters
    ]
    element = NewElement(edit.type, children=tuple(children))
    node = act.node
    behind = action_of(study, edit.act, edit.after)[1].node if edit.after else node[-1] if node else None
    sample = next((each for each in (behind, *node[::-1]) if each), None)
    gap = gap_in(node) if behind is None else gap_behind(behind, blank_line=True)
    splice = gap.insert(element, flat=sample is not None and is_one_line(sample))
    return Plan((splice,), says=(f"{edit.act} gets the action {name}: {edit.type}{_in_words(edit.parameters)}",))


def _in_words(parameters: Mapping[str, str]) -> str:
    return "".join(f", {name} “{one_line(value)}”" for name, value in parameters.items())


def next_id(act: WrittenAct) -> str:
    """Return the next free number for an action."""
    numbers = [int(each.id) for each in act.actions if each.id.isascii() and each.id.isdigit()]
    return str(max(numbers, default=0) + 1)


def _check_ids(act: WrittenAct, ids: Iterable[str]) -> None:
    known = [each.id for each in act.actions]
    for id in ids:
        if id not in known:
            raise EditRefused(f"there is no action `{id}` in {act.name}{did_you_mean(id, known)}")


def plan_remove_action(edit: RemoveAction, study: StudyState) -> Plan:
    """Plan the removal of an action; its successors then wait for its predecessors."""
    act, action = action_of(study, edit.act, edit.action)
    check_changeable(f"the act {edit.act}", act.reason, act.file, act.line)
    alone = sum(each.node is action.node for each in act.actions) == 1
    if not alone:
        check_changeable(f"the action {edit.action} of {edit.act}", f"{action.reason}, together with others")
    splices: list[Splice] = []
    says = [f"{edit.act} loses the action {edit.action}"]
    for other in act.actions:
        if edit.action not in other.wait_for or other is action:
            continue
        check_changeable(f"`waitForActions` of {other.id} of {edit.act}", other.reason)
        inherited = [*dict.fromkeys(_inherited(other.wait_for, edit.action, action.wait_for))]
        inherited = [each for each in inherited if each != other.id]
        splices += _waits_splices(other.node, inherited)
        says.append(f"{other.id} then waits for {', '.join(inherited) or 'nothing'}")
    splices.append(removal_or_collapse(action.node))
    return Plan((*splices, *follow_action(study, edit.act, edit.action, lambda _: None)), says=tuple(says))


def _inherited(waits: Iterable[str], gone: str, its_waits: Iterable[str]) -> Iterable[str]:
    for id in waits:
        if id == gone:
            yield from (each for each in its_waits if each != gone)
        else:
            yield id


def plan_set_type(edit: SetActionType, study: StudyState) -> Plan:
    """Plan another type for an action; parameters that both types have stay unchanged."""
    action = _changeable(study, edit.act, edit.action)
    spec = spec_of(study, edit.type)
    splices: list[Splice] = []
    lost: list[str] = []
    for call in (each.node for each in action.calls):
        if call.tag == edit.type:
            continue
        for at in (call.start + 1, *([] if call.is_closed else [call.close + 2])):
            splices.append(Splice(action.file, at, at + len(call.tag), edit.type))
        gone = [each for each in call if each.tag not in COMMON and each.tag not in spec.parameters]
        lost += [each.tag for each in gone]
        splices += removals(gone)
    was = action.calls[0].type if action.calls else "nothing"
    without = f", without {', '.join(dict.fromkeys(lost))}" if lost else ""
    translations = follow_action(
        study, edit.act, edit.action, lambda text: text.key if text.parameter in spec.parameters else None
    )
    says = f"{edit.act} {edit.action} is {edit.type} (was {was}){without}"
    return Plan((*splices, *translations), says=(says,))


# --- parameters ---------------------------------------------------------------------------------------------------


def plan_set_parameter(edit: SetParameter, study: StudyState) -> Plan:
    """Plan to change, add or remove one parameter of one wording."""
    act, action = action_of(study, edit.act, edit.action)
    where = f"{edit.act} {edit.action}" + (f"/{edit.variant + 1}" if len(action.calls) > 1 else "")
    if not 0 <= edit.variant < len(action.calls):
        raise EditRefused(f"{where} has {pluralize(len(action.calls), 'wording')}, and no number {edit.variant + 1}")
    call = action.calls[edit.variant]
    written = call.parameters.get(edit.parameter)
    value = None if edit.value is None else one_line(edit.value)
    says = _parameter_words(where, edit.parameter, value, None if written is None else written.text)
    if written is not None and written.parameter and value is not None:
        if places_of_parameter(study, call, written.parameter) > 1:
            template = call.node.attributes["template"]
            reason = f"the template `{template}` has `{written.parameter}` in other places, too; change its `<use>`"
            check_changeable(f"{edit.parameter} of {where}", reason, call.file, call.line)
        return plan_use_parameter(call.node, written.parameter, value, says)
    check_changeable(where, action.reason, act.file, action.line)
    if written is None:
        if value is None:
            return Plan()
        spec = spec_of(study, call.type)
        _check_parameter(spec, edit.parameter)
        return Plan((_new_parameter(call.node, spec, edit.parameter, value),), says=(says,))
    check_changeable(f"{edit.parameter} of {where}", written.reason, act.file, action.line)
    element = written.node
    if value is None:
        gone = text_key(edit.action, edit.variant if len(action.calls) > 1 else None, edit.parameter)
        translations = follow_act(study, edit.act, lambda text: None if text.key == gone else text.key)
        return Plan((removal(element), *translations), says=(says,))
    if value == written.text:
        return Plan()
    splice = _markup_splice(element, value) if element else set_text(element, value)
    return Plan((splice,), says=(says,))


def _parameter_words(where: str, parameter: str, value: str | None, was: str | None) -> str:
    if value is None:
        return f"{where} has no {parameter} any more (was “{was}”)"
    verb = "says" if parameter == "message" else f"has {parameter}"
    return f"{where} {verb} “{value}”" + (f" (was “{was}”)" if was is not None else "")


def _markup_splice(element: Element, value: str) -> Splice:
    """Replace `<speak>...</speak>` by other markup or by words."""
    written = escape_text(value)
    if value.startswith("<speak"):
        try:
            written = XmlTree(value).text
        except (XmlSyntaxError, UnicodeEncodeError) as error:
            raise EditRefused(f"this is not well-formed: {error}") from None
    return Splice(element.tree.name, *element.text_span(), written)


def _new_parameter(call: Element, spec: ActionSpec, name: str, value: str) -> Splice:
    return _in_order(call, NewElement(name, text=value), [*COMMON, *spec.parameters])


def _in_order(action: Element, new: NewElement, order: Sequence[str]) -> Splice:
    """Insert a part of an action after the parts that precede it in this order."""
    before = [each for each in action if each.tag in order[: order.index(new.tag)]]
    if before:
        return gap_behind(before[-1]).insert(new)
    return (gap_before(action[0]) if action else gap_in(action)).insert(new)


# --- waits and failures -------------------------------------------------------------------------------------------


def plan_set_waits(edit: SetWaits, study: StudyState) -> Plan:
    """Plan which actions an action waits for."""
    action = _changeable(study, edit.act, edit.action)
    _check_ids(act_of(study, edit.act), edit.wait_for)
    if edit.action in edit.wait_for:
        raise EditRefused(f"the action {edit.action} of {edit.act} cannot wait for itself")
    wait_for = tuple(dict.fromkeys(edit.wait_for))
    if wait_for == action.wait_for:
        return Plan()
    was = ", ".join(action.wait_for) or "nothing"
    says = f"{edit.act} {edit.action} waits for {', '.join(wait_for) or 'nothing'} (was {was})"
    return Plan(tuple(_waits_splices(action.node, wait_for)), says=(says,))


def _waits_splices(action: Element, wait_for: Iterable[str]) -> list[Splice]:
    text = ", ".join(wait_for)
    element = next((child for child in action if child.tag == "waitForActions"), None)
    if element is None:
        return [_in_order(action, NewElement("waitForActions", text=text), COMMON)] if text else []
    if not text:
        return [removal(element)]
    check_changeable("`waitForActions`", element.text_obstacle())
    return [set_text(element, text)]


def plan_set_failure(edit: SetActionFailure, study: StudyState) -> Plan:
    """Plan whether the act continues after a failed action."""
    action = _changeable(study, edit.act, edit.action)
    element = next((child for child in action.node if child.tag == "onFailure"), None)
    if edit.continues == action.continues and (edit.continues or element is None):
        return Plan()
    what = "the act goes on" if edit.continues else "the act ends"
    says = (f"when {edit.act} {edit.action} fails, {what}",)
    if not edit.continues and element is not None:
        return Plan((removal(element),), says=says)
    if element is None:
        return Plan((_in_order(action.node, NewElement("onFailure", text="continue"), COMMON),), says=says)
    check_changeable("onFailure", element.text_obstacle())
    return Plan((set_text(element, "continue"),), says=says)


# --- wordings -----------------------------------------------------------------------------------------------------


def _add_variant(edit: AddVariant, study: StudyState) -> Plan:
    action = _changeable(study, edit.act, edit.action)
    spec = spec_of(study, action.calls[0].type if action.calls else action.node.tag)
    for parameter in edit.parameters:
        _check_parameter(spec, parameter)
    children = (
        NewElement(each, text=one_line(edit.parameters[each])) for each in spec.parameters if each in edit.parameters
    )
    says = f"{edit.act} {edit.action} gets the wording {len(action.calls) + 1}{_in_words(edit.parameters)}"
    planned = plan_add_variant(action, NewElement(spec.name, children=tuple(children)), says)
    if len(action.calls) != 1:
        return planned
    first = follow_action(study, edit.act, edit.action, lambda text: text_key(edit.action, 0, text.parameter))
    return replace(planned, splices=(*planned.splices, *first))


def _remove_variant(edit: RemoveVariant, study: StudyState) -> Plan:
    action = _changeable(study, edit.act, edit.action)
    if not action.is_variants or len(action.calls) < 2:
        raise EditRefused(f"{edit.act} {edit.action} has only one wording; remove the action")
    if not 0 <= edit.variant < len(action.calls):
        raise EditRefused(
            f"{edit.act} {edit.action} has {len(action.calls)} wordings, and no number {edit.variant + 1}"
        )
    gone = action.calls[edit.variant]
    message = gone.parameters.get("message")
    says = f"{edit.act} {edit.action} loses the wording {edit.variant + 1}" + (f" “{message.text}”" if message else "")
    planned = plan_remove_variant(action, edit.variant, says)

    def key_of(text: SpokenText) -> str | None:
        if text.variant == edit.variant:
            return None
        number = text.variant - (text.variant > edit.variant)
        return text_key(edit.action, number if len(action.calls) > 2 else None, text.parameter)

    return replace(planned, splices=(*planned.splices, *follow_action(study, edit.act, edit.action, key_of)))


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    AddAction: plan_add_action,
    RemoveAction: plan_remove_action,
    SetActionType: plan_set_type,
    SetParameter: plan_set_parameter,
    SetWaits: plan_set_waits,
    SetActionFailure: plan_set_failure,
    AddVariant: _add_variant,
    RemoveVariant: _remove_variant,
}


# --- from one wording to several --------------------------------------------------------------------------------------


_LINE_BEGIN = re.compile(r"(?>\r\n?|\n)(?=[^\r\n])")


def plan_add_variant(action: WrittenAction, new: NewElement, says: str) -> Plan:
    """Plan another wording after the last one."""
    node = action.node
    if action.is_variants:
        last = action.calls[-1].node if action.calls else node[-1]
        flat = is_one_line(last) or not action.calls
        return Plan((gap_behind(last).insert(new, flat=flat),), says=(says,))
    common = [child for child in node if child.tag in COMMON]
    outer, unit, line_end = indent_of(node), indent_unit(node.tree), line_end_near(node)
    kept = _without(node, common)
    own_line = has_own_lines(node)
    added = new.write(outer + unit, unit, line_end, flat=not own_line or not _LINE_BEGIN.search(kept))
    inside, end = "", ""
    if own_line:
        kept = _LINE_BEGIN.sub(lambda found: found.group() + unit, kept)
        inside, end = line_end + outer + unit, line_end + outer
    pieces = ["<Variants>", *(each.written for each in common), kept, added]
    return _instead(node, inside.join(pieces) + end + "</Variants>", says)


def _without(element: Element, gone: list[Element]) -> str:
    """Return the text of an element without some of its children."""
    start = element.start
    return changed_text(
        element.written, [Splice("", each.start - start, each.end - start, "") for each in removals(gone)]
    )


def _instead(node: Element, written: str, says: str) -> Plan:
    return Plan((Splice(node.tree.name, node.start, node.end, written),), says=(says,))


def plan_remove_variant(action: WrittenAction, variant: int, says: str) -> Plan:
    """Plan a wording's removal; a single remaining one becomes an action again, unless a comment is beside it."""
    gone = removal(action.calls[variant].node)
    if len(action.calls) > 2:
        return Plan((gone,), says=(says,))
    if action.node.marks():
        noticed = ("a comment is in `<Variants>`, which therefore stays, with one wording",)
        return Plan((gone,), says=(says,), noticed=noticed)
    common = [child.written for child in action.node if child.tag in COMMON]
    return _instead(action.node, _single(action.node, action.calls[1 - variant].node, common), says)


def _single(node: Element, kept: Element, common: list[str]) -> str:
    """Write a wording as an action, with what `<Variants>` defines for it."""
    text, outer = node.tree.text, indent_of(node)
    opening, inner = text[kept.start : kept.inner_start], text[kept.inner_start : kept.inner_end]
    closing = text[kept.inner_end : kept.end]
    if kept.is_closed:
        opening, closing = opening[:-2].rstrip() + ">", f"</{kept.tag}>"
    if not has_own_lines(node) or not has_own_lines(kept):
        return opening + "".join(common) + inner + closing
    line_end, unit = line_end_near(node), indent_unit(node.tree)
    further = indent_of(kept).removeprefix(outer) if indent_of(kept).startswith(outer) else ""
    inside = line_end + outer + unit
    if is_one_line(kept):
        rest = [inner] if kept.marks() else [child.written for child in kept]
        return inside.join([opening, *common, *rest]) + line_end + outer + closing
    inner = re.sub(
        r"(?>\r\n?|\n)" + re.escape(further), lambda found: found.group()[: len(found.group()) - len(further)], inner
    )
    return inside.join([opening, *common]) + inner + closing
