"""The console: wires keys, lists, panes and bars to the session. Nothing here waits for the engine (console.md 5.1)."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from textual import events, on
from textual.app import ComposeResult
from textual.geometry import Region
from textual.message import Message
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Input

from rise_engine.link.client import Verb
from rise_tui.actions import BY_ID, Place, bindings
from rise_tui.console import overlays
from rise_tui.console.confirmations import Confirmations
from rise_tui.console.input import InputController, line_opener
from rise_tui.messages import ActionAsked, PaneAsked, SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.model.key_action import MARK_CUE, NEXT_FILLER, KeyAction
from rise_tui.model.notice import Level, Notice
from rise_tui.model.store import Store, Topic
from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.screens.arrangement import Arrangement
from rise_tui.screens.painting import Painting
from rise_tui.screens.tour import offered
from rise_tui.session import Session
from rise_tui.widgets.line import Lines
from rise_tui.widgets.mistake import MistakeLine
from rise_tui.widgets.note import NoteLine
from rise_tui.widgets.say import SayLine

CLOCK = 1.0
TENTHS = 0.5
"""How often running times move, and only while something runs."""


class ConsoleScreen(Screen[None]):
    """One session on one terminal."""

    BINDINGS = bindings("console")

    DEFAULT_CSS = """
    ConsoleScreen { layout: vertical; background: $background; }
    """

    class SettingsAsked(Message):
        """The wizard wants other settings; the app knows how to start sessions."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.panes = Arrangement(session.store)
        self.painting = Painting(session.store, self.panes, self.set_timer)
        self.status, self.alarm = self.painting.status, self.painting.alarm
        self.call, self.failure = self.painting.call, self.painting.failure
        self.notice, self.hints = self.painting.notice, self.painting.hints
        self.say_line, self.mistake = self.painting.say, self.painting.mistake
        self.note = NoteLine()
        self._unnoted = ""
        """A note that was typed and not taken."""
        self.confirmations = Confirmations(self)
        self.input = InputController(session.store, self, self.set_timer)

    @property
    def store(self) -> Store:
        return self.session.store

    def compose(self) -> ComposeResult:
        self.painting.fit()
        yield self.status
        yield self.painting.band
        yield self.alarm
        yield self.call
        yield self.failure
        yield self.panes
        yield self.notice
        yield self.mistake
        yield self.note
        yield self.say_line
        yield self.painting.strip
        yield self.hints

    def on_mount(self) -> None:
        self.session.changed = self._changed
        self.run_worker(self.session.pump(), name="pump", exit_on_error=True)
        self.set_interval(CLOCK, self.painting.tick)
        self.set_interval(TENTHS, self.painting.tick_tenths)
        self.panes.go_to("acts")

    def _changed(self, topics: frozenset[Topic] | set[Topic]) -> None:
        self.painting.changed(topics)
        if "status" in topics:
            self.confirmations.control_may_have_changed()

    def on_resize(self) -> None:
        self.painting.fit()
        overlays.show_when_too_small(self.app, self.store)

    def on_screen_resume(self, event: events.ScreenResume) -> None:
        if self.stack_updates == 0:  # for the first time: everything has just been styled as it was mounted
            event.refresh_styles = False
        overlays.show_when_too_small(self.app, self.store)

    @on(Lines.Resized)
    def _bar_resized(self) -> None:
        self.painting.draw_bars()

    @on(events.DescendantFocus)
    @on(events.DescendantBlur)
    def _focus_moved(self) -> None:
        self.painting.draw_hints()

    # --- keys -----------------------------------------------------------------------------------------------------

    @property
    def _is_typing(self) -> bool:
        return isinstance(self.app.focused, Input)

    def observe_key(self, event: events.Key, together: bool | None) -> None:
        """Every key, whatever has the focus, before anything acts on it. `together`: whether it came with others."""
        self.painting.key_pressed()
        on_console = self.app.screen is self
        self.input.observe_key(event.key, event.time, typing=self._is_typing, on_console=on_console, together=together)

    def admits(self, event: events.Event) -> bool:
        """Whether an event of the keyboard or the mouse may go on; all of them come by here, dialogs or not."""
        leaving = self.app.screen.has_class("-quit")
        if isinstance(event, events.Key):
            return self.input.admits_key(
                event.key, printable=event.is_printable, typing=self._is_typing, leaving=leaving
            )
        if isinstance(event, events.MouseDown):
            self.input.observe_mouse()
        return self.input.admits_other(leaving=leaving, says_why=isinstance(event, events.MouseDown | events.Paste))

    def handle_key_first(self, event: events.Key) -> bool:
        """Do at once what a scenario's key asks for, without its way through the focused list and all around it.

        So are lines opened in which letters mean something else: the next key is theirs, however soon it comes. Only
        when no dialog, field or first press of two is there that the key could be meant for.
        """
        opener = line_opener(event.key)
        if not (opener or event.key in self.store.scenario.keys) or self.input.armed is not None:
            return False
        if self.app.screen is not self or isinstance(self.focused, Input | MistakeLine):
            return False
        if opener:
            self.action_do(opener)
        else:
            self.on_key(event)
        return True

    def on_key(self, event: events.Key) -> None:
        """Keys that nothing else has taken."""
        if isinstance(self.focused, Input):
            return
        self.mistake.close()
        if self.input.handle_key(event.key, event.time, selected_act=self._selected_act):
            event.stop()
            event.prevent_default()

    @property
    def _selected_act(self) -> str:
        """The act under the cursor, while the list of acts has the focus."""
        pane = self.panes.focused()
        return pane.rows.current if pane is not None and pane.PLACE == "acts" else ""

    # --- what keys make happen: InputActions ------------------------------------------------------------------------

    def submit(self, action: KeyAction, pressed: float | None) -> None:
        self._run(self.session.submit(action.function, action.behavior, action.calling_type, pressed))

    def submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        self.say_line.taken(typed)
        self._run(self._submit_speech(action, typed, pressed))

    async def _submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        if not await self.session.submit(action.function, action.behavior, action.calling_type, pressed):
            self.say_line.keep(typed)

    def show_armed(self, act: str) -> None:
        self.store.armed = act
        if act:
            self.show_notice(f"{act}: Enter or the same key again within 2 s starts it", "wait")
        else:
            self.painting.clear_notice()
        self.painting.changed({"acts"})

    def show_mode(self) -> None:
        self.painting.changed({"acts", "rules", "status", "tasks"})

    def ask_what_was_wrong(self, task: int) -> None:
        self.painting.open_mistake(task)

    def leave_transient(self) -> None:
        pane = self.panes.focused()
        if not (pane is not None and pane.escape()):
            self.panes.unzoom()

    # --- what panes and hints ask -----------------------------------------------------------------------------------

    def _run(self, work: Coroutine[Any, Any, object]) -> None:
        """Something for the engine: it is sent, and answered, while the console goes on."""
        self.run_worker(work, group="send")

    def start(self, action: KeyAction) -> None:
        """Ask for a start, with all care against accidents."""
        self.input.start(action)

    def send(self, function: str, behavior: str = "") -> None:
        """Give a task to the engine, without waiting."""
        self.input.send(function, behavior)

    def request_control(self, verb: Verb) -> None:
        """Take, ask for, give or release control, without waiting."""
        self.run_worker(self.session.control(verb), group="send")

    def show_notice(self, text: str, level: Level = "info") -> None:
        """Tell the wizard something."""
        self.session.tell(Notice(text, level))

    @on(TaskAsked)
    def _task_asked(self, event: TaskAsked) -> None:
        self.send(event.function, event.behavior)

    @on(StartAsked)
    def _start_asked(self, event: StartAsked) -> None:
        self.start(event.action)

    @on(ActionAsked)
    def _action_asked(self, event: ActionAsked) -> None:
        self.action_do(event.action)

    @on(PaneAsked)
    def _pane_asked(self, event: PaneAsked) -> None:
        self.panes.go_to(event.pane)

    @on(Told)
    def _told(self, event: Told) -> None:
        self.show_notice(event.text)

    @on(SelectionMoved)
    def _selection_moved(self, event: SelectionMoved) -> None:
        if event.pane == "acts":
            self.store.act_shown = event.name
        else:
            self.store.rule_shown = event.name
        self.painting.repaint("act", "rule")

    # --- actions of the registry --------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or say why not."""
        self.input.action_carried_out()
        if reason := BY_ID[action].unavailable(self.store):
            self.show_notice(f"{BY_ID[action].title}: not now, {reason}")
            return
        if BY_ID[action].place in self.panes.panes:
            self.panes.panes[BY_ID[action].place].action_do(action)
            return
        self.doing()[action]()

    def doing(self) -> dict[str, Callable[[], object]]:
        """What carries out each action that belongs to no pane."""
        return {
            "stop": self.stop_all,
            "quit": lambda: self.app.run_action("quit"),
            "palette": lambda: overlays.open_palette(self, self._focused_place),
            "help": lambda: overlays.open_help(self, self._focused_place),
            "jump": lambda: overlays.open_jump_mode(self, self.panes, self.hints.region),
            "tour": self.open_tour,
            "redraw": self._redraw,
            "lists": self.panes.go_to_control,
            "next-pane": self.panes.go_to_next,
            "previous-pane": lambda: self.panes.go_to_next(-1),
            "zoom": self.panes.zoom,
            "filter": self._filter,
            "settings": lambda: self.post_message(self.SettingsAsked()),
            "theme": lambda: overlays.open_theme_palette(self),
            "release": self.confirmations.ask_to_release_stop,
            "control": self.confirmations.ask_about_control,
            "note": self._note,
            "say": self.say_line.open,
            "cue": lambda: self.start(MARK_CUE),
            "filler": lambda: self.start(NEXT_FILLER),
            "mistake": self.input.mark_mistake,
            "repeat": self.input.repeat_failed_act,
            "go-on": self.input.go_on_without_failed_act,
            "safe": self.input.switch_safe,
            "lock": self.switch_lock,
        }

    def stop_all(self) -> None:
        """The stop key: no question, no condition, from any screen."""
        self.input.reset()
        self.send("stopAll")
        self.confirmations.stop_pressed()

    def switch_lock(self) -> None:
        """Lock the keyboard, or unlock it."""
        if self.store.guard != "LOCKED":
            overlays.close_all_above(self)
        self.input.switch_lock()

    @property
    def _focused_place(self) -> Place | None:
        pane = self.panes.focused()
        return pane.PLACE if pane is not None else None

    def _redraw(self) -> None:
        if isinstance(self.app, TerminalApp):
            self.app.repaint_everything()

    # --- the tour -----------------------------------------------------------------------------------------------------

    def open_tour(self, seen: Callable[[], None] | None = None) -> None:
        """`seen` is called when it has ended, however it ends."""
        overlays.open_tour(self, self.panes, self._part, seen)

    def offer_tour(self, seen: Callable[[], None]) -> None:
        """On a first run: only where it disturbs nobody."""
        if offered(self.store):
            self.open_tour(seen)

    def _part(self, name: str) -> Region:
        """Where something stands that the tour points at."""
        panes, hints = self.panes, self.hints.region
        match name:
            case "status":
                return self.status.region
            case "acts":
                return panes.panes["acts"].region
            case "watching":
                shown = (pane.region for pane in panes.shown() if pane.PLACE not in ("acts", "rules"))
                return next(shown, panes.region)
            case "stop":
                return hints
            case _:
                return Region(hints.x + hints.width // 3, hints.y, 2 * hints.width // 3, hints.height)

    def _filter(self) -> None:
        pane = self.panes.focused()
        if pane is not None:
            pane.open_filter()

    # --- lines that open ----------------------------------------------------------------------------------------------

    def _note(self) -> None:
        self.notice.display = False
        self.note.open(self._unnoted)

    @on(SayLine.Asked)
    def _say_asked(self, event: SayLine.Asked) -> None:
        self.input.say(event.typed, event.text, at_once=event.at_once)

    @on(SayLine.Closed)
    def _say_closed(self, event: SayLine.Closed) -> None:
        self._focus_back(event.back)

    @on(MistakeLine.Chosen)
    def _mistake_chosen(self, event: MistakeLine.Chosen) -> None:
        if event.mark != "wrong":  # it is marked so already
            self.send("markMistake", f"{event.task} {event.mark}")

    @on(MistakeLine.Closed)
    def _mistake_closed(self, event: MistakeLine.Closed) -> None:
        self.notice.display = True
        if self.focused in (None, self.mistake):
            self._focus_back(event.back)

    def _focus_back(self, widget: Widget | None) -> None:
        """To what had the focus before a line was opened, if it can still be seen."""
        there = widget is not None and widget.is_attached and widget.display and widget.visible
        self.set_focus(widget if there else self.panes.panes["acts"].rows)

    @on(NoteLine.Done)
    def _noted(self, event: NoteLine.Done) -> None:
        self.notice.display = True
        self._focus_back(event.back)
        if event.text:
            self.run_worker(self._send_note(event.text), group="send")

    async def _send_note(self, text: str) -> None:
        self._unnoted = "" if await self.session.note(text) else text
