"""The launcher: running sessions, sessions that did not end, and studies, in one list. Enter opens one."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, TypeAlias

from textual import on
from textual.app import ComposeResult

from rise_tui.actions import BY_ID
from rise_tui.config.key_file import KeyFile
from rise_tui.key_labels import first_key_label
from rise_tui.rendering import themes
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    cell_width,
    clean,
    fit_middle,
    fixed_span,
    wrap,
)
from rise_tui.rise_app import RiseApp
from rise_tui.screens.dialog import TitledBox
from rise_tui.screens.palette import SearchDialog
from rise_tui.widgets.lines import RowView, StaticLines

LaunchState: TypeAlias = Literal["running", "unfinished", "recent", "shipped"]
GROUPS: dict[LaunchState, tuple[str, str]] = {
    "running": ("Running", "attaches to it"),
    "unfinished": ("Did not end", "goes on with it"),
    "recent": ("Studies", "opens it"),
    "shipped": ("Examples that come with the program", "opens it"),
}
"""The groups in order, each with its heading and what Enter does."""
READ_AGAIN_SECONDS = 5.0
"""Seconds after which the list is read again: sessions begin and end elsewhere."""
DETAIL_LINES = 3
GAP = "  "
"""Between two columns."""
MIN_PLACE = 16
"""Cells of the folder's column. With less room, only the lines below the list show the folder."""


class LaunchItem(NamedTuple):
    """What can be opened."""

    state: LaunchState
    target: str
    """The name or the socket of a running session; otherwise the folder of a scenario or a study."""
    title: str
    who: str = ""
    """The participant; of a folder: its kind."""
    robot: str = ""
    """Mode and robot."""
    when: str = ""
    where: str = ""
    detail: str = ""
    """More about it, in sentences."""
    session: str = ""
    """The folder of the session to recover; empty: none, or its study offers it."""
    participant: str = ""
    """The participant to select on the study's screen."""
    role: TextRole = "plain"
    """`wait` or `fault`: a session that needs a person."""

    @property
    def id(self) -> str:
        """The id of its row."""
        return f"{self.state}:{self.target}:{self.session}"

    @property
    def cells(self) -> tuple[str, ...]:
        """The text of each column but the last."""
        return self.title, self.who, self.robot, self.when


WIDEST = (40, 22, 16, 16)
"""The largest width of each column; the folder gets the rest."""


def item_lines(items: Sequence[LaunchItem], width: int) -> list[StyledLine]:
    """The rows of items with common columns: which, who, mode and robot, when, where.

    :param width: in cells. The title is cut first, then the folder has no column. A column without texts takes no room.
    """
    columns = [max((cell_width(clean(each.cells[at])) for each in items), default=0) for at in range(len(WIDEST))]
    columns = [min(found, widest) for found, widest in zip(columns, WIDEST, strict=True)]
    others = sum(each + len(GAP) for each in columns[1:] if each)
    columns[0] = max(8, min(columns[0], width - others - 1))
    room = width - 1 - columns[0] - others - len(GAP)
    return [_item_line(each, columns, room) for each in items]


def _item_line(item: LaunchItem, columns: Sequence[int], room: int) -> StyledLine:
    roles: tuple[TextRole, ...] = ("strong", "plain", "muted", "muted")
    spans: list[StyledSpan] = [(" ", "plain")]
    for text, width, role in zip(item.cells, columns, roles, strict=True):
        if width:
            spans += [fixed_span(text, width, role if item.role == "plain" else item.role), (GAP, "plain")]
    if room >= MIN_PLACE:
        spans.append((fit_middle(item.where, room), "muted"))
    return tuple(spans)


