"""The parameters of a `<use>`, by which what comes of a template differs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.author.edit.edits import Edit, SetUseParameter
from rise_engine.author.edit.finding import xml_of
from rise_engine.author.edit.outline import WrittenUse
from rise_engine.author.edit.plan import EditRefused, Plan
from rise_engine.author.edit.study_state import StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import set_attributes


def plan_set_use(edit: SetUseParameter, study: StudyState) -> Plan:
    """A parameter of a `<use>`: changed, added, or left to its default."""
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
    words = "is left to its default" if edit.value is None else f"is “{edit.value}”"
    says = f"{edit.parameter} of the {use.template} in {use.file}, line {use.line}, {words}{before}"
    return plan_use_parameter(use.node, edit.parameter, edit.value, says)


def _use_of(edit: SetUseParameter, study: StudyState) -> WrittenUse:
    """The `<use>` at the line, or the nearest of its template in the file."""
    xml_of(study, edit.file)
    uses = [use for use in study.outline.uses if use.file == edit.file and use.template == edit.template]
    if not uses:
        known = [use.template for use in study.outline.uses if use.file == edit.file]
        raise EditRefused(
            f"{edit.file} has no use of the template `{edit.template}`{did_you_mean(edit.template, known)}"
        )
    return min(uses, key=lambda use: abs(use.line - edit.line))


def plan_use_parameter(use: Element, parameter: str, value: str | None, says: str) -> Plan:
    """The splices that give a parameter of this `<use>` a value."""
    splices = set_attributes(use, {parameter: value}, (*use.attributes, parameter))
    return Plan(tuple(splices), says=(says,)) if splices else Plan()


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {SetUseParameter: plan_set_use}
