"""Sees what of the console is to be found again, and when it has changed; `preferences` reads and writes it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec.structs import replace

from rise_engine.link.places import session_name
from rise_tui.screens.console import ConsoleScreen
from rise_tui.start.paths import CONSOLE, state_folder
from rise_tui.start.preferences import Places, Preferences, load, save

PERIOD = 1.0
"""Seconds between two looks: a console that is killed has lost no more."""


class Keeper:
    """What one console keeps. Its methods are quick; only what they return is written, by `write`."""

    def __init__(self, preferences: Preferences, *, fresh: bool = False, keeps: bool = True, said: str = "") -> None:
        """`fresh`: nothing is restored. `said`: what there is to say about the preferences.

        `keeps`: whether anything is written. Those who only watch use the wizard's account, and change nothing in it.
        """
        self.preferences = preferences
        self._fresh, self._keeps, self._said = fresh, keeps, said
        self._theme = ""
        self._path: Path | None = None
        self._places = Places()
        self._rules_own = False

    def restore(self, screen: ConsoleScreen, theme: str) -> str:
        """Put the console as it was left; returns a sentence when something was not used."""
        self._theme = theme
        self._path = state_folder() / f"{session_name(screen.session.store.scenario.folder)}.json"
        said, self._said = self._said, ""
        if not self._fresh:
            places, trouble = load(self._path, Places)
            said = said or trouble
            if places.session and places.session == screen.session.store.hello.folder:
                screen.panes.restore(places.layout)
                for name, text in places.filters.items():
                    if text and name in screen.panes.panes:
                        screen.panes.panes[name].set_filter(text)
            screen.panes.log_pane.unfold(self.preferences.rules_own)
        self._places = _places(screen)
        self._rules_own = screen.panes.log_pane.unfolded
        return said

    def look(self, screen: ConsoleScreen, theme: str) -> list[tuple[Path, Preferences | Places]]:
        """What has changed since the last look."""
        changed: list[tuple[Path, Preferences | Places]] = []
        if self._path is None or not self._keeps:
            return changed
        places = _places(screen)
        if places != self._places:
            self._places = places
            changed.append((self._path, places))
        if theme != self._theme:
            self._theme = theme
            changed.append(self._common(theme=theme))
        if screen.panes.log_pane.unfolded != self._rules_own:
            self._rules_own = screen.panes.log_pane.unfolded
            changed.append(self._common(rules_own=self._rules_own))
        return changed

    @property
    def tour_is_due(self) -> bool:
        """Whether this is the first run of somebody for whom it can be noted that it was."""
        return self._keeps and not self._fresh and not self.preferences.tour

    def tour_seen(self) -> list[tuple[Path, Preferences | Places]]:
        """The tour of the first run need not be offered again."""
        return [self._common(tour=True)]

    def _common(self, **changed: object) -> tuple[Path, Preferences]:
        """With what another console has written meanwhile."""
        path = state_folder() / CONSOLE
        self.preferences = replace(load(path, Preferences)[0], **changed)
        return path, self.preferences


def write(changed: Iterable[tuple[Path, Preferences | Places]]) -> None:
    """May block; what cannot be written is lost without a word, because nothing depends on it."""
    for path, kept in changed:
        save(path, kept)


def _places(screen: ConsoleScreen) -> Places:
    filters = {name: pane.filter_text for name, pane in screen.panes.panes.items() if pane.filter_text}
    return Places(screen.panes.layout_state(), filters, screen.session.store.hello.folder)
