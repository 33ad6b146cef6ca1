"""Lists that are searched while typing, and the command palette: some letters, and Enter carries out the command."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Generic, Literal, NamedTuple

from textual import events, on
from textual.app import App, ComposeResult
from textual.screen import ScreenResultType
from textual.widgets import Input

from rise_engine.author.drawing.rule_text import ENDINGS
from rise_engine.author.drawing.study_keys import ACT, EVENT, RULE, SET, key_title
from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.scenario.model import KeyBinding, normal_topic
from rise_tui.actions import (
    ACTIONS,
    AT_ONCE,
    BY_ID,
    EDITOR_ACTIONS,
    KEY_SCOPES,
    STUDY_SCREEN_ACTIONS,
    ConsoleAction,
    KeyScope,
    actions_in,
)
from rise_tui.key_labels import first_key_label, why_blocked, why_task_blocked, why_unavailable
from rise_tui.model.control import KeyAction, action_of_key, start_action
from rise_tui.model.filtering import Filter, InvalidFilter
from rise_tui.model.resumption import start_summary
from rise_tui.model.speech import act_texts
from rise_tui.model.store import Store
from rise_tui.rendering import themes
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    align_at_both_ends,
    crop,
    fixed_span,
    highlight_matches,
    line_width,
)
from rise_tui.screens.dialog import SingleDismissModal, TitledBox
from rise_tui.widgets.bars import running_name
from rise_tui.widgets.fields import TextField
from rise_tui.widgets.lines import CURSOR_BACKGROUND, RowList, RowView


class FoundList(RowList, can_focus=False):
    """The list. The keys stay with the line above; Enter goes to the list's cursor."""

    DEFAULT_CSS = "FoundList { background: $panel; }"

    def background_of(self, index: int) -> str:
        return CURSOR_BACKGROUND if index == self.cursor else ""


class SearchDialog(SingleDismissModal[ScreenResultType], Generic[ScreenResultType]):
    """A box to search in. Esc closes it; the result is the chosen item, or None."""

    DEFAULT_CSS = """
    SearchDialog {
        align: center top; background: transparent;
        #box { width: 100%; max-width: 100; height: 1fr; max-height: 40; margin: 1 0 1 0; }
        TextField, TextField:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, title: str, keys: str, placeholder: str) -> None:
        super().__init__()
        self._title, self._keys = title, keys
        self.search = TextField(placeholder=placeholder, select_on_focus=False)
        self.list = FoundList()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, self._keys):
            yield self.search
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.search)

    @abstractmethod
    def draw(self) -> None:
        """Show the matches of the typed text."""

    def typed_filter(self) -> Filter | None:
        """The typed text as a filter; None: empty or invalid."""
        try:
            return Filter(self.search.value) or None
        except InvalidFilter:
            return None

    def is_found(self, wanted: Filter | None, text: str) -> bool:
        try:
            return wanted is None or wanted.matches(text)
        except InvalidFilter:
            return True

    @on(Input.Changed)
    @on(RowView.Resized)
    def _changed(self) -> None:
        if self.list.row_width > 0:
            self.draw()

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            self.dismiss(None)
        elif not self.carry_out_key(event.key):
            return
        event.stop()
        event.prevent_default()

    def carry_out_key(self, key: str) -> bool:
        """Carry out a key that is not text; False: it is text."""
        if key in ("up", "down"):
            self.list.action_step(-1 if key == "up" else 1)
        elif key in ("pageup", "pagedown"):
            self.list.action_page(-1 if key == "pageup" else 1)
        else:
            return False
        return True


THEME = "theme"


class PaletteCommand(NamedTuple):
    """One line of the palette."""

    title: str
    kind: str
    """Its kind in a word: act, rule, event, theme, or the place of an action."""
    key: str
    help: str
    blocked_text: str
    run: Callable[[], None]
    theme: str = ""
    """The theme to show while the cursor is on the line."""
    acts: bool = False
    """Whether it changes the session or the robot without a further question."""
    words: str = ""
    """What the robot may say, to search for."""


def palette_commands(
    store: Store, scope: KeyScope | None, run: Callable[[str], None], start: Callable[[KeyAction], None]
) -> Iterator[PaletteCommand]:
    """The stop of what runs, the focused pane's actions, the inputs that rules wait for, other actions, acts, rules."""
    titles = dict(KEY_SCOPES)
    running = BY_ID["stop-running"]
    own = [action for action in ACTIONS if action.scope == scope]
    first = ("palette", *([running.id] if store.view.running else []))
    rest = [action for action in ACTIONS if action.scope not in (scope, "study", "edit") and action.id not in first]

    def of_action(action: ConsoleAction, kind: str) -> PaletteCommand:
        why, key = why_unavailable(action, store), first_key_label(action)
        return PaletteCommand(
            action.title, kind, key, action.help, why, partial(run, action.id), acts=action.id in AT_ONCE
        )

    if store.view.running:
        stop = KeyAction("cancelTask", str(store.running_tasks[-1].id))  # the one that the row names
        yield of_action(running, "")._replace(title=f"Stop {running_name(store)}", run=partial(start, stop))
    yield from (of_action(action, "here") for action in own)
    yield from _expected_events(store, start)
    for action in rest:
        yield of_action(action, "" if action.scope in ("everywhere", "console") else titles[action.scope].lower())
    yield from _scenario_commands(store, start)


