"""The console: connects keys, lists, panes and bars to the session. It never waits for the engine (console.md 5.1)."""

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

from rise_engine.run.protocol.client import ControlVerb
from rise_tui.actions import BY_ID, KeyScope, bindings_in
from rise_tui.console import overlays
from rise_tui.console.bars import ConsoleBars
from rise_tui.console.input import CHANGE_SECONDS, InputController, line_opener
from rise_tui.console.layout import Layout
from rise_tui.console.questions import Confirmations
from rise_tui.console.session import ConsoleSession
from rise_tui.key_labels import why_unavailable
from rise_tui.model.control import MARK_CUE, NEXT_FILLER, UNDO_CUE, KeyAction
from rise_tui.model.notice import Level, Notice, act_label
from rise_tui.model.resumption import armed_text
from rise_tui.model.store import Store, StorePart
from rise_tui.rendering.terminal_app import repaint_everything
from rise_tui.rise_app import is_editing, takes_text
from rise_tui.screens.dialog import shows_screen_below
from rise_tui.screens.help import HelpScreen, help_entries
from rise_tui.screens.palette import open_palette, palette_commands
from rise_tui.screens.tour import TourScreen, is_tour_due, show_when_too_small
from rise_tui.widgets.fields import MistakeLine, NoteLine
from rise_tui.widgets.lines import StaticLines
from rise_tui.widgets.speech_input import SpeechInput

CLOCK_SECONDS, RUNNING_SECONDS = 1.0, 0.5
"""Seconds between updates of the clock, and of running times while something runs."""


