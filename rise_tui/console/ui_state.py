"""Decides what of the console is saved, and notices changes; `preferences` reads and writes it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec.structs import replace

from rise_engine.run.protocol.registry import session_name
from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, SavedLayout, load_saved, write_saved
from rise_tui.console.screen import ConsoleScreen

SAVE_SECONDS = 1.0
"""Seconds between two checks for changes. A console that is killed loses no more than this."""


class UiState:
    """The saved state of one console. Its methods are quick; they only return what must be written."""

    def __init__(
        self, preferences: Preferences, *, fresh: bool = False, keeps_changes: bool = True, remark: str = ""
    ) -> None:
        """`fresh`: nothing is restored. `remark`: a sentence about the preferences.

        `keeps_changes`: whether anything is written. Observers use the wizard's account and change nothing in it.
        """
        self.preferences = preferences
        self._fresh, self._is_saved, self._remark = fresh, keeps_changes, remark
        self._path: Path | None = None
        self._layout = SavedLayout()
        self._shown: dict[str, object] = {}
        """The preferences on the screen at the last check."""

    def restore(self, screen: ConsoleScreen, theme: str) -> str:
        """Restore the console's last state; returns a sentence when something was not used."""
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
            else:  # a new participant begins with the rule in front, and keeps the lower pane
                screen.pane_layout.restore_state({"lower": layout.layout.get("lower", "")})
            screen.pane_layout.log_pane.show_own_rows(self.preferences.rules_own)
        self._layout, self._shown = _layout_of(screen), _shown_preferences(screen, theme)
        return remark

    def collect_changes(self, screen: ConsoleScreen, theme: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """The changes since the last check."""
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
        """Whether this is a first run, and the program can note that the tour was seen."""
        return self._is_saved and not self._fresh and not self.preferences.tour

    def mark_tour_seen(self) -> list[tuple[Path, Preferences | SavedLayout]]:
        """Note that the tour of the first run was seen."""
        return [self._changed_preferences(tour=True)]

    def keep_wizard(self, name: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """Save the wizard's name, which the next question suggests."""
        if not self._is_saved or self.preferences.wizard == name:
            return []
        return [self._changed_preferences(wizard=name)]

    def _changed_preferences(self, **changed: object) -> tuple[Path, Preferences]:
        """Change the preferences, and keep what another console has written in the meantime."""
        path = state_folder() / PREFERENCES_NAME
        self.preferences = replace(load_saved(path, Preferences)[0], **changed)
        return path, self.preferences


def save_all(changed: Iterable[tuple[Path, Preferences | SavedLayout]]) -> None:
    """Write the changes. May block. A failure is silent, because nothing depends on these files."""
    for path, contents in changed:
        write_saved(path, contents)


def _shown_preferences(screen: ConsoleScreen, theme: str) -> dict[str, object]:
    return {"theme": theme, "rules_own": screen.pane_layout.log_pane.own_rows_shown}


def _layout_of(screen: ConsoleScreen) -> SavedLayout:
    filters = {name: pane.filter_text for name, pane in screen.pane_layout.panes.items() if pane.filter_text}
    return SavedLayout(screen.pane_layout.layout_state(), filters, screen.session.store.attach_reply.folder)
