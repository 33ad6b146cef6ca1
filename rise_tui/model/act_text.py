"""What the act pane says about an act: its head, one line for each action, and the parameters of one of them."""

from __future__ import annotations

from typing import Any, NamedTuple

from rich.cells import cell_len

from rise_engine.scenario import expected_seconds
from rise_engine.scenario.model import Act, Action, Call
from rise_engine.scenario.template import MissingValue, Template, as_text
from rise_engine.view import ActionView, TaskView
from rise_tui.model.act_graph import ActRow, act_rows
from rise_tui.model.graph import call_seconds
from rise_tui.model.states import READY, action_state, newest, progress, task_state
from rise_tui.model.store import Store
from rise_tui.text import Line, Row, Span, Tone, cell, clock, crop, duration, headed, seconds, wrap

NARROW = 56
"""Below this width, sources and expected times stay out, and the graph has few lines."""
NAME = 13
"""Cells for a parameter's name."""


class Shown(NamedTuple):
    """An act, or something said freely, and the task that a screen should show of it."""

    act: Act
    task: TaskView | None


def shown(store: Store) -> Shown | None:
    """What the pane shows: what started last, or the act that the wizard selected since."""
    act = store.scenario.acts.get(store.act_shown)
    if act is not None:
        return Shown(act, newest(store, act.name))
    ids = [id for id in store.view.running if store.view.tasks[id].function == "say"]
    said = store.view.tasks.get(max(ids, default=store.said))
    return Shown(speech(said.behavior), said) if said is not None and said.started is not None else None


def running(store: Store) -> str:
    """The id of the action that began last and has not ended; empty when none runs."""
    what = shown(store)
    actions = what.task.actions if what is not None and what.task is not None else {}
    return next((id for id, action in reversed(actions.items()) if action.ended is None), "")


def speech(text: str) -> Act:
    """What is said freely, as an act of one action."""
    return Act("say", (Action("say", (Call("Speech", {"message": Template(text, (text,))}),)),))


