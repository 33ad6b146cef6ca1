"""The console: wires keys, lists, panes and bars to the session. Nothing here waits for the engine (law 5)."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from textual import events, on
from textual.app import ComposeResult
from textual.command import CommandPalette
from textual.message import Message
from textual.timer import Timer
from textual.widgets import Input

from rise_tui.actions import BY_ID, at, bindings
from rise_tui.commands import ConsoleCommands
from rise_tui.gate import Gate, Trigger
from rise_tui.messages import ActionAsked, PaneAsked, SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.quiet import QuietScreen
from rise_tui.screens.arrangement import Arrangement
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.help import HelpScreen
from rise_tui.session import Session
from rise_tui.store import EVERYTHING, Notice, Topic, describe
from rise_tui.widgets.bars import AlarmBar, KeyHints, NoticeLine, StatusLine
from rise_tui.widgets.line import Lines

FRAME = 1 / 15
"""Seconds between two repaints while records pour in."""
CLOCK = 1.0
TENTHS = 0.2
"""How often running times move, and only while something runs."""
NOTICE_SECONDS = 12.0


class ConsoleScreen(QuietScreen[None]):
    """One session on one terminal."""

    BINDINGS = bindings("console")

    DEFAULT_CSS = """
    ConsoleScreen { layout: vertical; background: $background; }
    """

    class SettingsAsked(Message):
        """The wizard wants other settings; the app knows how to start sessions."""

    class ThemeAsked(Message):
        """The next theme, please."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.status, self.alarm = StatusLine(), AlarmBar()
        self.panes = Arrangement(session.store)
        self.notice, self.hints = NoticeLine(), KeyHints()
        self.gate = Gate(self._fire, self._arm, self.say, self.set_timer)
        self._dirty: set[Topic] = set()
        self._frame: Timer | None = None
        self._painted = 0.0
        self._noticed: Notice | None = None
        self._noticed_at = 0.0

    def compose(self) -> ComposeResult:
        yield self.status
        yield self.alarm
        yield self.panes
        yield self.notice
        yield self.hints

    def on_mount(self) -> None:
        self.session.changed = self._changed
        self.run_worker(self.session.pump(), name="pump", exit_on_error=True)
        self.set_interval(CLOCK, self._tick)
        self.set_interval(TENTHS, self._tick_tenths)
        self.panes.go_to("acts")

    # --- painting -------------------------------------------------------------------------------------------------

    def _changed(self, topics: frozenset[Topic] | set[Topic]) -> None:
        """The store changed; paint soon, and not more often than a terminal can take."""
        self._dirty |= topics
        if self._frame is None and self.is_mounted:
            self._frame = self.set_timer(max(0.001, self._painted + FRAME - monotonic()), self._paint)

    def _paint(self) -> None:
        self._frame, self._painted = None, monotonic()
        dirty, self._dirty = self._dirty, set()
        for pane in self.panes.shown():
            if dirty & pane.TOPICS:
                pane.repaint()
        if dirty & {"status", "stop"}:
            self._draw_bars()
        if "notice" in dirty:
            self._draw_notice()
        if dirty & {"stop", "tasks", "rules", "status"}:
            self._draw_hints()

    def _draw_bars(self) -> None:
        self.status.draw(self.session.store)
        self.alarm.draw(self.session.store)

    def _draw_notice(self) -> None:
        if self.session.store.notice is not self._noticed:
            self._noticed, self._noticed_at = self.session.store.notice, monotonic()
        self.notice.draw(self.session.store)

    def _draw_hints(self) -> None:
        if isinstance(self.focused, Input):
            self.hints.draw_typing()
            return
        pane = self.panes.focused()
        own = list(at(pane.PLACE)) if pane is not None else []
        release = [BY_ID["release"]] if self.session.store.state == "STOPPED" else []
        order = ("stop", "palette", "help", "control", "next-pane", "filter", "zoom", "settings")
        self.hints.draw([*release, *own], [BY_ID[name] for name in order], self.session.store)

    def _tick(self) -> None:
        self.status.draw(self.session.store)
        for pane in self.panes.shown():
            if pane.PLACE == "memory":
                pane.repaint()
        if self._noticed is not None and monotonic() - self._noticed_at > NOTICE_SECONDS:
            self._clear_notice()

    def _tick_tenths(self) -> None:
        view = self.session.store.view
        if (view.running or view.waiting) and not self.session.store.gone:
            for pane in self.panes.shown():
                if pane.PLACE in ("acts", "act", "scheduler"):
                    pane.repaint()

    def _clear_notice(self) -> None:
        self.session.store.notice = None
        self._draw_notice()

    @on(Lines.Resized)
    def _bar_resized(self, event: Lines.Resized) -> None:
        self._draw_bars()
        self._draw_notice()
        self._draw_hints()

    def on_descendant_focus(self) -> None:
        self._draw_hints()

    # --- keys -----------------------------------------------------------------------------------------------------

    def key_seen(self, event: events.Key) -> None:
        """Every key, whatever has the focus, before anything acts on it."""
        if self._noticed is not None and monotonic() - self._noticed_at > 1.0:
            self._clear_notice()
        self.gate.observe(event.key, event.time)

    def on_key(self, event: events.Key) -> None:
        """Keys that no text field has taken: those of the scenario, Enter for an armed act, Esc."""
        if isinstance(self.focused, Input):
            return
        armed = self.gate.armed
        if event.key == "enter" and armed is not None:
            if self._selected_is(armed):
                self.gate.press(armed, event.time)
            else:
                self.gate.confirm()
        elif event.key == "escape":
            self._escape()
        elif (binding := self.session.store.scenario.keys.get(event.key)) is not None:
            settings = self.session.store.scenario.settings_of(binding.behavior)
            is_act = binding.function == "startCommunicationRobotAct"
            trigger = Trigger(binding.function, binding.behavior, settings.debounce, is_act and settings.hold)
            self.start(trigger, event.time)
        else:
            return
        event.stop()
        event.prevent_default()

    def _selected_is(self, trigger: Trigger) -> bool:
        pane = self.panes.focused()
        return pane is not None and pane.PLACE == "acts" and getattr(pane.rows, "current", "") == trigger.behavior

    def _escape(self) -> None:
        pane = self.panes.focused()
        if not self.gate.disarm() and not (pane is not None and pane.escape()):
            self.panes.unzoom()

    def start(self, trigger: Trigger, when: float | None = None) -> None:
        """Ask for a start, with all care against accidents."""
        if reason := self.session.store.cannot_start():
            self.say(f"{describe(trigger.function, trigger.behavior)}: not started, {reason}")
        else:
            self.gate.press(trigger, monotonic() if when is None else when)

    def _fire(self, trigger: Trigger) -> None:
        if reason := self.session.store.cannot_start():
            self.say(f"{describe(trigger.function, trigger.behavior)}: not started, {reason}")
        else:
            self.send(trigger.function, trigger.behavior, trigger.calling_type)

    def _arm(self, trigger: Trigger | None) -> None:
        self.session.store.armed = trigger.behavior if trigger is not None else ""
        if trigger is not None:
            self.session.tell(Notice(f"{trigger.behavior}: Enter or the same key again within 2 s starts it", "wait"))
        elif self.session.store.notice is self._noticed:
            self.session.store.notice = None
        self._changed({"acts", "notice"})

    # --- what panes and hints ask -----------------------------------------------------------------------------------

    def send(self, function: str, behavior: str = "", calling_type: str = "") -> None:
        """Give a task to the engine, without waiting."""
        self.run_worker(self.session.submit(function, behavior, calling_type), group="send")

    def say(self, text: str) -> None:
        self.session.tell(Notice(text))

    @on(TaskAsked)
    def _task_asked(self, event: TaskAsked) -> None:
        self.send(event.function, event.behavior)

    @on(StartAsked)
    def _start_asked(self, event: StartAsked) -> None:
        self.start(event.trigger)

    @on(ActionAsked)
    def _action_asked(self, event: ActionAsked) -> None:
        self.action_do(event.action)

    @on(PaneAsked)
    def _pane_asked(self, event: PaneAsked) -> None:
        self.panes.go_to(event.pane)

    @on(Told)
    def _told(self, event: Told) -> None:
        self.say(event.text)

    @on(SelectionMoved)
    def _selection_moved(self, event: SelectionMoved) -> None:
        if event.pane == "acts":
            self.session.store.act_shown = event.name
        else:
            self.session.store.rule_shown = event.name
        for pane in self.panes.shown():
            if pane.PLACE in ("act", "rule"):
                pane.repaint()

    # --- actions of the registry --------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or say why not."""
        if reason := BY_ID[action].unavailable(self.session.store):
            self.say(f"{BY_ID[action].title}: not now, {reason}")
            return
        if BY_ID[action].place in self.panes.panes:
            self.panes.panes[BY_ID[action].place].do(action)
            return
        doing: dict[str, Callable[[], object]] = {
            "stop": self.stop_all,
            "quit": lambda: self.app.run_action("quit"),
            "palette": lambda: self.app.push_screen(
                CommandPalette([ConsoleCommands], placeholder="command, act or rule")
            ),
            "help": lambda: self.app.push_screen(HelpScreen(self.session.store)),
            "control": self.panes.go_to_control,
            "next-pane": self.panes.go_to_next,
            "zoom": self.panes.zoom,
            "filter": self._filter,
            "settings": lambda: self.post_message(self.SettingsAsked()),
            "theme": lambda: self.post_message(self.ThemeAsked()),
            "release": self._release,
        }
        doing[action]()

    def stop_all(self) -> None:
        """The stop key: no question, no condition, from any screen."""
        self.gate.reset()
        self.send("stopAll")

    def _palette(self) -> None:
        self.app.push_screen(CommandPalette([ConsoleCommands], placeholder="command, act or rule"))

    def _filter(self) -> None:
        pane = self.panes.focused()
        if pane is not None:
            pane.open_filter()

    def _release(self) -> None:
        stop = self.session.store.view.stop
        said = [f"Stopped by {stop.source or 'the console'}."]
        said.append(f"Confirmed: {', '.join(stop.confirmed) or 'nobody'}.")
        if stop.unconfirmed:
            said.append(f"NOT confirmed: {', '.join(stop.unconfirmed)}. Look at the robot first.")
        elif stop.status == "requested":
            said.append("The robot has not answered yet. Look at it first.")
        said.append("After this, keys start acts and rules again.")
        dialog = Dialog("Release the stop?", said, yes="Release", key="r", no="Stay stopped")
        self.app.push_screen(dialog, lambda yes: self.send("releaseStop") if yes else None)

    def repaint_all(self) -> None:
        """After a change of theme."""
        self._changed(EVERYTHING)
