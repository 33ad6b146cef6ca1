"""An act as rows: the start, content and duration of each action; its file's lines; the form of an action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher
from functools import partial
from typing import NamedTuple

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
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import ActionCall, ActionSpec, Json, Parameter
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.speech.template import MissingValueError
from rise_tui.editor.model.draft import FilePlace, StudyDraft
from rise_tui.editor.model.fields import TYPED, EditField, FieldChoice
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, clean, crop, fixed_span, line_width


class ActionTime(NamedTuple):
    """Seconds from the act's start."""

    begin: float
    end: float


def action_times(act: WrittenAct, checked: LoadResult) -> dict[str, ActionTime]:
    """The times by action id, with the memory's start values. A circular wait counts as no wait."""
    waits = {action.id: action.wait_for for action in act.actions}
    seconds = _action_seconds(act, checked)
    times: dict[str, ActionTime] = {}

    def end_of(id: str, on_path: frozenset[str]) -> float:
        if id in times:
            return times[id].end
        if id in on_path or id not in waits:
            return 0.0
        begin = max((end_of(before, on_path | {id}) for before in waits[id]), default=0.0)
        times[id] = ActionTime(begin, begin + seconds[id])
        return times[id].end

    for action in act.actions:
        end_of(action.id, frozenset())
    return times


def act_seconds(act: WrittenAct, checked: LoadResult) -> float:
    """The probable duration of the whole act."""
    return max((each.end for each in action_times(act, checked).values()), default=0.0)


def _action_seconds(act: WrittenAct, checked: LoadResult) -> dict[str, float]:
    read = checked.draft.acts.get(act.name)
    calls = {action.id: action.calls for action in read.actions} if read is not None else {}
    specs, memory = checked.robot.actions, checked.draft.memory
    found: dict[str, float] = {}
    for action in act.actions:
        known = [call_seconds(each, specs.get(each.type), memory) for each in calls.get(action.id, ())]
        if not known:  # unreadable: use its declaration
            spec = specs.get(action.calls[0].type) if action.calls else None
            known = [spec.seconds if spec is not None else 0.0]
        found[action.id] = sum(known) / len(known)
    return found


def call_seconds(
    call: ActionCall, spec: ActionSpec | None, memory: Mapping[str, Json], unfilled: Mapping[str, str] = {}
) -> float:
    """The probable duration of an action. `unfilled`: its parameters if the memory lacks a value that it needs."""
    if spec is None:
        return 0.0
    try:
        return expected_seconds(spec, fill_parameters(call, spec, memory))
    except (MissingValueError, ValueError):
        return expected_seconds(spec, unfilled)


WHEN, BAR = 11, 26


class ActScale(NamedTuple):
    """The scale of bars."""

    cells: int
    seconds: float
    """Seconds of the whole act, always more than 0."""


def when_text(wait_for: Sequence[str]) -> str:
    """The start of an action that waits for these actions, in words."""
    return "after " + " ".join(wait_for) if wait_for else "at once"


def action_content(action: WrittenAction) -> str:
    """The content of an action without its name: its text, or the values of its parameters."""
    if not action.calls:
        return ""
    values = action.calls[0].parameters
    message = values.get("message")
    text = message.text if message is not None else " ".join(value.text for value in values.values())
    more = f"  (+{len(action.calls) - 1})" if len(action.calls) > 1 else ""
    return clean(text) + more


def all_texts(action: WrittenAction) -> str:
    """All values of an action, in all its wordings, for the search."""
    return "\n".join(value.text for call in action.calls for value in call.parameters.values())


def action_with(act: WrittenAct, wanted: str) -> str:
    """The number of the first action that contains this text; empty: none."""
    sought = wanted.casefold()
    return next((each.id for each in act.actions if sought in all_texts(each).casefold()), "")


def act_content(act: WrittenAct) -> str:
    """The texts of an act; without texts, its actions."""
    texts = [action_content(each) for each in act.actions if each.calls and "message" in each.calls[0].parameters]
    return " ".join(texts or [action_type(each) for each in act.actions])


def action_type(action: WrittenAction) -> str:
    """The type of an action; the first wording's, if it has several."""
    return action.calls[0].type if action.calls else "?"


def in_time_order(act: WrittenAct, times: Mapping[str, ActionTime]) -> list[WrittenAction]:
    """The actions in order of start, then in the order of the file."""
    zero = ActionTime(0.0, 0.0)
    return sorted(act.actions, key=lambda action: times.get(action.id, zero).begin)