class ConsoleScreen(Screen[None]):
    """One session on one terminal."""

    BINDINGS = bindings_in("console")

    DEFAULT_CSS = "ConsoleScreen { layout: vertical; background: $background; }"

    class OpenSettings(Message):
        """The wizard requests the settings. The app can start sessions."""

    class LineOpened(Message):
        """A line that takes Enter has opened."""

    def __init__(self, session: ConsoleSession) -> None:
        super().__init__()
        self.session = session
        self.pane_layout = Layout(session.store)
        self.bars = ConsoleBars(session.store, self.pane_layout, self.set_timer)
        self._kept_note = ""
        """A typed note that was not accepted."""
        self.confirmations = Confirmations(self)
        self.input = InputController(session.store, self, self.set_timer)

    @property
    def store(self) -> Store:
        return self.session.store

    def compose(self) -> ComposeResult:
        self.bars.fit_terminal(self.app.size)
        yield from self.bars.widgets_above()
        yield self.pane_layout
        yield from self.bars.widgets_below()

    @property
    def kept_rows(self) -> int:
        """The rows above the lists and panes. They stay in view above overlays."""
        return self.pane_layout.region.y

    def on_mount(self) -> None:
        self.session.on_change = self._store_changed
        self.run_worker(self.session.receive_records(), name="pump", exit_on_error=True)
        self.set_interval(CLOCK_SECONDS, self.bars.draw_every_second)
        self.set_interval(CLOCK_SECONDS, self.input.note_alive)
        self.set_interval(RUNNING_SECONDS, self.bars.draw_every_half_second)
        self.pane_layout.focus_pane("acts")

    def _store_changed(self, parts: frozenset[StorePart] | set[StorePart]) -> None:
        if "flash" in parts and self.store.flash is not None:  # immediately: a camera records the moment
            overlays.show_flash(self.app, self.store.flash.number)
        self.bars.schedule(parts)
        if parts & {"status", "acts"}:
            self.confirmations.close_outdated_control_question()
            self.confirmations.close_outdated_release_question()

    def on_resize(self) -> None:
        self.bars.fit_terminal(self.app.size)
        show_when_too_small(self.app, self.store)

    def on_screen_suspend(self) -> None:
        self._set_covered(not shows_screen_below(self.app.screen))

    def _set_covered(self, covered: bool) -> None:
        """Show that keys of the study have no effect while something else takes them."""
        if self.store.is_covered != covered:
            self.store.is_covered = covered
            self.bars.draw_keys()

    def on_screen_resume(self, event: events.ScreenResume) -> None:
        self._set_covered(False)
        if self.stack_updates == 0:  # at first, mounting has just styled everything
            event.refresh_styles = False
        show_when_too_small(self.app, self.store)

    @on(StaticLines.DrawAgain)
    def _draw_again(self) -> None:
        self.bars.draw_all()

    @on(events.DescendantFocus)
    @on(events.DescendantBlur)
    def _hint_for_focus(self) -> None:
        self.bars.draw_hints()

    # --- keys -----------------------------------------------------------------------------------------------------

    @property
    def _is_typing(self) -> bool:
        """Whether keys are letters, or commands of the editor, which start nothing on a robot."""
        return takes_text(self.app.focused) or is_editing(self.app)

    def observe_key(self, event: events.Key, together: bool) -> None:
        """Note every key before anything acts on it, whatever has the focus. `together`: it came with others."""
        self.bars.dismiss_read_notices()
        self.input.observe_key(event.key, event.time, typing=self._is_typing, together=together)

    def admits(self, event: events.Event) -> bool:
        """Whether a keyboard or mouse event may pass. All of them pass here, with or without a dialog."""
        leaving = self.app.screen.has_class("-quit")
        if isinstance(event, events.Key):
            return self.input.admits_key(
                event.key, printable=event.is_printable, typing=self._is_typing, leaving=leaving
            )
        if isinstance(event, events.MouseDown):
            self.input.observe_mouse()
        return self.input.admits_other(leaving=leaving, says_why=isinstance(event, events.MouseDown | events.Paste))

    def handle_key_first(self, event: events.Key) -> bool:
        """Open a line in which letters have another meaning, so that even a very quick next key goes to that line.

        It also carries out the scenario's keys, so that none overtakes another. It acts only without a dialog or field
        for the key.
        """
        if self.app.screen is not self or isinstance(self.focused, Input):
            return False
        if self.bars.mistake_line.takes(event.key):
            return False
        if opener := line_opener(event.key):
            self.action_do(opener)
        elif event.key in self.store.scenario.keys or (event.key == "enter" and self.input.is_armed):
            self.on_key(event)
        else:
            return False
        return True

    def on_key(self, event: events.Key) -> None:
        """Handle keys that nothing else has taken."""
        if isinstance(self.focused, Input):
            return
        self.bars.mistake_line.close()
        if self.input.handle_key(event.key, event.time):
            event.stop()
            event.prevent_default()

    # --- effects of keys: InputActions ------------------------------------------------------------------------------

    def submit(self, action: KeyAction, pressed: float | None) -> None:
        self._run_beside(self.session.submit(action.function, action.behavior, action.calling_type, pressed))

    def submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        self.bars.speech_input.accept(typed)
        self._run_beside(self._submit_speech(action, typed, pressed))

    async def _submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        if not await self.session.submit(action.function, action.behavior, action.calling_type, pressed):
            self.bars.speech_input.restore(typed)

    def show_armed(self, action: KeyAction | None) -> None:
        self.store.armed = action
        if action is not None:
            self.show_notice(armed_text(self.store, action), "wait")
        else:
            self.bars.clear_notice()
        self.bars.schedule({"acts", "rules"})

    def show_mode(self) -> None:
        self.bars.schedule({"acts", "rules", "status", "tasks"})

    def ask_what_was_wrong(self, task: int) -> None:
        self.bars.open_mistake(task)

    def leave_transient(self) -> None:
        pane = self.pane_layout.focused_pane()
        if not (pane is not None and pane.leave_transient()):
            self.pane_layout.unzoom()

    # --- requests of panes and hints --------------------------------------------------------------------------------

    def _run_beside(self, work: Coroutine[Any, Any, object]) -> None:
        """Run a request to the engine in the background."""
        self.run_worker(work, group="send")

    def start(self, action: KeyAction) -> None:
        """Request a start, with all protection against accidents."""
        self.input.start(action)

    def send(self, function: str, behavior: str = "") -> None:
        """Send a task to the engine, without waiting."""
        self.input.send(function, behavior)

    def ignore_keys(self) -> None:
        """Let no key start anything for a moment, after a question has closed by itself."""
        self.input.ignore_keys()

    def request_control(self, verb: ControlVerb) -> None:
        """Take, ask for, give or release control, without waiting."""
        self._run_beside(self.session.change_control(verb))

    def show_notice(self, text: str, level: Level = "info") -> None:
        """Show the wizard a notice."""
        self.session.show_notice(Notice(text, level))

    def focus_pane(self, name: str) -> None:
        """Bring a pane to the front and give it the focus."""
        self.pane_layout.focus_pane(name)

    def show_selection(self, pane: str, name: str) -> None:
        """Show another act or rule in its pane."""
        if pane == "acts":
            self.store.shown_act = name
        else:
            self.store.shown_rule = name
        self.bars.repaint_panes("act", "rule")

    def ask_to_start(self, rule: str, state: str) -> None:
        """Ask whether to start a rule in one of its states."""
        self.confirmations.ask_to_start(rule, state)

    def ask_to_step_back(self, rule: str) -> None:
        """Ask whether a rule should go back one step."""
        self.confirmations.ask_to_step_back(rule)

    # --- actions of the registry --------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or show why not."""
        if action == "control" and self.store.attach_reply.shadow:
            action = "pause"  # no other client could have control
        if reason := why_unavailable(BY_ID[action], self.store):
            self.show_notice(f"{BY_ID[action].title}: not now, {reason}")
            return
        if BY_ID[action].scope in self.pane_layout.panes:
            self.pane_layout.panes[BY_ID[action].scope].action_do(action)
            return
        self.action_calls()[action]()

    def action_calls(self) -> dict[str, Callable[[], object]]:
        """The methods that carry out the actions of no pane."""
        return {
            "stop": self.stop_all,
            "stop-running": self._stop_running,
            "quit": lambda: self.app.run_worker(self.app.run_action("quit")),
            "palette": self._open_palette,
            "help": lambda: self.app.push_screen(HelpScreen(help_entries(self.store, self._focused_scope))),
            "jump": lambda: overlays.open_jump_mode(self, self.pane_layout, self.bars.key_hints.region),
            "tour": self.open_tour,
            "redraw": lambda: repaint_everything(self.app),
            "lists": self.pane_layout.focus_next_list,
            "next-pane": self.pane_layout.focus_next_pane,
            "previous-pane": lambda: self.pane_layout.focus_next_pane(-1),
            "zoom": self.pane_layout.toggle_zoom,
            "filter": self._open_filter,
            "settings": lambda: self.post_message(self.OpenSettings()),
            "take-over": lambda: self._run_beside(self.session.take_over_files()),
            "theme": lambda: open_palette(self.app, (), "theme"),
            "edit-study": self._edit_study,
            "release": self.confirmations.ask_to_release,
            "cancel-open": lambda: self.send("cancelOpenGoals"),
            "control": self.confirmations.ask_about_control,
            "pause": lambda: self._run_beside(self.session.toggle_pause()),
            "note": self._open_note,
            "say": self._open_speech,
            "cue": lambda: self.start(MARK_CUE),
            "undo-cue": lambda: self.start(UNDO_CUE),
            "filler": lambda: self.start(NEXT_FILLER),
            "mistake": self.input.mark_mistake,
            "repeat": self.input.repeat_failed_act,
            "go-on": self.input.go_on_without_failed_act,
            "stop-rule": self.input.stop_rule_of_failed_act,
            "safe": self.input.switch_safe,
            "lock": self.switch_lock,
        }

    def stop_all(self) -> None:
        """Handle the stop key: without question or condition, from any screen."""
        self.input.disarm()
        self.send("stopAll")
        self.confirmations.close_release_question()

    def _stop_running(self) -> None:
        """Stop the act that began last, which the hint names.

        If it began just before the key, and not by this wizard, the key was meant for the one before it.
        """
        *others, newest = self.store.running_tasks
        name = act_label(newest.function, newest.behavior)
        if newest.source != self.store.person and self.store.now() - (newest.started or 0.0) < CHANGE_SECONDS:
            self.show_notice(f"{name} has just begun; press again to stop it")
            return
        self.send("cancelTask", str(newest.id))
        goes_on = f"; {act_label(others[-1].function, others[-1].behavior)} goes on" if others else ""
        self.show_notice(f"stopping {name}{goes_on}")

    def switch_lock(self) -> None:
        """Lock the keyboard, or unlock it."""
        if self.store.input_mode != "LOCKED":
            overlays.close_all_above(self)
        self.input.switch_lock()

    @property
    def _focused_scope(self) -> KeyScope | None:
        pane = self.pane_layout.focused_pane()
        return pane.SCOPE if pane is not None else None

    def _open_palette(self) -> None:
        """Open the palette with all commands, the focused pane's actions first."""
        commands = palette_commands(self.store, self._focused_scope, self.action_do, self.start)
        open_palette(self.app, commands, "command, act, rule, event or theme", refuse=self.show_notice)

    def _edit_study(self) -> None:
        store = self.store
        opens = overlays.open_editor(self.app, store.scenario.folder, self.show_notice, runs=not store.gone_reason)
        self.app.run_worker(opens)

    # --- the tour -----------------------------------------------------------------------------------------------------

    def open_tour(self, seen: Callable[[], None] | None = None) -> None:
        """Open the tour. `seen` is called at its end, in any case."""
        self.pane_layout.unzoom()
        tour = TourScreen(self._region_of, lambda: self.pane_layout.region)
        self.app.push_screen(tour, lambda _: seen() if seen is not None else None)

    def offer_tour(self, seen: Callable[[], None]) -> None:
        """Offer the tour on a first run, if it disturbs nothing."""
        if is_tour_due(self.store):
            self.open_tour(seen)

    def _region_of(self, name: str) -> Region:
        """The place of a part of the screen for the tour."""
        panes, hints = self.pane_layout, self.bars.key_hints.region
        match name:
            case "status":
                return self.bars.status_line.region
            case "acts":
                return panes.panes["acts"].region
            case "watching":
                shown = (pane.region for pane in panes.visible_panes() if pane.SCOPE not in ("acts", "rules"))
                return next(shown, panes.region)
            case "stop":
                return hints
            case _:
                return Region(hints.x + hints.width // 3, hints.y, 2 * hints.width // 3, hints.height)

    def _open_note(self) -> None:
        self.bars.open_note(self._kept_note)
        self.post_message(self.LineOpened())

    def _open_speech(self) -> None:
        self.bars.speech_input.open()
        self.post_message(self.LineOpened())

    def _open_filter(self) -> None:
        pane = self.pane_layout.focused_pane()
        if pane is not None:
            pane.open_filter()

    # --- lines that open ----------------------------------------------------------------------------------------------

    @on(SpeechInput.Speak)
    def _speak(self, event: SpeechInput.Speak) -> None:
        self.input.speak(event.typed, event.text, at_once=event.at_once)

    @on(SpeechInput.ReturnFocus)
    def _return_focus(self, event: SpeechInput.ReturnFocus) -> None:
        self._focus_back(event.back)

    @on(MistakeLine.EndMarking)
    def _end_marking(self, event: MistakeLine.EndMarking) -> None:
        self.bars.notice_line.display = True
        if self.focused in (None, self.bars.mistake_line):
            self._focus_back(event.back)

    def _focus_back(self, widget: Widget | None) -> None:
        """Return the focus to its place before a line was opened, if that is still visible."""
        is_visible = widget is not None and widget.is_attached and widget.display and widget.visible
        self.set_focus(widget if is_visible else self.pane_layout.panes["acts"].row_view)

    @on(NoteLine.SaveNote)
    def _save_note(self, event: NoteLine.SaveNote) -> None:
        self.bars.notice_line.display = True
        self._focus_back(event.back)
        if event.text:
            self._run_beside(self._send_note(event.text))

    async def _send_note(self, text: str) -> None:
        self._kept_note = "" if await self.session.add_note(text) else text
