"""The help: all keys with their effects, from the registry and the scenario. Typing searches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Literal, NamedTuple

from rise_tui.actions import (
    BY_ID,
    EDITOR_ACTIONS,
    KEY_SCOPES,
    STUDY_SCREEN_ACTIONS,
    ConsoleAction,
    KeyScope,
    actions_in,
)
from rise_tui.key_labels import key_label, key_name, key_text, keys_of, why_task_blocked, why_unavailable
from rise_tui.model.filtering import Filter, InvalidFilter, mark_line
from rise_tui.model.notice import task_label
from rise_tui.model.store import Store
from rise_tui.rendering.text import ListRow, StyledLine, crop, fixed_span, wrap
from rise_tui.screens.palette import SearchDialog

WIDE = 90
"""From this width on keys and titles have enough space."""

COMMON: tuple[KeyScope, ...] = ("everywhere", "console")
SCENARIO, IDEAS = "Keys of this scenario", "How it works"


class HelpEntry(NamedTuple):
    """One entry of the help. It is found and shown as a whole, on the lines that it needs."""

    group: str
    keys: str
    title: str
    text: str
    is_blocked: bool = False
    """Whether it cannot be used now. The text gives the reason."""


def help_entries(store: Store, scope: KeyScope | None = None) -> Iterator[HelpEntry]:
    """All entries: the focused pane's first, then global actions, the concepts, the scenario's keys, the rest."""
    titles = dict(KEY_SCOPES)
    if scope is not None:
        yield from (_action_entry(action, f"Here: {titles[scope]}", store) for action in actions_in(scope))
    for common in COMMON:
        yield from (_action_entry(action, titles[common], store) for action in actions_in(common))
    yield from (HelpEntry(IDEAS, word, "", text) for word, text in concepts())
    for key in store.scenario.keys.values():
        why, what = why_task_blocked(store, key.function), task_label(key.function, key.task_behavior)
        act = "CommunicationRobotAct" in key.function
        hold = "hold: needs a second key. " if act and store.scenario.settings_of(key.behavior).hold else ""
        text = f"{f'{what}. ' if key.title else ''}{hold}{f'Not now: {why}.' if why else ''}"
        yield HelpEntry(SCENARIO, key.label, key.title or what, text, bool(why))
    for other, title in KEY_SCOPES:
        if other != scope and other not in (*COMMON, "study", "edit"):  # screens that have their own help
            yield from (_action_entry(action, title, store) for action in actions_in(other))


def screen_help_entries(scope: Literal["study", "edit"]) -> Iterator[HelpEntry]:
    """The entries of a screen on which no key starts anything: that of a study, or the editor."""
    titles = dict(KEY_SCOPES)
    shared, words = (STUDY_SCREEN_ACTIONS, STUDY_CONCEPTS) if scope == "study" else (EDITOR_ACTIONS, EDIT_CONCEPTS)
    yield from (_action_entry(action, titles[scope], None) for action in actions_in(scope))
    yield from (_action_entry(BY_ID[id], titles[scope], None) for id in shared)
    yield from (_action_entry(BY_ID[id], titles["everywhere"], None) for id in ("stop", "quit"))
    yield from (HelpEntry(IDEAS, word, "", text) for word, text in words)


def _action_entry(action: ConsoleAction, group: str, store: Store | None) -> HelpEntry:
    why = why_unavailable(action, store) if store is not None else ""
    text = f"{action.help} Not now: {why}." if why else action.help
    keys = " ".join(key_label(key) for key in keys_of(action)) or key_text("palette")
    return HelpEntry(group, keys, action.title, text, bool(why))


def concepts() -> Iterator[tuple[str, str]]:
    """Words on the screen that no single key explains, and their meanings."""
    safe, lock, release = key_name("safe"), key_name("lock"), key_name("release")
    cue, filler, mistake, control = (key_name(id) for id in ("cue", "filler", "mistake", "control"))
    yield "^X", "Hold ctrl and press X. Short for ctrl+x."
    yield "LIVE", "Keys start acts and rules. The word is in the top line and is about this console only."
    yield "SAFE", f"Look around without starting anything: {safe} turns it on and off. Cue, marks, notes and stop work."
    yield (
        "LOCKED",
        f"For an unattended keyboard: {lock}. Only stop, leave and unlock work; it unlocks to SAFE.",
    )
    yield "STOPPED", f"Somebody stopped everything. Nothing starts on any console until {release} releases the stop."
    yield (
        "next",
        "What happens if nobody acts: a timer, the end of an act, a waiting act. Else what the rules wait for.",
    )
    yield "NOT SAID", "The robot did not say this sentence. It stays here until the next one begins."
    yield "sent", "You asked, and the engine has not answered yet. Only what the engine confirms is shown as done."
    yield "hold", "This act needs its key twice, or its key and Enter, within two seconds. Esc cancels the first press."
    counted = "The top line counts until the robot speaks, with a warning at 1 s and at 2 s."
    kept = "For each act the record has the cue, your key and the start of the robot's voice."
    yield "cue", f"Press {cue} when the participant's turn ends. {counted} {kept}"
    turn = "It is offered when a cue waits long. It starts by itself only if the scenario says so."
    yield "filler", f"A short act to bridge the time: {filler} starts the next one. {turn}"
    went = "The act goes on; only the record changes."
    yield "mistake", f"Right after an act that was wrong, late, early or double: {mistake} and a letter. {went}"
    yield "control", f"Only one console at a time may act. {control} takes, requests, gives or releases control."


STUDY_CONCEPTS = (
    ("→", "The next participant: the first in participants.csv who can begin."),
    ("waiting", "No session yet; the first takes a slot of the plan."),
    ("no consent", "Like waiting, but a required consent has no date in participants.csv."),
    ("unfinished", "A session whose engine has gone: Enter recovers it or gives it up."),
    ("no outcome", "A session ended without an outcome: Enter asks for it."),
    ("in progress", "Some runs are complete; there are more to do."),
    ("aborted", "The last run does not count; the participant keeps the slot and may run it again."),
    ("excluded", "The participant does not count, and the slot goes to the next of the same stratum."),
    ("rehearsal", "Debug, training and pilot sessions take no slot and never count."),
    ("hidden", "The study hides each condition until its session begins."),
)
"""Words on the screen of a study."""

EDIT_CONCEPTS = (
    ("EDIT", "You change files. No key starts anything on a robot; the stop key stops a session of this study."),
    ("unsaved", "Changes stay in a draft until you save. After a lost terminal the draft is offered again."),
    ("✓ ✗ ▲", "No errors; errors, which block saving; warnings, which do not."),
    ("at once", "The action begins with the act. after 3 4: when the actions 3 and 4 have ended."),
    ("wording", "One of several ways to say the same; each time one is picked by chance."),
    ("–", "Not set. The value that applies is shown beside it."),
)
"""Words in the editor."""


class HelpScreen(SearchDialog[None]):
    """The help over the console. Esc closes it."""

    def __init__(self, entries: Iterable[HelpEntry]) -> None:
        super().__init__("Help", "type to search · ↑↓ scroll · esc closes", "search keys, actions and words")
        self._entries = list(entries)

    def draw(self) -> None:
        wanted = self.typed_filter()
        found = [entry for entry in self._entries if self.is_found(wanted, searched_text(entry))]
        self.list.show(help_rows(found, self.list.row_width, wanted))
        self.list.scroll_to(y=0, animate=False)

    def carry_out_key(self, key: str) -> bool:
        moves = {"up": -1, "down": 1, "pageup": 1 - self.list.size.height, "pagedown": self.list.size.height - 1}
        if key in moves:
            self.list.scroll_relative(y=moves[key], animate=False)
        return key in moves


def searched_text(entry: HelpEntry) -> str:
    """The text of an entry for the search: all of it."""
    return f"{entry.keys} {entry.title} {entry.group} {entry.text}"


def help_rows(found: Sequence[HelpEntry], width: int, wanted: Filter | None = None) -> list[ListRow]:
    """Groups under their titles, with each entry on the lines that it needs."""
    made: list[ListRow] = []
    for group, members in groupby(found, key=lambda entry: entry.group):
        if made:
            made.append(ListRow("", (), selectable=False))
        made.append(ListRow("", ((f" {group}", "accent"),), selectable=False))
        for entry in members:
            made += [ListRow(entry.title, line, selectable=False) for line in _entry_lines(entry, width, wanted)]
    return made or [ListRow("", ((" nothing found; esc closes", "muted"),), selectable=False)]


def _entry_lines(entry: HelpEntry, width: int, wanted: Filter | None) -> Iterator[StyledLine]:
    keys, title = (14, 28) if width >= WIDE else (14, 25)
    title = title if entry.title else 0
    lead = keys + title
    texts = wrap(entry.text, max(20, width - lead - 1))
    head: StyledLine = (
        fixed_span(f"  {entry.keys}", keys, "muted" if entry.is_blocked else "key" if entry.title else "strong"),
        fixed_span(entry.title, max(0, title - 1), "muted" if entry.is_blocked else "plain"),
        (" " * min(1, title), "plain"),
    )
    for at_line, text in enumerate(texts):
        line: StyledLine = (*(head if at_line == 0 else ((" " * lead, "plain"),)), (text, "muted"))
        yield _highlight(crop(line, width), wanted)


def _highlight(line: StyledLine, wanted: Filter | None) -> StyledLine:
    try:
        return mark_line(line, wanted)
    except InvalidFilter:
        return line
