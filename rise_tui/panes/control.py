"""The control area: acts and rules with their keys and states. A name never changes its place."""

from __future__ import annotations

from rich.cells import cell_len
from textual import on

from rise_tui.actions import bindings
from rise_tui.gate import Trigger
from rise_tui.messages import SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.panes.pane import ListPane
from rise_tui.states import act_state, newest, progress, rule_state
from rise_tui.store import Store
from rise_tui.text import Line, Row, Span, Tone, cell, duration, fit, fit_end, seconds
from rise_tui.widgets.rows import RowView

STATE_WIDTH = 10
WIDE = 46
"""From this width on there is room for an act's progress and typical duration, and a rule's state."""


class ControlPane(ListPane):
    """What the two lists share."""

    FUNCTION: str

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        labels = [key.label for key in store.scenario.keys.values() if key.function == self.FUNCTION]
        self.key_width = min(8, max((len(label) for label in labels), default=1)) + 1

    def key_cell(self, name: str) -> Span:
        binding = self.store.key_of(self.FUNCTION, name)
        tone: Tone = "muted" if self.store.cannot_start() else "key"
        return (f" {fit(binding.label if binding else '', self.key_width)}", tone)

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        event.stop()
        self.post_message(SelectionMoved(self.PLACE, event.rows.current))


class ActsPane(ControlPane):
    """The acts of the scenario."""

    PLACE = "acts"
    BINDINGS = bindings("acts")
    TITLE = "Acts"
    TOPICS = frozenset({"acts", "status", "stop"})
    EMPTY = "this scenario has no acts"
    FUNCTION = "startCommunicationRobotAct"

    def subtitle(self) -> Line:
        """What the robot does now, wherever the list stands; the number of acts when it does nothing."""
        view = self.store.view
        if not view.running:
            return ((f"{len(self.store.scenario.acts)}", "muted"),)
        task = view.tasks[view.running[-1]]
        elapsed = seconds(self.store.now() - (task.started or 0.0))
        others = len(view.running) - 1
        more = (f" +{others}" if others else "") + (f", {len(view.waiting)} wait" if view.waiting else "")
        return (("► ", "accent"), (f"{task.behavior} {elapsed} s", "accent"), (more, "muted"))

    def make_rows(self, width: int) -> list[Row]:
        wide = width >= WIDE
        name_width = width - (1 + self.key_width) - STATE_WIDTH - (16 if wide else 5) - 1
        return [Row(name, self._line(name, name_width, wide)) for name in self.store.scenario.acts]

    def _line(self, name: str, name_width: int, wide: bool) -> Line:
        state = act_state(self.store, name)
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
            settings = self.store.scenario.settings_of(name)
            self.post_message(StartAsked(Trigger(self.FUNCTION, name, settings.debounce, settings.hold)))
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
    TOPICS = frozenset({"rules", "status", "stop"})
    EMPTY = "this scenario has no rules"
    FUNCTION = "startInteractionRule"

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
        for name in self.store.scenario.rules:
            rule, state = self.store.rule(name), rule_state(self.store, name)
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
            self.post_message(StartAsked(Trigger(self.FUNCTION, name)))
        elif action == "rules.stop":
            if self.store.rule(name).running:
                self.post_message(TaskAsked("stopInteractionRule", name))
            else:
                self.post_message(Told(f"{name} does not run"))
