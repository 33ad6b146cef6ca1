"""The control area: acts and rules with their keys and states. A name never moves."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from rich.cells import cell_len
from textual import on

from rise_engine.author.drawing.study_keys import key_title
from rise_tui.actions import bindings_in
from rise_tui.key_labels import why_blocked
from rise_tui.model.control import enter_action
from rise_tui.model.notice import act_label
from rise_tui.model.resumption import act_summary, start_summary
from rise_tui.model.speech import act_texts
from rise_tui.model.states import (
    ARMED,
    EXPECTED,
    READY,
    RUNNING,
    SENT,
    WAITING,
    StateLabel,
    act_state,
    is_armed,
    newest_task,
    rule_state,
)
from rise_tui.model.store import Store, StorePart
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    align_at_both_ends,
    cell_width,
    crop,
    fit,
    fit_end,
    fixed_span,
    format_seconds,
    line_width,
    shorten,
)
from rise_tui.widgets.lines import RowView

STATE_WIDTH = 11
TITLE_SHARE = 0.4
"""The titles of acts take at most this part of a row."""
RUNNING_NAME_WIDTH = 24
"""Cells for the name of the running act, in the title of the acts."""
WIDE = 46
"""Minimum width for an act's times and a rule's state in words."""
NAMES_WIDTH = 76
"""Minimum width for an act's own name beside its title."""


def _mark_expected(state: StateLabel, is_expected: bool) -> StateLabel:
    """Mark the items that a running rule waits for, unless their present state matters more."""
    return EXPECTED if is_expected and state not in (RUNNING, WAITING, SENT, ARMED) else state


class StartListPane(ListPane):
    """The common base of both lists."""

    FUNCTION: str
    EXPECTATION_PARTS: ClassVar[frozenset[StorePart]]
    """Parts that matter only if they change the inputs that the running rules wait for."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._shown_expected: frozenset[str] = frozenset()
        labels = [key.label for key in store.scenario.keys.values() if key.function == self.FUNCTION]
        self.key_width = min(8, max((len(label) for label in labels), default=1)) + 1

    @abstractmethod
    def expected_names(self) -> frozenset[str]:
        """The names in the list that a running rule waits for."""

    @abstractmethod
    def stop(self, name: str) -> None:
        """Stop an act or a rule, or show that nothing runs."""

    def is_affected_by(self, changed: set[StorePart]) -> bool:
        if changed & (self.PARTS - self.EXPECTATION_PARTS):
            return True
        return bool(changed & self.EXPECTATION_PARTS) and self.expected_names() != self._shown_expected

    def why_blocked(self, name: str) -> str:
        """Why its key would start nothing now, or empty."""
        return why_blocked(self.store, "start")

    def key_cell(self, name: str) -> StyledSpan:
        binding = self.store.key_of(self.FUNCTION, name)
        role: TextRole = "muted" if self.why_blocked(name) else "key"
        return (f" {fit(binding.label if binding else '', self.key_width)}", role)

    def armed_line(self, name: str, width: int) -> StyledLine:
        """The row of a start that needs one more press: what it would do, in place of its name and state."""
        armed = self.store.armed
        if armed is None or not is_armed(self.store, self.FUNCTION, name):
            return ()
        again = "enter again" if armed.by_enter else "again"
        text = f"{ARMED.glyph} {again}: {start_summary(self.store, armed)}"
        return crop((self.key_cell(name), (text, ARMED.role)), width)

    @on(RowView.CursorMoved)
    def _cursor_moved(self, event: RowView.CursorMoved) -> None:
        event.stop()
        name = event.rows.current_id
        self.host.show_selection(self.SCOPE, name)
        if name and (reason := self.why_blocked(name)):
            self.host.show_notice(f"{name} cannot be started: {reason}")

    def carry_out(self, action: str) -> None:
        name = self.row_list.current_id
        if not name:
            self.host.show_notice(f"no {self.SCOPE.removesuffix('s')} is selected")
        elif action in ("acts.start", "rules.start"):
            self.host.start(enter_action(self.store.scenario, self.FUNCTION, name))
        else:
            self.stop(name)


class ActsPane(StartListPane):
    """The acts of the scenario."""

    SCOPE = "acts"
    BINDINGS = bindings_in("acts")
    TITLE = "Acts"
    PARTS = frozenset({"acts", "rules", "memory", "status", "stop"})
    EMPTY = "this scenario has no acts"
    FUNCTION = "startCommunicationRobotAct"
    EXPECTATION_PARTS = frozenset({"rules", "memory"})

    def expected_names(self) -> frozenset[str]:
        return self.store.expected_inputs().acts

    def subtitle(self) -> StyledLine:
        """The robot's present work, even if its row is not visible; the number of acts if it does nothing."""
        view = self.store.view
        if not view.running:
            return ((f"{len(self.store.scenario.acts)}", "muted"),)
        task = view.tasks[view.running[-1]]
        elapsed = format_seconds(self.store.now() - (task.started or 0.0))
        others = len(view.running) - 1
        more = (f" +{others}" if others else "") + (f", {len(view.waiting)} wait" if view.waiting else "")
        name = act_label(task.function, task.behavior)
        return (
            ("► ", "accent"),
            (f"{shorten(name, RUNNING_NAME_WIDTH)} {elapsed} s", "accent"),
            (more, "muted"),
        )

    def make_rows(self, width: int) -> list[ListRow]:
        expected = self._shown_expected = self.expected_names()
        titles = {name: self._title(name) for name in self.store.scenario.acts}
        longest = max(map(cell_width, titles.values()), default=0)
        title_width = min(longest, int(width * TITLE_SHARE))
        rows = []
        for name, title in titles.items():
            texts = act_texts(self.store.scenario, name, self.store.memory)
            line = self.armed_line(name, width) or self._act_line(
                name, title, title_width, texts, width, name in expected
            )
            rows.append(ListRow(name, line, full=" ".join((self.key_cell(name)[0], title, name, *texts))))
        return rows

    def _title(self, name: str) -> str:
        """The title of its key, as below the lists, or its name."""
        key = self.store.key_of(self.FUNCTION, name)
        return key_title(key) if key is not None else name

    def _act_line(
        self, name: str, title: str, title_width: int, texts: list[str], width: int, is_expected: bool
    ) -> StyledLine:
        """`p praise  “Very good!” +3  ✓ done`: the key, the title, the words and the state."""
        running = bool(self.store.act(name).running)
        head: StyledLine = (
            self.key_cell(name),
            fixed_span(title, title_width, "strong" if running else "plain"),
            ("  ", "plain"),
        )
        end = self._end_span(name, is_expected, wide=width >= WIDE)
        tail: StyledLine = ((" ", "plain"), end) if end[0] else ()
        if width >= NAMES_WIDTH and title != name:
            tail = ((f"  {name}", "muted"), *tail)
        first, more = act_summary(self.store.scenario, name, texts)
        room = width - line_width(head) - line_width(tail) - 2
        words = shorten(first, room - len(more))
        shown: StyledLine = (*head, (words, "strong" if running else "muted"), (more, "muted"))
        return align_at_both_ends(shown, (*tail, (" ", "plain")), width)

    def _end_span(self, name: str, is_expected: bool, *, wide: bool) -> StyledSpan:
        """The state of an act, with its elapsed and typical time while it runs; before its first start, what is special
        about it."""
        state = _mark_expected(act_state(self.store, name), is_expected)
        task = newest_task(self.store, name)
        text = state.word
        if state is RUNNING and task is not None and wide:
            typical = self.store.typical_seconds(name)
            elapsed = format_seconds(self.store.now() - (task.started or 0.0))
            text += f" {elapsed}/{format_seconds(typical)}" if typical is not None else f" {elapsed} s"
        elif state is READY:
            settings = self.store.scenario.settings_of(name)
            return "hold" if settings.hold else "filler" if settings.filler else "", "muted"
        return f"{state.glyph} {text}", state.role

    def stop(self, name: str) -> None:
        act = self.store.act(name)
        if act.running:
            self.host.send("stopCommunicationRobotAct", name)
        elif act.waiting:
            self.host.send("cancelTask", str(act.waiting[0]))
        else:
            self.host.show_notice(f"{name} is not running or queued")


