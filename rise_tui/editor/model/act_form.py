"""The form of an action, made from what the robot's profile declares: type, unit, range, choices."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from rise_engine.author.edit.edits import (
    AnyEdit,
    RemoveVariant,
    SetActionFailure,
    SetActionType,
    SetParameter,
    SetUseParameter,
    SetWaits,
)
from rise_engine.author.edit.outline import WrittenAct, WrittenAction, WrittenCall, WrittenValue
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_tui.editor.model.act_rows import action_type, what_text
from rise_tui.editor.model.fields import TYPED, EditField, FieldChoice

FAILS, GOES_ON = "ends", "goes on"
UNITS = {"m": "metres", "rad": "radians", "ms": "milliseconds", "s": "seconds", "deg": "degrees"}


def act_choices(checked: LoadResult) -> list[FieldChoice]:
    """The actions of this robot."""
    return [
        FieldChoice(
            spec.name, spec.name, spec.help if spec.supported else "not on this robot" + _instead(spec.substitute)
        )
        for spec in sorted(checked.robot.actions.values(), key=lambda each: (not each.supported, each.name))
    ]


def _instead(substitute: str | None) -> str:
    return f": it does {substitute} instead" if substitute else ""


def _wait_choices(act: WrittenAct, action: WrittenAction) -> list[FieldChoice]:
    """What an action can wait for: all others."""
    return [
        FieldChoice(each.id, f"{each.id} {action_type(each)}", what_text(each))
        for each in act.actions
        if each.id and each.id != action.id
    ]


def action_fields(act: WrittenAct, action: WrittenAction, checked: LoadResult) -> list[EditField]:
    """All fields of an action."""
    reason = action.reason
    spec = checked.robot.actions.get(action_type(action))
    fields: list[EditField] = []
    if not action.is_variants and action.calls:
        fields.append(
            EditField("type", "action", "choice", action_type(action), choices=act_choices(checked), reason=reason,
                      note=spec.help if spec else "this robot cannot do it: choose another",
                      can_be_cleared=False,
                      edits=lambda text: (SetActionType(act.name, action.id, text),) if text else ())
        )  # fmt: skip
    for number, call in enumerate(action.calls):
        known = checked.robot.actions.get(call.type)
        fields += _call_fields(act, action, call, number, known)
    waits = _wait_choices(act, action)
    titles = {each.value: each.title for each in waits}
    fields.append(
        EditField("waits", "waits for", "many", ",".join(action.wait_for), choices=waits, reason=reason,
                  question=f"{action.id} {action_type(action)} begins when these have ended",
                  shown=" · ".join(titles.get(id, f"{id}?") for id in action.wait_for) or "nothing: at once",
                  edits=lambda text: (SetWaits(act.name, action.id, tuple(filter(None, (text or "").split(",")))),))
    )  # fmt: skip
    outcomes = (
        FieldChoice(FAILS, "the act ends", "actions that wait for it do not begin"),
        FieldChoice(GOES_ON, "the others go on", "as if it had succeeded"),
    )
    fields.append(
        EditField("failure", "on failure", "choice", GOES_ON if action.continues else FAILS, choices=outcomes,
                  shown="the others go on" if action.continues else "the act ends", reason=reason, can_be_cleared=False,
                  edits=lambda text: (SetActionFailure(act.name, action.id, text == GOES_ON),))
    )  # fmt: skip
    if not reason:
        return fields
    return [field._replace(kind="fixed", note="", reason="") if field.reason == reason else field for field in fields]


def _call_fields(
    act: WrittenAct, action: WrittenAction, call: WrittenCall, number: int, spec: ActionSpec | None
) -> list[EditField]:
    """The parameters of a call; for a wording, only those that are given or required."""
    many = action.is_variants
    declared = dict(spec.parameters) if spec is not None else {}
    if many:
        declared = {name: each for name, each in declared.items() if name in call.parameters or each.required}
    names = [*declared, *(name for name in call.parameters if name not in declared)]
    fields = []
    for name in names:
        label = f"{name} {number + 1}" if many else name
        written, parameter = call.parameters.get(name), declared.get(name)
        field = _parameter_field(label, parameter, written)
        field = field._replace(id=f"{number}/{name}", reason=field.reason or action.reason)
        if written is not None and written.parameter and act.template:
            field = field._replace(reason="", note=f"parameter {written.parameter} of the template {act.template}",
                                   edits=partial(_use_edits, act, written))  # fmt: skip
        else:
            field = field._replace(edits=partial(_parameter_edits, act.name, action.id, name, number))
        if many and name == "message":
            field = field._replace(text=field.text or "", edits=partial(_wording_edits, act.name, action.id, number))
        fields.append(field)
    return fields


def _use_edits(act: WrittenAct, written: WrittenValue, text: str | None) -> tuple[AnyEdit, ...]:
    return (SetUseParameter(act.file, act.line, act.template, written.parameter, text),)


def _parameter_edits(act: str, action: str, name: str, variant: int, text: str | None) -> tuple[AnyEdit, ...]:
    return (SetParameter(act, action, name, text, variant),)


def _wording_edits(act: str, action: str, number: int, text: str | None) -> tuple[AnyEdit, ...]:
    """Change a wording. Empty text removes it."""
    return (SetParameter(act, action, "message", text, number),) if text else (RemoveVariant(act, action, number),)


def _parameter_field(label: str, parameter: Parameter | None, written: WrittenValue | None) -> EditField:
    text = written.text if written is not None else None
    reason = written.reason if written is not None else ""
    if parameter is None:
        return EditField("", label, "text", text, note="the robot has no such parameter: del removes it",
                         reason=reason)  # fmt: skip
    choices = parameter_choices(parameter)
    note = parameter_note(parameter, is_given=written is not None)
    return EditField(
        "", label, "choice" if choices else "text", text, note=note, choices=choices,
        new=TYPED if parameter.type == "name" else "", required=parameter.required, reason=reason,
    )  # fmt: skip


def parameter_choices(parameter: Parameter) -> Sequence[FieldChoice]:
    """The choices of a parameter; empty if it is typed."""
    if parameter.type == "boolean":
        return (FieldChoice("true", "true", "yes"), FieldChoice("false", "false", "no"))
    codes = [FieldChoice(name, name, f"RISE's number {number}") for name, number in parameter.codes.items()]
    return [*codes, *(FieldChoice(name, name) for name in parameter.names if name not in parameter.codes)]


def parameter_note(parameter: Parameter, *, is_given: bool) -> str:
    """Unit, range, default and purpose of a parameter."""
    parts: list[str] = []
    low, high = parameter.minimum, parameter.maximum
    if low is not None and high is not None:
        parts.append(f"from {low:g} to {high:g}")
    elif low is not None:
        parts.append(f"at least {low:g}")
    elif high is not None:
        parts.append(f"at most {high:g}")
    if parameter.unit:
        parts.append(UNITS.get(parameter.unit, parameter.unit))
    if not is_given and not parameter.required:
        parts.append(f"not given: {parameter.default}" if parameter.default is not None else "the robot's own")
    if parameter.help:
        parts.append(parameter.help)
    return "; ".join(parts)


def new_action_parameters(spec: ActionSpec) -> dict[str, str]:
    """The required parameters of a new action, with valid values that show what to enter."""
    found: dict[str, str] = {}
    for name, parameter in spec.parameters.items():
        if not parameter.required:
            continue
        choices = parameter_choices(parameter)
        if choices:
            found[name] = choices[0].value
        elif parameter.type in ("number", "integer"):
            low = parameter.minimum if parameter.minimum is not None else 0
            default = parameter.default if isinstance(parameter.default, int | float) else max(0, low)
            found[name] = f"{default:g}"
        else:
            found[name] = "…"
    return found
