"""The console: wires keys, lists, panes and bars to the session. Nothing here waits for the engine (law 5)."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from textual import events, on
from textual.app import ComposeResult
from textual.message import Message
from textual.widgets import Input

from rise_tui.actions import BY_ID, bindings
from rise_tui.control import question
from rise_tui.gate import Gate, Trigger
from rise_tui.messages import ActionAsked, PaneAsked, SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.notice import Notice
from rise_tui.quiet import QuietScreen
from rise_tui.screens.arrangement import Arrangement
from rise_tui.screens.dialog import Answer, Dialog
from rise_tui.screens.painting import Painting
from rise_tui.session import Session
from rise_tui.store import Topic, describe
from rise_tui.widgets.line import Lines
from rise_tui.widgets.note import NoteLine

CLOCK = 1.0
TENTHS = 0.5
"""How often running times move, and only while something runs."""


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
        self.panes = Arrangement(session.store)
        self.painting = Painting(session.store, self.panes, self.set_timer)
        self.status, self.alarm = self.painting.status, self.painting.alarm
        self.call = self.painting.call
        self.notice, self.hints = self.painting.notice, self.painting.hints
        self.note = NoteLine()
        self._unnoted = ""
        """A note that was typed and not taken."""
        self._control_shown: tuple[str | None, str | None] = (None, None)
        self.gate = Gate(self._fire, self._arm, self.say, self.set_timer)

    def compose(self) -> ComposeResult:
        yield self.status
        yield self.alarm
        yield self.call
        yield self.panes
        yield self.notice
        yield self.note
        yield self.hints

    def on_mount(self) -> None:
        self.session.changed = self._changed
        self.run_worker(self.session.pump(), name="pump", exit_on_error=True)
        self.set_interval(CLOCK, self.painting.tick)
        self.set_interval(TENTHS, self.painting.tick_tenths)
        self.panes.go_to("acts")

    def _changed(self, topics: frozenset[Topic] | set[Topic]) -> None:
        self.painting.changed(topics)
        if "status" in topics and self._who() != self._control_shown:
            self._withdraw("-control", "control has just changed: the question about it was closed")

    @on(Lines.Resized)
    def _bar_resized(self) -> None:
        self.painting.draw_bars()

    @on(events.DescendantFocus)
    @on(events.DescendantBlur)
    def _focus_moved(self) -> None:
        self.painting.draw_hints()

    # --- keys -----------------------------------------------------------------------------------------------------

    def key_seen(self, event: events.Key) -> None:
        """Every key, whatever has the focus, before anything acts on it."""
        self.painting.key_pressed()
        self.gate.observe(event.key, event.time, typing=isinstance(self.app.focused, Input))

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
            self.say(f"{describe(trigger.function, trigger.behavior)} not started: {reason}")
        else:
            self.gate.press(trigger, monotonic() if when is None else when)

    def _fire(self, trigger: Trigger) -> None:
        if reason := self.session.store.cannot_start():
            self.say(f"{describe(trigger.function, trigger.behavior)} not started: {reason}")
        else:
            self.send(trigger.function, trigger.behavior, trigger.calling_type)

    def _arm(self, trigger: Trigger | None) -> None:
        self.session.store.armed = trigger.behavior if trigger is not None else ""
        if trigger is not None:
            self.session.tell(Notice(f"{trigger.behavior}: Enter or the same key again within 2 s starts it", "wait"))
        else:
            self.painting.clear_notice()
        self.painting.changed({"acts"})

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
        self.painting.repaint("act", "rule")

    # --- actions of the registry --------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or say why not."""
        if reason := BY_ID[action].unavailable(self.session.store):
            self.say(f"{BY_ID[action].title}: not now, {reason}")
            return
        if BY_ID[action].place in self.panes.panes:
            self.panes.panes[BY_ID[action].place].action_do(action)
            return
        doing: dict[str, Callable[[], object]] = {
            "stop": self.stop_all,
            "quit": lambda: self.app.run_action("quit"),
            "palette": self._palette,
            "help": self._help,
            "lists": self.panes.go_to_control,
            "next-pane": self.panes.go_to_next,
            "zoom": self.panes.zoom,
            "filter": self._filter,
            "settings": lambda: self.post_message(self.SettingsAsked()),
            "theme": lambda: self.post_message(self.ThemeAsked()),
            "release": self._release,
            "control": self._control,
            "note": self._note,
        }
        doing[action]()

    def stop_all(self) -> None:
        """The stop key: no question, no condition, from any screen."""
        self.gate.reset()
        self.send("stopAll")
        self._withdraw("-release", "stopped again: the question whether to release the stop was closed")

    def _withdraw(self, kind: str, said: str) -> None:
        """Close a question whose matter has changed."""
        for screen in self.app.screen_stack:
            if isinstance(screen, Dialog) and screen.has_class(kind) and screen.withdraw():
                self.say(said)

    def _palette(self) -> None:
        from textual.command import CommandPalette  # not needed to begin, as the help

        from rise_tui.commands import ConsoleCommands

        self.app.push_screen(CommandPalette([ConsoleCommands], placeholder="command, act or rule"))

    def _help(self) -> None:
        from rise_tui.screens.help import HelpScreen

        self.app.push_screen(HelpScreen(self.session.store))

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
        dialog = Dialog("Release the stop?", said, Answer("r", "Release"), no="Stay stopped")
        dialog.add_class("-release")
        self.app.push_screen(dialog, lambda yes: self.send("releaseStop") if yes else None)

    # --- several consoles ---------------------------------------------------------------------------------------------

    def _who(self) -> tuple[str | None, str | None]:
        """Who has control, and who asks for it: what a question about control is about."""
        view = self.session.store.view
        return view.control, view.asked

    def _control(self) -> None:
        store = self.session.store
        said, ways = question(store.view.control, store.view.asked, store.me)
        self._control_shown = self._who()
        verbs = {way.key: way.verb for way in ways}
        dialog = Dialog("Control", said, *(Answer(way.key, way.title) for way in ways), no="Leave it")
        dialog.add_class("-control")

        def answered(key: str | None) -> None:
            if key:
                self.run_worker(self.session.control(verbs[key]), group="send")

        self.app.push_screen(dialog, answered)

    def _note(self) -> None:
        self.notice.display = False
        self.note.open(self._unnoted)

    @on(NoteLine.Done)
    def _noted(self, event: NoteLine.Done) -> None:
        self.notice.display = True
        back = event.back if event.back is not None and event.back.is_attached else None
        self.set_focus(back or self.panes.panes["acts"].rows)
        if event.text:
            self.run_worker(self._send_note(event.text), group="send")

    async def _send_note(self, text: str) -> None:
        self._unnoted = "" if await self.session.note(text) else text
