"""The console: wires keys, lists, panes and bars to the session. Nothing here waits for the engine (law 5)."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from textual import events, on
from textual.app import ComposeResult
from textual.message import Message
from textual.screen import Screen
from textual.widget import Widget

from rise_tui.actions import BY_ID, bindings
from rise_tui.messages import ActionAsked, PaneAsked, SelectionMoved, StartAsked, TaskAsked, Told
from rise_tui.model.gate import Trigger
from rise_tui.model.store import Topic
from rise_tui.screens import finding
from rise_tui.screens.acting import CUE, FILLER, Acting
from rise_tui.screens.arrangement import Arrangement
from rise_tui.screens.keyboard import Keyboard
from rise_tui.screens.painting import Painting
from rise_tui.screens.questions import Questions
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
        self.questions = Questions(self)
        self.acting = Acting(session, self.painting, self.set_timer, self._run)
        self.keyboard = Keyboard(self)

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
            self.questions.look_again()

    def on_resize(self) -> None:
        self.painting.fit()
        finding.watch_size(self)

    def on_screen_resume(self, event: events.ScreenResume) -> None:
        if self.stack_updates == 0:  # for the first time: everything has just been styled as it was mounted
            event.refresh_styles = False
        finding.watch_size(self)

    @on(Lines.Resized)
    def _bar_resized(self) -> None:
        self.painting.draw_bars()

    @on(events.DescendantFocus)
    @on(events.DescendantBlur)
    def _focus_moved(self) -> None:
        self.painting.draw_hints()

    # --- keys -----------------------------------------------------------------------------------------------------

    def on_key(self, event: events.Key) -> None:
        self.keyboard.left(event)

    @property
    def selected_act(self) -> str:
        """The act under the cursor, while the list of acts has the focus."""
        pane = self.panes.focused()
        return getattr(pane.rows, "current", "") if pane is not None and pane.PLACE == "acts" else ""

    def escape(self) -> None:
        """Leave whatever can be left."""
        pane = self.panes.focused()
        if not self.acting.gate.disarm() and not (pane is not None and pane.escape()):
            self.panes.unzoom()

    # --- what panes and hints ask -----------------------------------------------------------------------------------

    def _run(self, work: Coroutine[Any, Any, object]) -> None:
        """Something for the engine: it is sent, and answered, while the console goes on."""
        self.run_worker(work, group="send")

    def start(self, trigger: Trigger) -> None:
        """Ask for a start, with all care against accidents."""
        self.acting.start(trigger)

    def send(self, function: str, behavior: str = "") -> None:
        """Give a task to the engine, without waiting."""
        self.acting.send(function, behavior)

    def say(self, text: str) -> None:
        """Tell the wizard something."""
        self.acting.tell(text)

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
        self.keyboard.opened()
        if reason := BY_ID[action].unavailable(self.session.store):
            self.say(f"{BY_ID[action].title}: not now, {reason}")
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
            "palette": lambda: finding.open_palette(self),
            "help": lambda: finding.open_help(self),
            "jump": lambda: finding.jump(self),
            "tour": lambda: finding.start_tour(self),
            "redraw": lambda: finding.redraw(self),
            "lists": self.panes.go_to_control,
            "next-pane": self.panes.go_to_next,
            "previous-pane": lambda: self.panes.go_to_next(-1),
            "zoom": self.panes.zoom,
            "filter": self._filter,
            "settings": lambda: self.post_message(self.SettingsAsked()),
            "theme": lambda: finding.choose_theme(self),
            "release": self.questions.release,
            "control": self.questions.control,
            "note": self._note,
            "say": self.say_line.open,
            "cue": lambda: self.start(CUE),
            "filler": lambda: self.start(FILLER),
            "mistake": self.acting.mistake,
            "repeat": self.acting.repeat,
            "go-on": self.acting.go_on,
            "safe": self.acting.switch_safe,
            "lock": self.switch_lock,
        }

    def stop_all(self) -> None:
        """The stop key: no question, no condition, from any screen."""
        self.acting.gate.reset()
        self.send("stopAll")
        self.questions.stopped_again()

    def switch_lock(self) -> None:
        """Lock the keyboard, or unlock it."""
        if self.session.store.guard != "LOCKED":
            self.questions.close_all()
        self.acting.switch_lock()

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
        self.acting.say(event.typed, event.text, at_once=event.at_once)

    @on(SayLine.Closed)
    def _say_closed(self, event: SayLine.Closed) -> None:
        self._focus_back(event.back)

    @on(MistakeLine.Chosen)
    def _mistake_chosen(self, event: MistakeLine.Chosen) -> None:
        self.acting.mark(event.task, event.mark)

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
