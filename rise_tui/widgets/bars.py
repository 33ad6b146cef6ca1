"""The console's own bars: status, speech, notice, the study's keys, key hints, and alarms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from rich.cells import cell_len
from textual import events
from textual.geometry import Size

from rise_engine.kernel.wizard_marks import filler_acts, next_filler
from rise_tui.actions import BY_ID, ConsoleAction
from rise_tui.key_labels import first_key_label, key_name, key_text, keys_of, why_unavailable
from rise_tui.model import failures
from rise_tui.model.alarms import alarm_lines, broken_recorders_text, current_alarms, degraded_text, shadow_line
from rise_tui.model.control import action_of_key, control_lost_text
from rise_tui.model.cue import filler_due, passed_text
from rise_tui.model.key_strip import KeyStripPiece, key_strip_height, key_strip_lines
from rise_tui.model.notice import Level, Notice, act_label, short_name
from rise_tui.model.speech import SpeechEffect
from rise_tui.model.speech_band import sentence_height, speech_band_lines
from rise_tui.model.status import status_line
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, TextRole, crop, fit, line_width, plain_text, shorten, wrap
from rise_tui.requests import ActionHost, ConsoleHost
from rise_tui.widgets.lines import StaticLines, StoreLines

NARROW = 100
NOTICE_LINES = 3
GONE_ACTIONS = ("quit", "filter", "next-pane", "help")
"""The remaining actions when nothing runs any more."""
RUNNING = 20
"""Cells for the name of what the stop key for one act would stop."""
FILLER = 18
"""Cells for the name of the next filler among the hints."""

NOTICE_GLYPHS: dict[str, tuple[str, TextRole]] = {
    "info": ("·", "plain"),
    "wait": ("!", "wait"),
    "fault": ("✗", "fault"),
}


class StatusLine(StoreLines):
    """The top line: the running session, its mode, robot and time, and whether keys start anything."""

    DEFAULT_CSS = "StatusLine { background: $rise-bar; }"

    def draw(self) -> None:
        self.show(status_line(self.store, self.size.width))


class NoticeLine(StoreLines):
    """One sentence: a rejection, a fault, an answer to a key, or that a filler is due.

    A longer sentence takes two or three lines, because a cut end could not be shown later.
    """

    def draw(self) -> None:
        notice, width = self.store.notice, self.size.width
        if notice is None:
            self._show_lines(crop(_filler_offer(self.store), width))
            return
        self._show_lines(*notice_lines(notice, width))

    def _show_lines(self, *lines: StyledLine) -> None:
        self.styles.height = len(lines)
        self.show(*lines)


def notice_lines(notice: Notice, width: int) -> list[StyledLine]:
    """A sentence after the glyph of its level, on at most NOTICE_LINES lines; the rest is cut."""
    glyph, role = NOTICE_GLYPHS[notice.level]
    pieces = wrap(notice.text, max(20, width - 3)) if width else [notice.text]
    if len(pieces) > NOTICE_LINES:
        pieces = [*pieces[: NOTICE_LINES - 1], " ".join(pieces[NOTICE_LINES - 1 :])]
    leads = [f" {glyph} ", *["   "] * (NOTICE_LINES - 1)]
    return [crop(((f"{lead}{piece}", role),), width) for lead, piece in zip(leads, pieces, strict=False)]


READING = "reading the study …"


class StudyNotice(StaticLines):
    """One sentence. A longer one takes two or three lines."""

    def __init__(self) -> None:
        super().__init__()
        self._sentence = ""

    @property
    def is_about_reading(self) -> bool:
        """Whether the sentence says that the study is being read."""
        return self._sentence == READING

    def draw(self, sentence: str, level: Level = "info") -> None:
        self._sentence = sentence
        lines = notice_lines(Notice(sentence, level), self.size.width or 80) if sentence else [()]
        self.styles.height = len(lines)
        self.show(*lines)


class KeyHints(StaticLines):
    """The keys of the focused pane and those that always work. Each can be clicked."""

    DEFAULT_CSS = "KeyHints { background: $rise-bar; }"

    def __init__(self) -> None:
        super().__init__()
        self._targets: list[tuple[int, int, str]] = []

    def draw(self, own: Sequence[ConsoleAction], common: Sequence[ConsoleAction], store: Store) -> None:
        if store.gone_reason:
            own = [action for action in own if not why_unavailable(action, store)]  # only reading is left
            common = [BY_ID[id] for id in GONE_ACTIONS]
        pieces = [
            (_hint(action, store, word), action.id)
            for action in dict.fromkeys((*common[:1], *own, *common[1:]))
            if keys_of(action) and (word := _hint_word(action, store, self.size.width))
        ]
        self.show_pieces(pieces)

    def draw_covered(self, store: Store) -> None:
        """Draw the hints below an overlay, which has its own keys."""
        self.show_pieces([*_stop_hint(store), (_key_and_text("esc", "closes what is open"), "")])

    def draw_typing(self, store: Store, enter: str) -> None:
        """Draw the hints for a text field, in which only the stop key works. `enter`: the effect of Enter."""
        self.show_pieces(
            [
                *_stop_hint(store),
                (_key_and_text("enter", enter), ""),
                (_key_and_text("esc", "cancel"), ""),
            ]
        )
        self.show((*self.lines[0], ("  typing: keys start nothing", "muted")))

    def draw_speech_hints(self, store: Store, effect: SpeechEffect, why_not: str) -> None:
        """Draw the hints for free speech: the effect of each of its two keys."""
        room = max(12, (self.size.width - 44) // 2)
        queued, at_once = (fit(text, min(len(text), room)) for text in effect)
        if effect.at_once.partition(" ")[2] == effect.queued.removeprefix("waits for "):
            at_once = "interrupts it"
        now = _key_and_text("^J", at_once) if at_once and at_once != queued else []
        speech_hint: list[StyledSpan] = (
            [(f" {why_not} ", "wait")] if why_not else [*_key_and_text("enter", queued or "says it"), *now]
        )
        rest = [
            _key_and_text("tab", "complete"),
            _key_and_text("↑↓", "earlier"),
            _key_and_text("esc", "keep it for later"),
        ]
        self.show_pieces([*_stop_hint(store), (speech_hint, ""), *((piece, "") for piece in rest)])

    def show_pieces(self, pieces: Sequence[tuple[list[StyledSpan], str]]) -> None:
        """Show as many pieces as fit, and always help. Pieces with an action's id can be clicked."""
        spans: list[StyledSpan] = []
        self._targets.clear()
        kept = sum(line_width(piece) for piece, action in pieces if action == "help")
        for piece, action in pieces:
            start, end = line_width(spans), line_width(spans) + line_width(piece)
            kept = 0 if action == "help" else kept
            if end + kept > self.size.width:
                continue
            if action:
                self._targets.append((start, end - 1, action))
            spans += piece
        self.show(tuple(spans))

    def on_click(self, event: events.Click) -> None:
        for start, end, action in self._targets:
            if start <= event.x < end:
                cast(ActionHost, self.screen).action_do(action)


