"""The control area: acts and rules with their keys and states. A name never changes its place."""

from __future__ import annotations

from typing import ClassVar

from rich.cells import cell_len
from textual import on

from rise_tui.actions import bindings, why_blocked
from rise_tui.messages import SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.model.deeds import act_words
from rise_tui.model.key_action import start_action
from rise_tui.model.states import (
    ARMED,
    EXPECTED,
    RUNNING,
    SENT,
    WAITING,
    State,
    act_state,
    newest,
    progress,
    rule_state,
)
from rise_tui.model.store import Store, Topic
from rise_tui.panes.pane import ListPane
from rise_tui.text import Line, Row, Span, Tone, cell, duration, fit, fit_end, seconds
from rise_tui.widgets.rows import RowView

STATE_WIDTH = 10
NOW = 24
"""Cells for the name of what runs now, in the title of the acts."""
WIDE = 46
"""From this width on there is room for an act's progress and typical duration, and a rule's state."""


def _expected(state: State, awaited: bool) -> State:
    """What a running rule waits for says so, unless there is something to say about it now."""
    return EXPECTED if awaited and state not in (RUNNING, WAITING, SENT, ARMED) else state


class ControlPane(ListPane):
    """What the two lists share."""

    FUNCTION: str
    BY_WAITING: ClassVar[frozenset[Topic]]
    """What matters only where it changes what the running rules wait for."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._shown_awaited: frozenset[str] = frozenset()
        labels = [key.label for key in store.scenario.keys.values() if key.function == self.FUNCTION]
        self.key_width = min(8, max((len(label) for label in labels), default=1)) + 1

    def awaited(self) -> frozenset[str]:
        """The names of the list that a running rule waits for."""
        raise NotImplementedError

    def looks_different(self, changed: set[Topic]) -> bool:
        if changed & (self.TOPICS - self.BY_WAITING):
            return True
        return bool(changed & self.BY_WAITING) and self.awaited() != self._shown_awaited

    def why_not(self, name: str) -> str:
        """Why its key would start nothing now, or empty."""
        return why_blocked(self.store, "start")

    def key_cell(self, name: str) -> Span:
        binding = self.store.key_of(self.FUNCTION, name)
        tone: Tone = "muted" if self.why_not(name) else "key"
        return (f" {fit(binding.label if binding else '', self.key_width)}", tone)

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        event.stop()
        name = event.rows.current
        self.post_message(SelectionMoved(self.PLACE, name))
        if name and (reason := self.why_not(name)):
            self.post_message(Told(f"{name} cannot be started: {reason}"))


class ActsPane(ControlPane):
    """The acts of the scenario."""

    PLACE = "acts"
    BINDINGS = bindings("acts")
    TITLE = "Acts"
    TOPICS = frozenset({"acts", "rules", "memory", "status", "stop"})
    EMPTY = "this scenario has no acts"
    FUNCTION = "startCommunicationRobotAct"
    BY_WAITING = frozenset({"rules", "memory"})

    def awaited(self) -> frozenset[str]:
        return self.store.awaited().acts

    def subtitle(self) -> Line:
        """What the robot does now, wherever the list stands; the number of acts when it does nothing."""
        view = self.store.view
        if not view.running:
            return ((f"{len(self.store.scenario.acts)}", "muted"),)
        task = view.tasks[view.running[-1]]
        elapsed = seconds(self.store.now() - (task.started or 0.0))
        others = len(view.running) - 1
        more = (f" +{others}" if others else "") + (f", {len(view.waiting)} wait" if view.waiting else "")
        name = act_words(task.function, task.behavior)
        return (("► ", "accent"), (f"{fit(name, min(cell_len(name), NOW))} {elapsed} s", "accent"), (more, "muted"))

    def make_rows(self, width: int) -> list[Row]:
        wide = width >= WIDE
        name_width = width - (1 + self.key_width) - STATE_WIDTH - (16 if wide else 5) - 1
        awaited = self._shown_awaited = self.awaited()
        return [Row(name, self._line(name, name_width, wide, name in awaited)) for name in self.store.scenario.acts]

    def _line(self, name: str, name_width: int, wide: bool, awaited: bool) -> Line:
        state = _expected(act_state(self.store, name), awaited)
        running = bool(self.store.act(name).running)
        spans: list[Span] = [
            self.key_cell(name),
            cell(name, name_width, "strong" if running else "plain"),
            (" ", "plain"),
            (f"{state.glyph} ", state.tone),
            cell(state.word, STATE_WIDTH - 2, state.tone),
        ]
        if wide:
            spans.append(cell(self._progress(name), 5, "muted", right=True))
        spans.append(cell(self._time(name, wide), 11 if wide else 5, "plain" if running else "muted", right=True))
        return tuple(spans)

    def _progress(self, name: str) -> str:
        task = newest(self.store, name)
        if task is not None and task.status == "ACTIVE":
            done, total = progress(self.store.scenario.acts[name], task)
            return f"{done}/{total}"
        settings = self.store.scenario.settings_of(name)
        return "hold" if settings.hold else "fill" if settings.filler else ""

    def _time(self, name: str, wide: bool) -> str:
        """Running: elapsed and typical; otherwise, where there is room, how long it typically takes."""
        task, typical = newest(self.store, name), self.store.typical(name)
        if task is not None and task.status == "ACTIVE":
            elapsed = seconds(self.store.now() - (task.started or 0.0))
            return f"{elapsed}/{seconds(typical)}" if wide and typical is not None else elapsed
        return f"~{duration(typical)}" if wide and typical is not None else ""

    def do(self, action: str) -> None:
        name = self.list.current
        if not name:
            self.post_message(Told("no act is selected"))
        elif action == "acts.start":
            self.post_message(StartAsked(start_action(self.store.scenario, self.FUNCTION, name)))
        elif action == "acts.stop":
            act = self.store.act(name)
            if not act.running and not act.waiting:
                self.post_message(Told(f"{name} neither runs nor waits"))
            elif act.running:
                self.post_message(TaskAsked("stopCommunicationRobotAct", name))
            else:
                self.post_message(TaskAsked("cancelTask", str(act.waiting[0])))


class RulesPane(ControlPane):
    """The rules of the scenario."""

    PLACE = "rules"
    BINDINGS = bindings("rules")
    TITLE = "Rules"
    TOPICS = frozenset({"rules", "memory", "status", "stop"})
    EMPTY = "this scenario has no rules"
    FUNCTION = "startInteractionRule"
    BY_WAITING = frozenset({"memory"})

    def awaited(self) -> frozenset[str]:
        return self.store.awaited().rules

    def why_not(self, name: str) -> str:
        return why_blocked(self.store, "start") or ("it runs already" if self.store.rule(name).running else "")

    def subtitle(self) -> Line:
        return ((f"{len(self.store.view.stack())} of {len(self.store.scenario.rules)} run", "muted"),)

    def make_rows(self, width: int) -> list[Row]:
        wide = width >= WIDE
        room = width - (1 + self.key_width) - 1
        least = STATE_WIDTH + max(14, width // 4) if wide else 17
        longest = max((cell_len(name) for name in self.store.scenario.rules), default=0)
        name_width = min(longest, room - least)
        state_width = room - name_width
        rows = []
        awaited = self._shown_awaited = self.awaited()
        for name in self.store.scenario.rules:
            rule, state = self.store.rule(name), _expected(rule_state(self.store, name), name in awaited)
            at = (rule.state or "") if rule.running else rule.reason if rule.status == "faulted" else ""
            lead = STATE_WIDTH - 2 if wide else 0
            shown = at if wide or at else state.word
            text = (fit_end if rule.running and at else fit)(shown, state_width - 2 - lead)
            spans: Line = (
                self.key_cell(name),
                cell(name, name_width, "strong" if rule.running else "plain"),
                (" ", "plain"),
                (f"{state.glyph} ", state.tone),
                (fit(state.word, lead) + text, state.tone),
            )
            rows.append(Row(name, spans))
        return rows

    def do(self, action: str) -> None:
        name = self.list.current
        if not name:
            self.post_message(Told("no rule is selected"))
        elif action == "rules.start":
            self.post_message(StartAsked(start_action(self.store.scenario, self.FUNCTION, name)))
        elif action == "rules.stop":
            if self.store.rule(name).running:
                self.post_message(TaskAsked("stopInteractionRule", name))
            else:
                self.post_message(Told(f"{name} does not run"))