def action_rows(act: WrittenAct, checked: LoadResult, width: int, *, wrong_lines: frozenset[int]) -> list[ListRow]:
    """One row for each action, in order of start."""
    times = action_times(act, checked)
    scale = ActScale(
        BAR if width >= 74 else max(0, min(BAR, width - 48)), max((each.end for each in times.values()), default=0.0)
    )
    return [
        ListRow(action.id or f"\0{number}", _action_line(action, times, scale, width, wrong=action.line in wrong_lines))
        for number, action in enumerate(in_time_order(act, times))
    ]


def scale_line(act: WrittenAct, checked: LoadResult, width: int) -> StyledLine:
    """The head of the rows: `when`, `what`, and seconds above the bars."""
    times = action_times(act, checked)
    total = max((each.end for each in times.values()), default=0.0)
    head = f"   {'when':{WHEN}}what"
    cells = BAR if width >= 74 else max(0, min(BAR, width - 48))
    if cells < 8 or total <= 0:
        return ((head, "muted"),)
    step = next((each for each in (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600) if total / each <= 5), 1200)
    ruler = [" "] * (cells + 8)
    at = 0.0
    while at <= total:
        place = round(at / total * (cells - 1))
        ruler[place : place + len(f"{at:g}")] = f"{at:g}"
        at += step
    left = width - cells - 2
    return ((head.ljust(left), "muted"), (" ", "plain"), ("".join(ruler).rstrip()[: cells + 1], "muted"))


def _action_line(
    action: WrittenAction, times: Mapping[str, ActionTime], scale: ActScale, width: int, *, wrong: bool
) -> StyledLine:
    left = max(20, width - scale.cells - 2)
    time = times.get(action.id, ActionTime(0.0, 0.0))
    mark = (" ✗ ", "fault") if wrong else ("   ", "plain")
    line: StyledLine = (
        (mark[0], "fault" if wrong else "plain"),
        fixed_span(when_text(action.wait_for), WHEN - 1, "muted"),
        (" ", "plain"),
        (f"{action.id:>2} ", "accent"),
        fixed_span(action_type(action), 10, "strong"),
        (" ", "plain"),
        (action_content(action), "muted" if action.reason else "plain"),
    )
    return (*crop(line, left), *_bar(time, scale, left - line_width(crop(line, left))))


def _bar(time: ActionTime, scale: ActScale, room: int) -> StyledLine:
    if scale.cells < 8 or scale.seconds <= 0:
        return ()
    begin = round(time.begin / scale.seconds * (scale.cells - 1))
    end = max(begin + 1, round(time.end / scale.seconds * (scale.cells - 1)) + (1 if time.end > time.begin else 0))
    return ((" " * (room + 1 + begin), "plain"), ("█" * (end - begin), "accent"))


MAX_COMPARED = 4_000
"""Maximum number of lines. Longer files show no differences, because finding them takes too long for every key."""


def file_lines(draft: StudyDraft, place: FilePlace, width: int, most: int) -> list[StyledLine]:
    """The lines of the place, at most `most`. `+` and `-` mark differences from the saved file."""
    now = _lines(draft.files.get(place.file, b""))
    was = _lines(draft.saved.get(place.file, b""))
    first, last = max(0, place.line - 1), min(len(now), place.end)
    marked: list[tuple[int, str, str]] = []
    if now == was or max(len(now), len(was)) > MAX_COMPARED:
        marked = [(number + 1, " ", now[number]) for number in range(first, last)]
    else:
        for tag, i1, i2, j1, j2 in SequenceMatcher(None, was, now, autojunk=False).get_opcodes():
            near = j2 >= first and j1 <= last
            if tag != "equal" and near:
                marked += [(i + 1, "-", was[i]) for i in range(i1, i2)]
            sign = " " if tag == "equal" else "+"
            marked += [(j + 1, sign, now[j]) for j in range(j1, j2) if first <= j < last]
    changed = next((at for at, (_, sign, _) in enumerate(marked) if sign != " "), 0)
    begin = max(0, min(changed - most // 2, len(marked) - most))
    lines: list[StyledLine] = []
    for number, sign, text in marked[begin : begin + most]:
        role: TextRole = "strong" if sign == "+" else "muted" if sign == "-" else "plain"
        lines.append(crop(((f" {number:>4}{sign}", "muted"), ("| ", "muted"), (clean(text), role)), width))
    return lines


def _lines(data: bytes) -> list[str]:
    return data.decode("utf-8", "replace").expandtabs(4).splitlines()


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
        FieldChoice(each.id, f"{each.id} {action_type(each)}", action_content(each))
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
    """The parameters of a call; for a wording, only the given or required ones."""
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
    """The choices of a parameter; empty: it is typed."""
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
    """The required parameters of a new action, with valid values as examples."""
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