def screen_commands(scope: Literal["study", "edit"], run: Callable[[str], None]) -> Iterator[PaletteCommand]:
    """The commands of a screen on which no key starts anything: that of a study, or the editor."""
    shared = STUDY_SCREEN_ACTIONS if scope == "study" else EDITOR_ACTIONS
    for action in (*actions_in(scope), *(BY_ID[id] for id in shared if id not in ("palette", "theme"))):
        yield PaletteCommand(action.title, "", first_key_label(action), action.help, "", partial(run, action.id))


def _expected_events(store: Store, start: Callable[[KeyAction], None]) -> Iterator[PaletteCommand]:
    """Events that a running rule waits for and that no act or rule raises itself at its end."""
    topics = store.expected_inputs().events
    own = {name + ending for name in (*store.scenario.acts, *store.scenario.rules) for ending in ENDINGS}
    why = why_blocked(store, "start")
    for topic in sorted(topics - own):
        action = KeyAction("raiseEventTopic", topic)
        key = store.key_of(action.function, topic)
        help = f"raise this event{_author_title(key)}: a running rule waits for it"
        yield PaletteCommand(topic, "event", key.label if key else "", help, why, partial(start, action), acts=True)


def _scenario_commands(store: Store, start: Callable[[KeyAction], None]) -> Iterator[PaletteCommand]:
    scenario, why = store.scenario, why_blocked(store, "start")
    expected_inputs = store.expected_inputs()
    for kind, function, names, expected in (
        ("act", ACT, scenario.acts, expected_inputs.acts),
        ("rule", RULE, scenario.rules, expected_inputs.rules),
    ):
        for name in names:
            action, key = start_action(scenario, function, name), store.key_of(function, name)
            waited = "; a running rule waits for it" if name in expected else ""
            help = f"{start_summary(store, action)}{_author_title(key)}{waited}"
            words = " ".join(act_texts(scenario, name, store.memory)) if kind == "act" else ""
            label = key.label if key else ""
            yield PaletteCommand(name, kind, label, help, why, partial(start, action), acts=True, words=words)
    for key in scenario.keys.values():
        action = action_of_key(scenario, key)
        if key.function == EVENT and normal_topic(key.behavior) not in expected_inputs.events:
            help, why = "raise this event; no running rule waits for it now", why_task_blocked(store, key.function)
            yield PaletteCommand(
                key_title(key), "event", key.label, f"{key.behavior}: {help}", why, partial(start, action), acts=True
            )
        elif key.function == SET:
            why = why_task_blocked(store, key.function)
            yield PaletteCommand(key_title(key), "set", key.label, key.behavior, why, partial(start, action), acts=True)
        elif key.function == RULE and key.task_behavior != key.behavior:
            help = f"start this rule: {describe_behavior(key.function, key.task_behavior)}"
            blocked = why_blocked(store, "start")
            yield PaletteCommand(key_title(key), "rule", key.label, help, blocked, partial(start, action), acts=True)


def _author_title(key: KeyBinding | None) -> str:
    """The author's title, as words to search for."""
    return f": {key.title}" if key is not None and key.title else ""


def theme_commands(choose: Callable[[str], None]) -> Iterator[PaletteCommand]:
    """One line for each theme; moving over it shows the theme."""
    for theme in themes.THEMES:
        name = theme.name.removeprefix("rise-")
        yield PaletteCommand(name, THEME, "", "use this theme", "", partial(choose, theme.name), theme.name)


class PaletteHit(NamedTuple):
    """A matching command, and the places of the match in its title."""

    command: PaletteCommand
    spans: Sequence[tuple[int, int]] = ()


