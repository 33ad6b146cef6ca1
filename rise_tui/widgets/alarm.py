"""The bars that nobody can miss: red for a stop, a disk, a link, a robot, an engine, an act; amber for control."""

from __future__ import annotations

from rich.cells import cell_len
from textual import events

from rise_tui.key_labels import key_name, key_text
from rise_tui.messages import RunAction
from rise_tui.model import failures
from rise_tui.model.alarms import alarm_lines, broken_recorders_text, current_alarms, degraded_text, shadow_line
from rise_tui.model.control import control_lost_text
from rise_tui.model.notice import short_name
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, crop, plain_text
from rise_tui.widgets.static_lines import StoreLines

LEAST_ROWS = 5
"""Lines for a failed act on the smallest terminal: which act, why, two for what was not said, the keys."""
ROW_SHARE = 4
"""A failed act takes at most one row of this many: the band above also has its first sentence, and panes stay
visible."""


class ShadowBar(StoreLines):
    """Shown while a second wizard, whose keys reach nobody, gets the cues of a recorded session."""

    DEFAULT_CSS = """
    ShadowBar { height: 1; background: $accent 25%; display: none; }
    ShadowBar.-on { display: block; }
    """

    def draw(self) -> None:
        width = self.size.width or self.app.size.width
        line = shadow_line(self.store, key_name, width)
        self.set_class(bool(line), "-on")
        self.show(crop(line, width))


class AlarmBar(StoreLines):
    """Shown while something is wrong that every wizard must know."""

    DEFAULT_CSS = """
    AlarmBar { height: auto; background: $error 18%; display: none; }
    AlarmBar.-on { display: block; }
    """

    counts = False
    """Whether its text changes every second."""

    def draw(self) -> None:
        found = current_alarms(self.store, key_name)
        self.counts = any(alarm.counts_seconds for alarm in found)
        shown = alarm_lines(found)
        self.set_class(bool(shown), "-on")
        self.styles.height = max(1, len(shown))
        width = self.size.width
        self.show(*(crop(line, width) if width else line for line in shown))


class AttentionBar(StoreLines):
    """One-row lines: somebody asks for or has taken control, a robot works only partly, a camera does not record."""

    DEFAULT_CSS = """
    AttentionBar { height: 1; background: $warning 18%; display: none; }
    AttentionBar.-on { display: block; }
    AttentionBar.-two { height: 2; }
    AttentionBar.-three { height: 3; }
    """

    def draw(self) -> None:
        store = self.store
        width = self.size.width
        lines = (_control_line(store), _recorders_line(store, width), _degraded_line(store))
        shown = [] if store.gone_reason else [line for line in lines if line]
        self.set_class(bool(shown), "-on")
        self.set_class(len(shown) == 2, "-two")
        self.set_class(len(shown) == 3, "-three")
        self.show(*(crop(line, width) if width else line for line in shown))


def _control_line(store: Store) -> StyledLine:
    if store.attach_reply.replay:
        return ()
    if store.view.waits_for_wizard:
        said = f" recovered: nothing begins until somebody takes control: {key_text('control')} "
        return ((said, "call"),)
    if store.control_lost is not None and not store.has_control:
        return ((f" {control_lost_text(store.control_lost, key_text('control'))} ", "call"),)
    if store.asker is not None:
        return ((f" {short_name(store.asker)} asks for control: {key_text('control')} to answer ", "call"),)
    return ()


def _recorders_line(store: Store, width: int) -> StyledLine:
    """Broken recorders, in red over the whole row."""
    said = broken_recorders_text(store)
    return ((f" {said} " + " " * (width - cell_len(said) - 2), "alarm"),) if said else ()


def _degraded_line(store: Store) -> StyledLine:
    said = degraded_text(store)
    return ((f" {said} ", "wait"),) if said else ()


class FailureBar(StoreLines):
    """A failed act, and what was not said. It stays until somebody answers it, or the act is repeated."""

    DEFAULT_CSS = """
    FailureBar { height: auto; background: $error 18%; display: none; }
    FailureBar.-on { display: block; }
    """

    def draw(self) -> None:
        width, height = self.app.size
        rows = max(LEAST_ROWS, height // ROW_SHARE)
        shown = failures.failure_lines(self.store, self.size.width or width, rows, key_name)
        self.set_class(bool(shown), "-on")
        self.styles.height = max(1, len(shown))
        self.show(*shown)

    def on_click(self, event: events.Click) -> None:
        """Make each key in the last line clickable, with the words after it."""
        if event.y != len(self.lines) - 1:
            return
        line = plain_text(self.lines[-1])
        columns = {id: line.find(key_name(id)) for id in ("repeat", "go-on", "stop-rule")}
        left_of_click = [id for id, at in columns.items() if 0 <= at <= event.x]
        if left_of_click:
            self.post_message(RunAction(max(left_of_click, key=lambda id: columns[id])))
