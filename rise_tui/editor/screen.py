"""The screen of the editor: top line, page, first diagnostic, banner and key hints; pages, keys, search.

It covers a console or the screen of a study, or is alone in `rise-tui edit`. No key starts anything on a robot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Horizontal

from rise_tui.actions import EDITOR_ACTIONS, bindings_in, bindings_of
from rise_tui.config.key_file import KeyFile
from rise_tui.editor.act_page import ActPage
from rise_tui.editor.data_pages import KeysPage, MemoryPage, SettingsPage
from rise_tui.editor.dialogs import AskText, Picked, PickList, choose_finding
from rise_tui.editor.frame import StudyFrame
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.study_rows import row_id
from rise_tui.editor.page import BannerLine, EditHints, EditPage, EditTopLine, FindingLine
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.study import EditedStudy, Explorer, SessionWatch
from rise_tui.editor.study_page import StudyPage
from rise_tui.editor.tables_page import TablesPage
from rise_tui.editor.texts_page import TextsPage
from rise_tui.rendering import themes
from rise_tui.rendering.terminal_app import repaint_everything
from rise_tui.rise_app import RiseApp
from rise_tui.screens.help import HelpScreen, screen_help_entries
from rise_tui.screens.palette import open_palette, screen_commands
from rise_tui.screens.tour import show_when_too_small
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import RowView, StaticLines

PAGES: dict[str, type[EditPage]] = {
    page.KIND: page
    for page in (StudyPage, ActPage, RulePage, TextsPage, MemoryPage, KeysPage, SettingsPage, TablesPage)
}
"""The pages by their kind. To add one, see `rise_tui.editor.page`."""
WIDE = 110
"""Minimum columns for the list of the study beside an open page."""


class EditScreen(StudyFrame):
    """Implements `rise_tui.editor.page.EditFrame`."""

    DEFAULT_CSS = """
    EditScreen { layout: vertical; background: $background; }
    EditScreen #body { height: 1fr; }
    EditScreen #body.-page.-wide StudyPage { width: 44; }
    EditScreen #body.-page.-narrow StudyPage { display: none; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [*bindings_in("edit"), *bindings_of(*EDITOR_ACTIONS)]

    def __init__(
        self,
        study: EditedStudy,
        *,
        sessions: SessionWatch | None = None,
        notice: str = "",
        may_suspend: bool = True,
        explorer: Explorer | None = None,
    ) -> None:
        """`notice`: the first sentence. The rest is as for `StudyFrame`."""
        super().__init__(study, sessions=sessions, may_suspend=may_suspend, explorer=explorer)
        self._first_notice = notice
        self.home = StudyPage(self)
        self.opened: EditPage | None = None
        """The page over, or beside, the list of the study."""
        self.top, self.findings, self.banner, self.hints = EditTopLine(), FindingLine(), BannerLine(), EditHints()
        self.find_bar = PromptBar("find ", "a name, a text; esc clears")

    def compose(self) -> ComposeResult:
        yield self.top
        with Horizontal(id="body"):
            yield self.home
        yield self.find_bar
        yield self.notice
        yield self.findings
        yield self.banner
        yield self.hints

    def on_mount(self) -> None:
        self._lay_out()
        self.set_focus(self.home.first_focus)
        if self._first_notice:
            self.say(self._first_notice, "wait")
        self.begin()

    # --- the frame for pages ----------------------------------------------------------------------------------------

    @property
    def page(self) -> EditPage:
        """The page that gets the keys."""
        return self.opened or self.home

    def open_page(self, kind: str, name: str = "", *, back: tuple[str, str] | None = None) -> None:
        make = PAGES.get(kind)
        if make is None:
            self.say(f"a {kind} is changed in its file: e opens it in your editor", "wait")
            return
        page = make(self, name)
        page.back = back
        self._start_job(self._show_page(page))

    async def _show_page(self, page: EditPage) -> None:
        before, self.opened = self.opened, page
        self._lay_out()
        await self.query_one("#body").mount(page)
        if before is not None:
            await before.remove()
        self.set_focus(page.first_focus)
        self.home.rows.select(row_id(page.KIND, page.shown_name))  # also after a diagnostic led here
        page.draw()
        self.draw_bars()

    def close_page(self) -> None:
        if self.opened is not None and self.opened.back is not None:
            self.open_page(*self.opened.back)
        else:
            self._start_job(self._close_page())

    async def _close_page(self) -> None:
        page, self.opened = self.opened, None
        self._lay_out()
        self.set_focus(self.home.first_focus)
        if page is not None:
            await page.remove()
        self.draw()

    def ask_text(self, title: str, text: str, take: Callable[[str], None], *, hint: str = "") -> None:
        def taken(typed: str | None) -> None:
            if typed:
                self.attempt(lambda: take(typed))

        self.app.push_screen(AskText(title, text, hint), taken)

    def choose(
        self,
        title: str,
        choices: Sequence[FieldChoice],
        take: Callable[[str], None],
        *,
        now: str = "",
        new: str = "",
        enter: str = "takes it",
    ) -> None:
        def taken(picked: Picked | None) -> None:
            if picked is not None:
                self.attempt(lambda: take(picked.value))

        self.app.push_screen(PickList(title, choices, now=now, new=new, enter=enter), taken)

    # --- drawing ----------------------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        body = self.query_one("#body")
        body.set_class(self.opened is not None, "-page")
        body.set_class(self.app.size.width >= WIDE, "-wide")
        body.set_class(self.app.size.width < WIDE, "-narrow")

    def on_resize(self) -> None:
        self._lay_out()
        show_when_too_small(self.app, None)

    @on(StaticLines.DrawAgain)
    @on(RowView.Resized)
    def draw(self) -> None:
        """Draw everything from the present draft."""
        if self.opened is not None and not self.opened.content_exists:
            self.close_page()
            return
        self.home.draw()
        if self.opened is not None:
            self.opened.draw()
        self.draw_bars()

    @on(RowView.CursorMoved)
    @on(events.DescendantFocus)
    def draw_bars(self) -> None:
        place = self.page.place
        self.top.draw(self.study.draft, self.study.busy)
        about = self.page.KIND, self.page.shown_name, self.page.shown_state
        self.findings.draw(self.study.draft, place.file if place is not None else "", self.explored, about)
        self.banner.draw(self.running.sentence if self.running is not None else "")
        if self.page.is_typing:
            self.hints.draw_typing()
        else:
            stops = self.running is not None or self._sessions is None
            self.hints.draw(self.page.hints, self.page.own_hints, stops=stops)

    # --- actions of the registry ------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry that works here; the page comes first."""
        if self.page.is_typing and action not in ("stop", "quit"):
            return
        call = self.page.calls.get(action) or self._calls.get(action)
        if call is not None:
            self.attempt(call)

    @property
    def _calls(self) -> Mapping[str, Callable[[], object]]:
        return {
            "edit.undo": lambda: self._start_job(self._undo()),
            "edit.redo": lambda: self._start_job(self._redo()),
            "edit.save": lambda: self._start_job(self._ask_to_save()),
            "edit.findings": lambda: choose_finding(self, self.app),
            "edit.file": lambda: self._start_job(self._open_file()),
            "edit.pages": self._go_home,
            "edit.leave": self._leave,
            "filter": self._open_find,
            "help": lambda: self.app.push_screen(HelpScreen(screen_help_entries("edit"))),
            "palette": lambda: open_palette(self.app, screen_commands("edit", self.action_do)),
            "theme": lambda: open_palette(self.app, (), "theme"),
            "redraw": lambda: repaint_everything(self.app),
            "stop": self.stop_pressed,
            "quit": lambda: self.app.run_worker(self.app.run_action("quit")),
        }

    def _go_home(self) -> None:
        if self.opened is not None:
            self._start_job(self._close_page())

    # --- find ---------------------------------------------------------------------------------------------------------

    def _open_find(self) -> None:
        """Search the page, or the list of the study if the page has nothing to search."""
        if self.opened is not None and not self.opened.CAN_FILTER:
            self._start_job(self._find_in_list())
        else:
            self.find_bar.open("")

    async def _find_in_list(self) -> None:
        await self._close_page()
        self.find_bar.open("")

    @on(PromptBar.Edited)
    def _find(self, event: PromptBar.Edited) -> None:
        self.page.filter(event.bar.text)

    @on(PromptBar.Accepted)
    def _found(self) -> None:
        self._close_find()

    @on(PromptBar.Cancelled)
    def _given_up(self) -> None:
        self.page.filter("")
        self._close_find()

    def _close_find(self) -> None:
        self.find_bar.close()
        self.set_focus(self.page.first_focus)

    def _leave(self) -> None:
        if self.page.leave():
            self.draw_bars()
        elif self.opened is not None:
            self.close_page()
        else:
            self.ask_to_leave()


class EditApp(RiseApp):
    """Shows the editor of one study until the author leaves it."""

    def __init__(
        self,
        study: EditedStudy,
        *,
        sessions: SessionWatch,
        theme: str = themes.DEFAULT,
        keys: KeyFile | None = None,
        notice: str = "",
        explorer: Explorer | None = None,
    ) -> None:
        """`explorer`: as for `EditScreen`."""
        super().__init__(theme, keys or KeyFile())
        self.edit_screen = EditScreen(study, sessions=sessions, notice=notice, explorer=explorer)

    async def on_mount(self) -> None:
        await self.push_screen(self.edit_screen, lambda _: self.exit())

    def action_do(self, action: str) -> None:
        if action == "stop":
            self.edit_screen.stop_pressed()
        elif action == "quit":
            self.run_worker(self.action_quit())

    async def action_quit(self) -> None:
        if self.screen is self.edit_screen:
            self.edit_screen.ask_to_leave()
        else:
            self.exit()