def search_commands(all_of_them: Iterable[PaletteCommand], typed: str) -> list[PaletteHit]:
    """The matches of the typed text, the best first; all commands in order if the text is empty or invalid."""
    try:
        wanted = Filter(typed)
        if not wanted:
            return [PaletteHit(command) for command in all_of_them]
        ranked: list[tuple[tuple[int, ...], PaletteHit]] = []
        for command in all_of_them:
            if wanted.matches(named := f"{command.title}  {command.kind}"):
                spans = [span for span in wanted.match_spans(named) if span[1] <= len(command.title)]
                start, end = (spans[0][0], spans[-1][1]) if spans else (len(named), len(named))
                ranked.append(((0, len(spans) or 1, end - start, start), PaletteHit(command, spans)))
            elif wanted.matches(f"{command.key} {command.kind} {command.title}  {command.help} {command.words}"):
                ranked.append(((1,), PaletteHit(command)))
        return [hit for _, hit in sorted(ranked, key=lambda each: each[0])]
    except InvalidFilter:  # an unfinished expression
        return [PaletteHit(command) for command in all_of_them]


TITLE_WIDTH = 30
CHOOSE_KEYS = "↑↓ choose · enter runs it · esc closes"
KEY_WIDTH = 7
"""Cells. The longest keys are `space` and `bksp`."""


class Palette(SearchDialog[PaletteCommand]):
    """The palette on the screen. Moving over a theme shows it; Esc leaves everything unchanged."""

    DEFAULT_CSS = """
    Palette #box { max-width: 92; height: auto; }
    Palette FoundList { height: 13; }
    """

    def __init__(self, commands: Sequence[PaletteCommand], placeholder: str) -> None:
        super().__init__("Command", CHOOSE_KEYS, placeholder)
        self._commands = commands
        self._hits: list[PaletteHit] = []
        self._theme_before = ""

    def on_mount(self) -> None:
        super().on_mount()
        self._theme_before = self.app.theme

    def draw(self) -> None:
        self._hits = search_commands(self._commands, self.search.value)
        width = self.list.row_width
        rows = [ListRow(f"{at}", _hit_line(hit, width)) for at, hit in enumerate(self._hits)]
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])
        # Nothing that acts is chosen before the wizard has seen it: the first Enter chooses, the second carries out.
        self.list.move_cursor(0 if rows and not self._hits[0].command.acts else -1, by_wizard=False)
        self._show_keys(CHOOSE_KEYS)
        self.list.scroll_to(y=0, animate=False)
        self._preview()

    def carry_out_key(self, key: str) -> bool:
        if key == "enter":
            self._choose()
        elif super().carry_out_key(key):
            self._preview()
        else:
            return False
        return True

    @property
    def current(self) -> PaletteCommand | None:
        """The command that Enter would carry out."""
        return self._hits[self.list.cursor].command if 0 <= self.list.cursor < len(self._hits) else None

    def _preview(self) -> None:
        current = self.current
        wanted = current.theme if current is not None and current.theme else self._theme_before
        if wanted and self.app.theme != wanted:
            self.app.theme = wanted

    def _choose(self) -> None:
        chosen = self.current
        if chosen is None and self._hits:
            self.list.move_cursor(0, by_wizard=False)
            self._show_keys(f"enter again: {self._hits[0].command.title}")
        if chosen is not None:
            self._theme_before = chosen.theme or self._theme_before
            self.dismiss(chosen)

    def _show_keys(self, keys: str) -> None:
        self.query_one(TitledBox).border_subtitle = f" {keys} "

    def on_unmount(self) -> None:
        if self._theme_before and self.app.theme != self._theme_before:
            self.app.theme = self._theme_before


def open_palette(
    app: App[object],
    commands: Iterable[PaletteCommand],
    placeholder: str = "command or theme",
    *,
    refuse: Callable[[str], None] = lambda why: None,
) -> None:
    """Open the palette with commands, and with the themes after them.

    :param refuse: receives the reason if a command cannot be carried out now.
    """

    def use_theme(name: str) -> None:
        app.theme = name

    def carry_out(command: PaletteCommand | None) -> None:
        if command is not None and command.blocked_text:
            refuse(f"{command.title}: not now, {command.blocked_text}")
        elif command is not None:
            command.run()

    app.push_screen(Palette([*commands, *theme_commands(use_theme)], placeholder), carry_out)


def _hit_line(hit: PaletteHit, width: int) -> StyledLine:
    command = hit.command
    off = bool(command.blocked_text)
    shown = fixed_span(command.title, TITLE_WIDTH, "muted" if off else "plain")
    title = highlight_matches((shown,), [span for span in hit.spans if span[1] < TITLE_WIDTH])
    key: StyledSpan = fixed_span(command.key, KEY_WIDTH, "muted" if off else "key")
    state: StyledSpan = (f"not now: {command.blocked_text}", "wait") if off else (command.help, "muted")
    kind: StyledLine = ((f" {command.kind} ", "muted"),) if command.kind else ()
    left: StyledLine = ((" ", "plain"), *title, (" ", "plain"), key, state)
    room = width - line_width(kind)
    return align_at_both_ends(crop(left, room - 1), kind, width)
