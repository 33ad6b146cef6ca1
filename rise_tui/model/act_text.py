"""The text of the act pane: its head, one line for each action, and the parameters of one of them."""

from __future__ import annotations

from typing import Any, NamedTuple

from rich.cells import cell_len

from rise_engine.author.drawing.act_graph import ActRow, act_rows, estimate_call_seconds
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.scenario.model import Act, Action, ActionCall
from rise_engine.scenario.parameters import MESSAGE
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import MissingValueError, Template, spoken_text
from rise_tui.model.log_text import field_lines
from rise_tui.model.speech import estimate_action_seconds
from rise_tui.model.states import READY, act_progress, action_state, newest_task, task_state
from rise_tui.model.store import Store
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    TextRole,
    crop,
    fixed_span,
    format_clock,
    format_duration,
    format_seconds,
    heading_line,
)

NARROW = 56
"""Below this width, sources and expected times are omitted, and the graph has few lines."""


class ShownAct(NamedTuple):
    """An act, or free speech, and its task for the screen."""

    act: Act
    task: TaskView | None


def shown_act(store: Store) -> ShownAct | None:
    """The act in the pane: the last started one, or the one that the wizard has selected since."""
    act = store.scenario.acts.get(store.shown_act)
    if act is not None:
        return ShownAct(act, newest_task(store, act.name))
    ids = [id for id in store.view.running if store.view.tasks[id].function == "say"]
    speech = store.view.tasks.get(max(ids, default=store.newest_speech))
    if speech is None or speech.started is None:
        return None
    return ShownAct(act_of_speech(speech.behavior), speech)


def running_action(store: Store) -> str:
    """The id of the action that began last and has not ended; empty: none runs."""
    shown = shown_act(store)
    actions = shown.task.actions if shown is not None and shown.task is not None else {}
    return next((id for id, action in reversed(actions.items()) if action.ended is None), "")


def act_of_speech(text: str) -> Act:
    """Free speech as an act of one action."""
    return Act("say", (Action("say", (ActionCall("Speech", {"message": Template(text, (text,))}),)),))


