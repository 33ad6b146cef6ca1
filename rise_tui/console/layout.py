"""The places of lists and panes, two or all of them, by the terminal's size, and their saved state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Literal

from msgspec.structs import replace
from textual import events
from textual.app import ComposeResult
from textual.containers import Container, Vertical

from rise_engine.run.protocol.client import AttachReply
from rise_engine.run.protocol.registry import session_name
from rise_tui.config.preferences import (
    MAX_FOLDERS,
    PREFERENCES_NAME,
    Preferences,
    SavedLayout,
    load_saved,
    state_folder,
    write_saved,
)
from rise_tui.model.store import Store
from rise_tui.panes.log import LogPane
from rise_tui.panes.memory import MemoryPane
from rise_tui.panes.pane import Pane
from rise_tui.panes.rule import RulePane
from rise_tui.panes.start_lists import ActsPane, RulesPane
from rise_tui.panes.tasks import ActPane, SchedulerPane
from rise_tui.screens.dialog import place_overlays

LayoutKind = Literal["column", "one", "two", "all"]

START_LISTS = ("acts", "rules")
UPPER = ("rule", "act", "memory")
LOWER = ("log", "scheduler")
MONITORING = (*UPPER, *LOWER)

COLUMN_BELOW = 70
"""A terminal of fewer columns shows one list or pane at a time."""
ONE_PANE_BELOW = (80, 24)
"""A smaller terminal has room for only one monitoring pane."""


def layout_for(width: int, height: int) -> LayoutKind:
    """Two monitoring panes from 80x24 on, all from 180 columns and 30 rows, one in less; below 70 columns, one list or
    pane alone."""
    if width < COLUMN_BELOW:
        return "column"
    if width < ONE_PANE_BELOW[0] or height < ONE_PANE_BELOW[1]:
        return "one"
    return "all" if width >= 180 and height >= 30 else "two"


def is_narrow(width: int) -> bool:
    """Whether monitoring panes take the place of the lists."""
    return width < 100


class Layout(Container):
    """The control area on the left, monitoring on the right."""

    DEFAULT_CSS = """
    Layout {
        layout: horizontal; height: 1fr;
        #control { width: 38; border-right: vkey $rise-bar; }
        #rules { height: auto; max-height: 40%; min-height: 4; }
        #monitoring { width: 1fr; layout: vertical; }
        #upper { height: 3fr; } #lower { height: 2fr; }
        &.-two { #control { width: 52; } }
        &.-narrow { #control { width: 38; } }
        &.-all {
            #control { width: 60; }
            #monitoring { layout: horizontal; }
            #upper { width: 1fr; height: 1fr; border-right: vkey $rise-bar; }
            #lower { width: 1fr; height: 1fr; }
            #rule { height: 3fr; } #act { height: 2fr; } #log { height: 1fr; }
            #memory, #scheduler { height: auto; max-height: 35%; }
            #memory RowList, #scheduler RowList { height: auto; max-height: 100%; min-height: 1; }
        }
        &.-zoom {
            #control, #upper { width: 1fr; border-right: none; }
            #rules { height: 1fr; max-height: 100%; }
        }
    }
    """

    def __init__(self, store: Store) -> None:
        super().__init__()
        self.log_pane = LogPane(store)
        monitoring: list[Pane] = [
            RulePane(store),
            ActPane(store),
            MemoryPane(store),
            self.log_pane,
            SchedulerPane(store),
        ]
        panes: list[Pane] = [ActsPane(store), RulesPane(store), *monitoring]
        self.panes: dict[str, Pane] = {pane.SCOPE: pane for pane in panes}
        self._groups = {
            "control": Vertical(id="control"),
            "monitoring": Container(id="monitoring"),
            "upper": Vertical(id="upper"),
            "lower": Vertical(id="lower"),
        }
        self._active = {"upper": "rule", "lower": "log"}
        self._front = "rule"
        self._layout_kind: LayoutKind = "one"
        self._zoomed = ""
        self._last_focused = START_LISTS[0]
        self.panes["rules"].styles.height = max(4, len(store.scenario.rules) + 1)

    def compose(self) -> ComposeResult:
        self._arrange()  # now: a class added later would style and lay out everything twice
        with self._groups["control"]:
            yield from (self.panes[name] for name in START_LISTS)
        with self._groups["monitoring"]:
            with self._groups["upper"]:
                yield from (self.panes[name] for name in UPPER)
            with self._groups["lower"]:
                yield from (self.panes[name] for name in reversed(LOWER))

    def on_mount(self) -> None:
        self.call_after_refresh(self._mount_hidden)

    def _mount_hidden(self) -> None:
        """Create the hidden panes once the first frame is on the terminal."""
        for pane in self.panes.values():
            pane.mount_contents()

    def on_resize(self, event: events.Resize) -> None:
        self._arrange_and_repaint()
        place_overlays(self.app)

    def focused_pane(self) -> Pane | None:
        """The list or pane with the focus."""
        return next((pane for pane in self.panes.values() if pane.has_focus_within), None)

    def visible_panes(self) -> Iterator[Pane]:
        """The panes that are visible now."""
        return (pane for name, pane in self.panes.items() if self._is_shown(name))

    def focus_pane(self, name: str) -> None:
        """Bring a pane to the front and give it the focus."""
        if name in UPPER:
            self._active["upper"] = self._front = name
        elif name in LOWER:
            self._active["lower"] = self._front = name
        if self._zoomed:
            self._zoomed = name
        self._last_focused = name
        self._arrange_and_repaint()
        self.screen.set_focus(self.panes[name].row_view)  # `Widget.focus` repaints the whole list

    def focus_next_list(self) -> None:
        self.focus_pane("rules" if self.panes["acts"].has_focus_within else "acts")

    def focus_next_pane(self, step: int = 1) -> None:
        """Go to the next monitoring pane (-1: the previous one); from the control area to the one in front."""
        here = self.focused_pane()
        if here is None or here.SCOPE in START_LISTS:
            self.focus_pane(self._front)
        else:
            self.focus_pane(MONITORING[(MONITORING.index(here.SCOPE) + step) % len(MONITORING)])

    def toggle_zoom(self) -> None:
        """Give the focused pane all the room, or restore the layout."""
        here = self.focused_pane()
        self._zoomed = "" if self._zoomed or here is None else here.SCOPE
        self._arrange_and_repaint()

    @property
    def _alone(self) -> str:
        """The only visible list or pane; empty: there are several."""
        return self._zoomed or (self._last_focused if self._layout_kind == "column" else "")

    @property
    def is_zoomed(self) -> bool:
        return bool(self._zoomed)

    def layout_state(self) -> dict[str, str]:
        """The panes in front and the pane with the focus, for the next start. A zoom is not saved."""
        here = self.focused_pane()
        return {**self._active, "front": self._front, "focus": here.SCOPE if here is not None else "acts"}

    def restore_state(self, state: Mapping[str, str]) -> None:
        """Restore the result of `layout_state`. Unknown panes have no effect."""
        for group, names in (("upper", UPPER), ("lower", LOWER)):
            if state.get(group) in names:
                self._active[group] = state[group]
        if state.get("front") in MONITORING:
            self._front = state["front"]
            self._active["upper" if self._front in UPPER else "lower"] = self._front
        focus = state.get("focus", "")
        self.focus_pane(focus if focus in self.panes else "acts")

    def unzoom(self) -> None:
        if self._zoomed:
            self.toggle_zoom()

    def _is_shown(self, name: str) -> bool:
        if self._alone:
            return name == self._alone
        if name in START_LISTS or self._layout_kind == "all":
            return True
        if self._layout_kind == "two":
            return name in self._active.values()
        return name == self._front

    def _tabs(self, name: str) -> tuple[str, ...]:
        if self._layout_kind == "column" and not self._zoomed:
            return tuple(self.panes)
        if self._zoomed or name in START_LISTS or self._layout_kind == "all":
            return (name,)
        if self._layout_kind == "two":
            return UPPER if name in UPPER else LOWER
        return MONITORING

    def _title(self, name: str) -> str:
        title = self.panes[name].TITLE
        return f"{title} · zoomed, esc goes back" if self._zoomed else title

    def _arrange_and_repaint(self) -> None:
        self._arrange()
        self.call_after_refresh(self._repaint_visible)

    def _arrange(self) -> None:
        """Show and hide panes by the size of the terminal, the tabs and the zoom."""
        self._layout_kind = layout_for(*self.app.size)
        self.set_class(self._layout_kind == "two", "-two")
        self.set_class(self._layout_kind == "all", "-all")
        self.set_class(is_narrow(self.app.size.width), "-narrow")
        self.set_class(bool(self._alone), "-zoom")
        for name, pane in self.panes.items():
            pane.display = self._is_shown(name)
            if pane.display and pane.is_mounted:
                pane.mount_contents()
            pane.title.show_tabs(tuple((tab, self._title(tab)) for tab in self._tabs(name)))
        for group, names in (("control", START_LISTS), ("monitoring", MONITORING), ("upper", UPPER), ("lower", LOWER)):
            self._groups[group].display = any(self._is_shown(name) for name in names)

    def _repaint_visible(self) -> None:
        for pane in self.visible_panes():
            pane.repaint()


SAVE_SECONDS = 1.0
"""Seconds between two checks for changes, the most that a killed console loses."""


class UiState:
    """The saved state of one console. Its methods are quick; they only return what must be written."""

    def __init__(
        self, preferences: Preferences, *, fresh: bool = False, keeps_changes: bool = True, remark: str = ""
    ) -> None:
        """`fresh`: nothing is restored. `remark`: a sentence about the preferences.

        `keeps_changes`: whether anything is written. Observers use the wizard's account without changing it.
        """
        self.preferences = preferences
        self._fresh, self._is_saved, self._remark = fresh, keeps_changes, remark
        self._path: Path | None = None
        self._folder = ""
        """The folder of the session."""
        self._layout = SavedLayout()
        self._shown: dict[str, object] = {}
        """The preferences on the screen at the last check."""

    def restore(self, panes: Layout, attached: AttachReply, theme: str) -> str:
        """Restore the console's last state. Returns a sentence if something was not used."""
        self._path = state_folder() / f"{session_name(attached.scenario.folder)}.json"
        remark, self._remark = self._remark, ""
        if not self._fresh:
            layout, problem = load_saved(self._path, SavedLayout)
            remark = remark or problem
            if layout.session and layout.session == attached.folder:
                panes.restore_state(layout.layout)
                for name, text in layout.filters.items():
                    if text and name in panes.panes:
                        panes.panes[name].set_filter(text)
            else:  # a new participant begins with the rule in front, and keeps the lower pane
                panes.restore_state({"lower": layout.layout.get("lower", "")})
            panes.log_pane.show_own_rows(self.preferences.rules_own)
        self._folder = attached.folder
        self._layout, self._shown = self._layout_of(panes), _shown_preferences(panes, theme)
        return remark

    def collect_changes(self, panes: Layout, theme: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """The changes since the last check."""
        changed: list[tuple[Path, Preferences | SavedLayout]] = []
        if self._path is None or not self._is_saved:
            return changed
        layout, before = self._layout_of(panes), self._shown
        if layout != self._layout:
            self._layout = layout
            changed.append((self._path, layout))
        self._shown = _shown_preferences(panes, theme)
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

    def save_wizard_name(self, name: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """Save the wizard's name, which the next question suggests."""
        if not self._is_saved or self.preferences.wizard == name:
            return []
        return [self._changed_preferences(wizard=name)]

    def save_folder(self, folder: str) -> list[tuple[Path, Preferences | SavedLayout]]:
        """Note the use of a scenario's or a study's folder, for the launcher."""
        if not self._is_saved:
            return []
        used = load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].folders
        others = [(each, when) for each, when in used.items() if each != folder][: MAX_FOLDERS - 1]
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        return [self._changed_preferences(folders={folder: now, **dict(others)})]

    def _layout_of(self, panes: Layout) -> SavedLayout:
        filters = {name: pane.filter_text for name, pane in panes.panes.items() if pane.filter_text}
        return SavedLayout(panes.layout_state(), filters, self._folder)

    def _changed_preferences(self, **changed: object) -> tuple[Path, Preferences]:
        """Change the preferences, and keep the changes that another console has written meanwhile."""
        path = state_folder() / PREFERENCES_NAME
        self.preferences = replace(load_saved(path, Preferences)[0], **changed)
        return path, self.preferences


def save_all(changed: Iterable[tuple[Path, Preferences | SavedLayout]]) -> None:
    """Write the changes. May block. A failure is silent, because nothing depends on these files."""
    for path, contents in changed:
        write_saved(path, contents)


def _shown_preferences(panes: Layout, theme: str) -> dict[str, object]:
    return {"theme": theme, "rules_own": panes.log_pane.own_rows_shown}