def next_filler_name(store: Store) -> str | None:
    """The filler that the key would start now."""
    return next_filler(store.scenario, store.view.latest_act_of(filler_acts(store.scenario)))


def _filler_offer(store: Store) -> StyledLine:
    """`2.1 s since the cue: , says R_Filler_Hm`, if it is due, nothing runs, and it is possible."""
    since = filler_due(store.cue_clock, store.now(), store.scenario.fillers.offer_after)
    filler = next_filler_name(store)
    if since is None or filler is None or store.view.running or store.blocked_reason("start"):
        return ()
    key = first_key_label(BY_ID["filler"])
    passed: StyledLine = (("   no answer for ", "plain"), (f"{passed_text(since)} s", "wait"), (":  ", "plain"))
    return (*passed, (key, "key"), (f" says {filler}", "plain"))


def _hint_word(action: ConsoleAction, store: Store, width: int) -> str:
    """The hint line's word for an action; empty: no meaning in this session."""
    if action.id == "filler":
        filler = next_filler_name(store) or ""
        if width < NARROW:  # `Hm` for `R_Filler_Hm`
            filler = filler.rpartition("_")[2] or filler
        return fit(filler, min(len(filler), FILLER))
    if action.id == "stop-running":
        return f"stops {shorten(running_name(store), RUNNING)}" if store.view.running else ""
    if action.id == "safe":
        return "live" if store.input_mode == "SAFE" else "safe"
    if action.id == "lock":
        return "unlock" if store.input_mode == "LOCKED" else "lock"
    if action.id == "quit":
        return "leave" if store.input_mode == "LOCKED" or store.gone_reason else ""
    return action.hint


def running_name(store: Store) -> str:
    """The act that began last and still runs, or the words that are being said; empty: nothing runs."""
    tasks = store.running_tasks
    return act_label(tasks[-1].function, tasks[-1].behavior) if tasks else ""