class ActText:
    """Texts with the store's present values."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def rows(self, shown: ShownAct, width: int) -> list[ListRow]:
        act, task = shown
        rows = [ListRow("", self._head_line(act, task, width), selectable=False)]
        if task is not None and task.reason:
            role: TextRole = "fault" if task.status == "ABORTED" else "wait"
            rows.append(ListRow("", crop(((f" {task.reason}", role),), width), selectable=False))
        views = {action.id: task.actions.get(action.id) if task is not None else None for action in act.actions}
        ids = min(16, max((cell_len(action.id) for action in act.actions), default=1))
        kinds = max((cell_len(self._type_text(action, views[action.id])) for action in act.actions), default=1)
        columns = ids, min(kinds, 16 if width >= NARROW else 9)
        for row in act_rows(act, 4 if width < NARROW else 12):
            action = act.actions[row.position]
            begun = views[action.id]
            lead: StyledLine = (
                (f" {row.level if row.first else '':>2} ", "muted"),
                (row.rails, "accent" if begun is not None and begun.ended is None else "muted"),
                (" ", "plain"),
            )
            line = (*lead, *self._action_line(action, row, begun, columns, width))
            rows.append(ListRow(action.id, crop(line, width)))
        return rows

    def _head_line(self, act: Act, task: TaskView | None, width: int) -> StyledLine:
        state = task_state(task) if task is not None else READY
        typical = self._store.typical_seconds(act.name)
        if task is None or task.started is None:
            usually = f"usually {format_duration(typical)} " if typical is not None and width >= NARROW else ""
            return heading_line(act.name, state.span, ((usually, "muted"),), width)
        end = task.ended if task.ended is not None else self._store.now()
        took = format_duration(end - task.started)
        if task.status == "ACTIVE" and typical is not None:
            took = f"{took.removesuffix(' s')} of {format_duration(typical)}"
        ended, all_actions = act_progress(act, task)
        count = f"{ended}/{all_actions}  " if task.status == "ACTIVE" and all_actions > 1 else ""
        source = f"  {task.source} " if width >= NARROW else " "
        return heading_line(act.name, state.span, ((count, "muted"), (took, "plain"), (source, "muted")), width)

    def _action_line(
        self, action: Action, row: ActRow, begun: ActionView | None, columns: tuple[int, int], width: int
    ) -> StyledLine:
        state = action_state(begun)
        after = ", ".join(action.wait_for if begun is None else row.undrawn)
        wide = width >= NARROW
        tail: StyledLine = ((f"after {after}  ", "muted"),) if after else ()
        reason = begun.reason if begun is not None else ""
        tail = (*tail, (reason, "fault") if reason else (self._parameters_text(action, begun), "muted"))
        head: StyledLine = (
            fixed_span(action.id, columns[0], "strong" if begun is not None and begun.ended is None else "plain"),
            (" ", "plain"),
            fixed_span(self._type_text(action, begun), columns[1], "plain"),
            (f" {state.glyph} ", state.role),
        )
        if begun is None and after and not wide:
            return (*head, ("waits ", state.role), (f"for {after}", "muted"))
        return (
            *head,
            fixed_span("waits" if begun is None and action.wait_for else state.word, 9 if wide else 7, state.role),
            fixed_span(
                self._time_text(action, begun, wide=wide), 9 if wide else 5, "plain" if begun else "muted", right=True
            ),
            ("  ", "plain"),
            *tail,
        )

    def _type_text(self, action: Action, begun: ActionView | None) -> str:
        """The action's name, and the robot's substitute for it."""
        if begun is not None:
            return f"{begun.type}→{begun.sent_as}" if begun.sent_as else begun.type
        call = action.calls[0]
        if len(action.calls) > 1:
            return f"1 of {len(action.calls)}"
        substitute = self._substitute(call)
        return f"{call.type}→{substitute}" if substitute else call.type

    def _substitute(self, call: ActionCall) -> str:
        """The robot's substitute for an action that it does not have; empty: it has the action."""
        spec = self._store.scenario.robot.actions.get(call.type)
        return spec.substitute or "" if spec is not None and not spec.supported else ""

    def _time_text(self, action: Action, begun: ActionView | None, *, wide: bool) -> str:
        """The duration of the action; `1.2/3.0` while it runs, `~3.0` before it begins."""
        expected = self._estimate_seconds(action, begun)
        if begun is None:
            return f"~{format_seconds(expected)}" if wide and expected is not None else ""
        took = format_seconds((begun.ended if begun.ended is not None else self._store.now()) - begun.since)
        return f"{took}/{format_seconds(expected)}" if wide and begun.ended is None and expected is not None else took

    def _estimate_seconds(self, action: Action, begun: ActionView | None) -> float | None:
        if begun is None:
            return estimate_call_seconds(self._store.scenario, action.calls[0], self._store.memory)
        return estimate_action_seconds(self._store.scenario, begun)

    def _parameters_text(self, action: Action, begun: ActionView | None) -> str:
        parts = [(name, plain_words(spoken_text(value))) for name, value in self._parameter_values(action, begun)]
        if len(parts) == 1:
            return parts[0][1]
        return "  ".join(f"{name} {value}" for name, value in parts)

    def _parameter_values(self, action: Action, begun: ActionView | None) -> list[tuple[str, Any]]:
        if begun is not None:
            return list(begun.parameters.items())
        return [(name, self._fill(template)) for name, template in action.calls[0].parameters.items()]

    def _fill(self, template: Template) -> str:
        try:
            return template.fill(self._store.memory)
        except MissingValueError as missing:
            return f"({missing.key} is not set)"

    def details(self, shown: ShownAct, action_id: str, width: int) -> list[StyledLine]:
        """The parameters of one action: as they were sent, or as they would be now."""
        action = next((each for each in shown.act.actions if each.id == action_id), None)
        if action is None:
            return []
        begun = shown.task.actions.get(action.id) if shown.task is not None else None
        when = f"sent {format_clock(begun.since, tenths=True)}" if begun is not None else "not sent; as it would be now"
        lines = [crop(((f" {self._type_text(action, begun)} {action.id}  ", "strong"), (when, "muted")), width)]
        if begun is not None:
            lines += field_lines("reason", begun.reason, width, "fault") if begun.reason else []
            for name, value in begun.parameters.items():
                text = spoken_text(value)
                lines += field_lines(name, plain_words(text), width)
                if name == MESSAGE:
                    lines += self._given_lines(begun.sent_as or begun.type, begun.parameters, width)
            return lines
        for number, call in enumerate(action.calls, 1):
            prefix = f"{number}. " if len(action.calls) > 1 else ""
            if substitute := self._substitute(call):
                lines += field_lines("", f"the robot has no {call.type}: it does {substitute} instead", width, "wait")
            texts = {name: self._fill(template) for name, template in call.parameters.items()}
            for name, template in call.parameters.items():
                text = texts[name]
                role: TextRole = "wait" if text.endswith("is not set)") else "plain"
                lines += field_lines(prefix + name, plain_words(text), width, role)
                if template.constant is None or plain_words(text) != text:
                    lines += field_lines("", f"written: {template.text}", width, "muted")
                if name == MESSAGE:
                    lines += self._given_lines(substitute or call.type, texts, width)
        return lines

    def _given_lines(self, action: str, parameters: dict[str, Any], width: int) -> list[StyledLine]:
        """The text that the robot receives, if it differs from the text above."""
        given = self._store.wording.parameters_for_robot(action, parameters)[MESSAGE]
        same = given == plain_words(spoken_text(parameters[MESSAGE]))
        return [] if same else field_lines("", f"the robot is given: {given}", width, "muted")