class LauncherScreen(SearchDialog[LaunchItem]):
    """The list of what can be opened. The result is the chosen item; None: nothing."""

    DEFAULT_CSS = f"""
    LauncherScreen {{
        #box {{ max-width: 130; height: 1fr; max-height: 100%; }}
        StaticLines {{ height: {DETAIL_LINES}; background: $panel; margin: 1 0 0 0; }}
    }}
    """

    def __init__(self, find: Callable[[], Sequence[LaunchItem]]) -> None:
        """`find`: returns the items in the order of their groups. It may block."""
        super().__init__("Open a session or a study", "", "type to filter")
        self._find, self._items = find, tuple[LaunchItem, ...]()
        self._by_id: dict[str, LaunchItem] = {}
        self._typed: str | None = None
        self._detail = StaticLines()
        self._notice: StyledSpan = "", "muted"
        self._nothing = "reading …"
        """The text of an empty list."""

    def compose(self) -> ComposeResult:
        with TitledBox(self._title):
            yield self.search
            yield self.list
            yield self._detail

    def on_mount(self) -> None:
        super().on_mount()
        self.run_worker(self._read())
        self.set_interval(READ_AGAIN_SECONDS, self._read)

    async def _read(self) -> None:
        self._items, self._nothing = tuple(await asyncio.to_thread(self._find)), "nothing found"
        if self.list.row_width > 0:
            self.draw()

    @property
    def detail(self) -> str:
        """The text below the list."""
        return " ".join(self._detail.text.split())

    @property
    def current(self) -> LaunchItem | None:
        """The item under the cursor."""
        return self._by_id.get(self.list.current_id)

    def draw(self) -> None:
        wanted = self.typed_filter()
        found = [each for each in self._items if self.is_found(wanted, " ".join((*each.cells, each.where)))]
        self._by_id = {each.id: each for each in found}
        lines: dict[str, StyledLine] = {}
        for states in (("running", "unfinished"), ("recent", "shipped")):  # sessions have more columns than folders
            alike = [each for each in found if each.state in states]
            lines |= zip((each.id for each in alike), item_lines(alike, self.list.row_width), strict=True)
        rows: list[ListRow] = []
        for state, (heading, _) in GROUPS.items():
            group = [ListRow(each.id, lines[each.id]) for each in found if each.state == state]
            blank = [ListRow("", (), selectable=False)] if rows and group else []
            rows += [*blank, ListRow("", ((f" {heading}", "accent"),), selectable=False), *group] if group else []
        before = self.list.current_id
        self.list.show(rows or [ListRow("", ((f" {self._nothing}", "muted"),), selectable=False)])
        if self._typed != self.search.value:
            self._typed = self.search.value
            self.list.displaced_at = float("-inf")  # the person requested this cursor position
            free = [row.selectable and not (self._typed and row.id.startswith("unfinished:")) for row in rows]
            self.list.move_cursor(free.index(True) if True in free else -1, by_wizard=False)
        current = self.current
        if current is not None and current.state == "unfinished" and current.id != before:
            self.list.move_cursor(-1, by_wizard=False)  # Enter recovers only a session that the person has chosen
        self._show_detail()

    @on(RowView.CursorMoved)
    def _show_detail(self) -> None:
        """Show the keys, and more about the item under the cursor."""
        item = self.current
        verb = f"enter {GROUPS[item.state][1]} · " if item is not None else ""
        stop = f"{first_key_label(BY_ID['stop'])} stops what runs · " if self._running_items else ""
        self.query_one(TitledBox).border_subtitle = f" {verb}↑↓ choose · {stop}esc leaves "
        detail = " · ".join(filter(None, (item.detail, item.where))) if item is not None else ""
        text, role = self._notice if self._notice[0] else (detail, "muted")
        lines = wrap(text, max(20, self.list.row_width - 2))[:DETAIL_LINES]
        self._detail.show(*(((f" {line}", role),) for line in [*lines, *[""] * (DETAIL_LINES - len(lines))]))

    def carry_out_key(self, key: str) -> bool:
        self._notice = "", "muted"
        if key != "enter":
            return super().carry_out_key(key)
        if (item := self.current) is None:
            self.list.action_step(1)
        elif not self.list.was_just_displaced:
            self.dismiss(item)
        return True

    @property
    def _running_items(self) -> list[LaunchItem]:
        return [each for each in self._items if each.state == "running"]

    async def stop_running(self, stop: Callable[[str], str]) -> None:
        """Stop everything in all running sessions, and say whether it reached them.

        :param stop: stops one session and returns why it was not reached, or nothing. It may block.
        """
        running = self._running_items
        reasons = await asyncio.gather(*(asyncio.to_thread(stop, each.target) for each in running))
        failed = "; ".join(f"{item.title}: {why}" for item, why in zip(running, reasons, strict=True) if why)
        if failed:
            self._notice = f"THE STOP DID NOT REACH A SESSION, use its console: {failed}", "fault"
        elif reasons:
            told = "STOPPED: every running session was told to stop everything. Its console releases the stop."
            self._notice = told, "wait"
        else:
            self._notice = "No session is running here: there is nothing to stop.", "wait"
        await self._read()


class LauncherApp(RiseApp):
    """Shows the launcher. `run` returns the chosen item; None: nothing."""

    def __init__(
        self,
        find: Callable[[], Sequence[LaunchItem]],
        stop: Callable[[str], str],
        *,
        theme: str = themes.DEFAULT,
        keys: KeyFile | None = None,
    ) -> None:
        """`find`: as for `LauncherScreen`. `stop`: as for `LauncherScreen.stop_running`."""
        super().__init__(theme, keys or KeyFile())
        self.launcher = LauncherScreen(find)
        self._stop = stop

    def on_mount(self) -> None:
        self.push_screen(self.launcher, self.exit)

    def action_do(self, action: str) -> None:
        """Carry out an action that works everywhere."""
        if action == "stop":
            self.run_worker(self.launcher.stop_running(self._stop))
        elif action == "quit":
            self.exit()