class ActText:
    """Texts for the store's present values."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def rows(self, what: Shown, width: int) -> list[Row]:
        act, task = what
        rows = [Row("", self._head(act, task, width), selectable=False)]
        if task is not None and task.reason:
            tone: Tone = "fault" if task.status == "ABORTED" else "wait"
            rows.append(Row("", crop(((f" {task.reason}", tone),), width), selectable=False))
        of = {action.id: task.actions.get(action.id) if task is not None else None for action in act.actions}
        ids = min(16, max((cell_len(action.id) for action in act.actions), default=1))
        kinds = max((cell_len(self._kind(action, of[action.id])) for action in act.actions), default=1)
        columns = ids, min(kinds, 16 if width >= NARROW else 9)
        for row in act_rows(act, 4 if width < NARROW else 12):
            action = act.actions[row.place]
            done = of[action.id]
            lead: Line = (
                (f" {row.level if row.first else '':>2} ", "muted"),
                (row.rails, "accent" if done is not None and done.ended is None else "muted"),
                (" ", "plain"),
            )
            rows.append(Row(action.id, crop((*lead, *self._line(action, row, done, columns, width)), width)))
        return rows

    def _head(self, act: Act, task: TaskView | None, width: int) -> Line:
        state = task_state(task) if task is not None else READY
        name: Span = (f"{state.glyph} {state.word}", state.tone)
        typical = self._store.typical(act.name)
        if task is None or task.started is None:
            usually = f"usually {duration(typical)} " if typical is not None and width >= NARROW else ""
            return headed(act.name, name, ((usually, "muted"),), width)
        end = task.ended if task.ended is not None else self._store.now()
        took = duration(end - task.started)
        if task.status == "ACTIVE" and typical is not None:
            took = f"{took.removesuffix(' s')} of {duration(typical)}"
        ended, all_actions = progress(act, task)
        count = f"{ended}/{all_actions}  " if task.status == "ACTIVE" and all_actions > 1 else ""
        source = f"  {task.source} " if width >= NARROW else " "
        return headed(act.name, name, ((count, "muted"), (took, "plain"), (source, "muted")), width)

    def _line(self, action: Action, row: ActRow, done: ActionView | None, columns: tuple[int, int], width: int) -> Line:
        state = action_state(done)
        after = ", ".join(action.wait_for if done is None else row.untold)
        wide = width >= NARROW
        tail: Line = ((f"after {after}  ", "muted"),) if after else ()
        reason = done.reason if done is not None else ""
        tail = (*tail, (reason, "fault") if reason else (self._summary(action, done), "muted"))
        head: Line = (
            cell(action.id, columns[0], "strong" if done is not None and done.ended is None else "plain"),
            (" ", "plain"),
            cell(self._kind(action, done), columns[1], "plain"),
            (f" {state.glyph} ", state.tone),
        )
        if done is None and after and not wide:
            return (*head, ("waits ", state.tone), (f"for {after}", "muted"))
        return (
            *head,
            cell("waits" if done is None and action.wait_for else state.word, 9 if wide else 7, state.tone),
            cell(self._time(action, done, wide=wide), 9 if wide else 5, "plain" if done else "muted", right=True),
            ("  ", "plain"),
            *tail,
        )

    def _kind(self, action: Action, done: ActionView | None) -> str:
        """The action's name, and what the robot does instead of it."""
        if done is not None:
            return f"{done.type}→{done.sent_as}" if done.sent_as else done.type
        call = action.calls[0]
        if len(action.calls) > 1:
            return f"1 of {len(action.calls)}"
        instead = self._instead(call)
        return f"{call.type}→{instead}" if instead else call.type

    def _instead(self, call: Call) -> str:
        spec = self._store.scenario.robot.actions.get(call.type)
        return spec.substitute or "" if spec is not None and not spec.supported else ""

    def _time(self, action: Action, done: ActionView | None, *, wide: bool) -> str:
        """How long it took, `1.2/3.0` while it runs, or `~3.0` as long as it has not begun."""
        expected = self._expected(action, done)
        if done is None:
            return f"~{seconds(expected)}" if wide and expected is not None else ""
        took = seconds((done.ended if done.ended is not None else self._store.now()) - done.since)
        return f"{took}/{seconds(expected)}" if wide and done.ended is None and expected is not None else took

    def _expected(self, action: Action, done: ActionView | None) -> float | None:
        if done is None:
            return call_seconds(self._store.scenario, action.calls[0], self._store.memory)
        spec = self._store.scenario.robot.actions.get(done.type)
        return expected_seconds(spec, done.parameters) if spec is not None else None

    def _summary(self, action: Action, done: ActionView | None) -> str:
        parts = [(name, as_text(value)) for name, value in self._values(action, done)]
        if len(parts) == 1:
            return parts[0][1]
        return "  ".join(f"{name} {value}" for name, value in parts)

    def _values(self, action: Action, done: ActionView | None) -> list[tuple[str, Any]]:
        if done is not None:
            return list(done.parameters.items())
        return [(name, self._filled(template)) for name, template in action.calls[0].parameters.items()]

    def _filled(self, template: Template) -> str:
        try:
            return template.fill(self._store.memory)
        except MissingValue as missing:
            return f"({missing.key} is not set)"

    def details(self, what: Shown, action_id: str, width: int) -> list[Line]:
        """The parameters of one action: as they were sent, or as they would be now."""
        action = next((one for one in what.act.actions if one.id == action_id), None)
        if action is None:
            return []
        done = what.task.actions.get(action.id) if what.task is not None else None
        if done is not None:
            lines = _titled(f"{self._kind(action, done)} {action.id}", f"sent {clock(done.since, tenths=True)}", width)
            lines += _parameter("reason", done.reason, "fault", width) if done.reason else []
            for name, value in done.parameters.items():
                lines += _parameter(name, as_text(value), "plain", width)
            return lines
        lines = _titled(f"{self._kind(action, None)} {action.id}", "not sent; as it would be now", width)
        for number, call in enumerate(action.calls, 1):
            prefix = f"{number}. " if len(action.calls) > 1 else ""
            if instead := self._instead(call):
                lines += _parameter("", f"the robot has no {call.type}: it does {instead} instead", "wait", width)
            for name, template in call.parameters.items():
                filled = self._filled(template)
                lines += _parameter(prefix + name, filled, "wait" if filled.endswith("is not set)") else "plain", width)
                if template.constant is None:
                    lines += _parameter("", f"written: {template.text}", "muted", width)
        return lines


def _titled(name: str, when: str, width: int) -> list[Line]:
    return [crop(((f" {name}  ", "strong"), (when, "muted")), width)]


def _parameter(name: str, value: str, tone: Tone, width: int) -> list[Line]:
    """A parameter and its value, over as many lines as it needs."""
    lines = wrap(value, max(10, width - NAME - 2))
    return [(cell(f" {name if at == 0 else ''}", NAME, "muted"), (f" {line}", tone)) for at, line in enumerate(lines)]