def _hint(action: ConsoleAction, store: Store, word: str) -> list[StyledSpan]:
    stop, off = action.id == "stop", bool(why_unavailable(action, store))
    key = "F9/^G" if stop else first_key_label(action)
    role: TextRole = "muted" if off else "fault" if stop else "key"
    return [(f" {key}", role), (f" {word} ", "muted" if off else "fault" if stop else "plain")]


def _stop_hint(store: Store) -> list[tuple[list[StyledSpan], str]]:
    """The stop key; nothing if the engine has gone and no key reaches the robot."""
    stop = BY_ID["stop"]
    return [] if store.gone_reason else [(_hint(stop, store, stop.hint), stop.id)]


def _key_and_text(key: str, what: str) -> list[StyledSpan]:
    return [(f" {key}", "key"), (f" {what} ", "plain")]


class SpeechBand(StoreLines):
    """The robot's sentence, in every terminal size, and the next steps without any input."""

    DEFAULT_CSS = "SpeechBand { height: 2; background: $surface; }"

    _sentence_rows = 1

    def fit_terminal(self, size: Size) -> None:
        """Take the lines that this session needs in a terminal of this size."""
        scenario = self.store.scenario
        self._sentence_rows = sentence_height(
            scenario, {**scenario.table_memory, **scenario.memory}, size.width, size.height
        )
        self.styles.height = self._sentence_rows + 1

    def draw(self) -> None:
        self.show(*speech_band_lines(self.store, self.size.width, self._sentence_rows, key_name))


class KeyStrip(StoreLines):
    """The study's own keys. Each can be clicked."""

    DEFAULT_CSS = "KeyStrip { height: 1; background: $surface; }"

    _rows = 1
    _pieces: tuple[KeyStripPiece, ...] = ()

    def fit_terminal(self, size: Size) -> None:
        """Take the lines that the study's keys need in a terminal of this size."""
        self._rows = key_strip_height(self.store.scenario, self.store.study_keys, size.width, size.height)
        self.styles.height = self._rows
        self.display = self._rows > 0

    def draw(self) -> None:
        found = key_strip_lines(self.store, self.size.width, self._rows)
        self._pieces = found.pieces
        self.show(*found.lines)

    def on_click(self, event: events.Click) -> None:
        for key, line, start, end in self._pieces:
            if line == event.y and start <= event.x < end:
                host = cast(ConsoleHost, self.screen)
                if key is not None:
                    host.start(action_of_key(self.store.scenario, key))
                else:
                    host.action_do("help")


MIN_ROWS = 5
"""Lines for a failed act on the smallest terminal: the act, the reason, two for unspoken text, the keys."""
ROW_SHARE = 4
"""A failed act takes at most one row of this many: the band above also has its first sentence, and panes stay
visible."""


class ShadowBar(StoreLines):
    """Shown while a second wizard, whose keys have no effect, gets the cues of a recorded session."""

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
    """Shown while there is a fault that every wizard must know."""

    DEFAULT_CSS = """
    AlarmBar { height: auto; background: $rise-fault-ground; display: none; }
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
    """One-row lines: a question about control or its loss, a degraded robot, a recorder that does not record."""

    DEFAULT_CSS = """
    AttentionBar { height: 1; background: $rise-wait-ground; display: none; }
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
        text = f" recovered: nothing begins until somebody takes control: {key_text('control')} "
        return ((text, "call"),)
    if store.control_lost is not None and not store.has_control:
        return ((f" {control_lost_text(store.control_lost, key_text('control'))} ", "call"),)
    if store.asker is not None:
        return ((f" {short_name(store.asker)} asks for control: {key_text('control')} to answer ", "call"),)
    return ()


def _recorders_line(store: Store, width: int) -> StyledLine:
    """Broken recorders, in red over the whole row."""
    text = broken_recorders_text(store)
    return ((f" {text} " + " " * (width - cell_len(text) - 2), "alarm"),) if text else ()


def _degraded_line(store: Store) -> StyledLine:
    text = degraded_text(store)
    return ((f" {text} ", "wait"),) if text else ()


class FailureBar(StoreLines):
    """A failed act and its unspoken text. It stays until it is answered, or the act is repeated."""

    DEFAULT_CSS = """
    FailureBar { height: auto; background: $rise-fault-ground; display: none; }
    FailureBar.-on { display: block; }
    """

    def draw(self) -> None:
        width, height = self.app.size
        rows = max(MIN_ROWS, height // ROW_SHARE)
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
            cast(ActionHost, self.screen).action_do(max(left_of_click, key=lambda id: columns[id]))
