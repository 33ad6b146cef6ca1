"""Sees what of the console is to be found again, and when it has changed; `preferences` reads and writes it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec.structs import replace

from rise_engine.run.protocol.registry import session_name
from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, SavedLayout, load_saved, write_saved
from rise_tui.console.screen import ConsoleScreen

SAVE_SECONDS = 1.0
"""Seconds between two looks: a console that is killed has lost no more."""


class UiState:
    """What one console keeps. Its methods are quick; only what they return is written, by `write`."""

    def __init__(
        self, preferences: Preferences, *, fresh: bool = False, keeps_changes: bool = True, remark: str = ""
    ) -> None:
        """`fresh`: nothing is restored. `remark`: what there is to say about the preferences.

        `keeps_changes`: whether anything is written. Those who only watch use the wizard's account, and change nothing
        in it.
        """
        self.preferences = preferences
        self._fresh, self._is_saved, self._remark = fresh, keeps_changes, remark
        self._path: Path | None = None
        self._layout = SavedLayout()
        self._shown: dict[str, object] = {}
        """What of the preferences the screen shows, as it was at the last look."""

    def restore(self, screen: ConsoleScreen, theme: str) -> str:
        """Put the console as it was left; returns a sentence when something was not used."""
        self._path = state_folder() / f"{session_name(screen.session.store.scenario.folder)}.json"
        remark, self._remark = self._remark, ""
        if not self._fresh:
            layout, problem = load_saved(self._path, SavedLayout)
            remark = remark or problem
            if layout.session and layout.session == screen.session.store.attach_reply.folder:
                screen.pane_layout.restore_state(layout.layout)
                for name, text in layout.filters.items():
                    if text and name in screen.pane_layout.panes:
                        screen.pane_layout.panes[name].set_filter(text)
            else:  # the next participant begins with the rule in front, and keeps what stands below it
                screen.pane_layout.restore_state({"lower": layout.layout.get("lower", "")})
            screen.pane_layout.log_pane.show_own_rows(self.preferences.rules_own)
        self._layout, self._shown = _layout_of(screen), _shown_preferences(screen, theme)
        return remark

    def collect_changes(self, screen: ConsoleScreen, theme: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """What has changed since the last look."""
        changed: list[tuple[Path, Preferences | SavedLayout]] = []
        if self._path is None or not self._is_saved:
            return changed
        layout, before = _layout_of(screen), self._shown
        if layout != self._layout:
            self._layout = layout
            changed.append((self._path, layout))
        self._shown = _shown_preferences(screen, theme)
        if other := dict(self._shown.items() - before.items()):
            changed.append(self._changed_preferences(**other))
        return changed

    @property
    def tour_is_due(self) -> bool:
        """Whether this is the first run of somebody for whom it can be noted that it was."""
        return self._is_saved and not self._fresh and not self.preferences.tour

    def mark_tour_seen(self) -> list[tuple[Path, Preferences | SavedLayout]]:
        """The tour of the first run need not be offered again."""
        return [self._changed_preferences(tour=True)]

    def keep_wizard(self, name: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """Who sat here last: the name with which the next question begins."""
        if not self._is_saved or self.preferences.wizard == name:
            return []
        return [self._changed_preferences(wizard=name)]

    def _changed_preferences(self, **changed: object) -> tuple[Path, Preferences]:
        """With what another console has written meanwhile."""
        path = state_folder() / PREFERENCES_NAME
        self.preferences = replace(load_saved(path, Preferences)[0], **changed)
        return path, self.preferences


def save_all(changed: Iterable[tuple[Path, Preferences | SavedLayout]]) -> None:
    """May block; what cannot be written is lost without a word, because nothing depends on it."""
    for path, contents in changed:
        write_saved(path, contents)


def _shown_preferences(screen: ConsoleScreen, theme: str) -> dict[str, object]:
    return {"theme": theme, "rules_own": screen.pane_layout.log_pane.own_rows_shown}


def _layout_of(screen: ConsoleScreen) -> SavedLayout:
    filters = {name: pane.filter_text for name, pane in screen.pane_layout.panes.items() if pane.filter_text}
    return SavedLayout(screen.pane_layout.layout_state(), filters, screen.session.store.attach_reply.folder)