class RulesPane(StartListPane):
    """The rules of the scenario."""

    SCOPE = "rules"
    BINDINGS = bindings_in("rules")
    TITLE = "Rules"
    PARTS = frozenset({"rules", "memory", "status", "stop"})
    EMPTY = "this scenario has no rules"
    FUNCTION = "startInteractionRule"
    EXPECTATION_PARTS = frozenset({"memory"})

    def expected_names(self) -> frozenset[str]:
        return self.store.expected_inputs().rules

    def why_blocked(self, name: str) -> str:
        return why_blocked(self.store, "start") or ("it is already running" if self.store.rule(name).running else "")

    def subtitle(self) -> StyledLine:
        return ((f"{len(self.store.view.running_rules())} of {len(self.store.scenario.rules)} run", "muted"),)

    def make_rows(self, width: int) -> list[ListRow]:
        wide = width >= WIDE
        room = width - (1 + self.key_width) - 1
        least = STATE_WIDTH + max(14, width // 4) if wide else 17
        longest = max((cell_len(name) for name in self.store.scenario.rules), default=0)
        name_width = min(longest, room - least)
        state_width = room - name_width
        rows = []
        expected = self._shown_expected = self.expected_names()
        for name in self.store.scenario.rules:
            rule, state = self.store.rule(name), _mark_expected(rule_state(self.store, name), name in expected)
            remark = (rule.state or "") if rule.running else rule.reason if rule.status == "faulted" else ""
            lead = STATE_WIDTH - 2 if wide else 0
            shown = remark if wide or remark else state.word
            text = (fit_end if rule.running and remark else fit)(shown, state_width - 2 - lead)
            spans: StyledLine = (
                self.key_cell(name),
                fixed_span(name, name_width, "strong" if rule.running else "plain"),
                (" ", "plain"),
                (f"{state.glyph} ", state.role),
                (fit(state.word, lead) + text, state.role),
            )
            rows.append(ListRow(name, self.armed_line(name, width) or spans))
        return rows

    def stop(self, name: str) -> None:
        if self.store.rule(name).running:
            self.host.send("stopInteractionRule", name)
        else:
            self.host.show_notice(f"{name} is not running")
