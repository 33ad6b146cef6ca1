"""The frame of the editor: top line, the page, what is wrong, what is to be known, key hints; save, undo, find, back.

It lies over a console, over the screen of a study, or alone in `rise-tui edit`. No key starts anything on a robot.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Horizontal
from textual.screen import Screen

from rise_engine.author.edit.drafts import Draft
from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Change
from rise_engine.base.text import clean
from rise_tui.actions import IN_EDITOR, bindings_in, bindings_of
from rise_tui.editor import dialogs, external
from rise_tui.editor.bars import BannerLine, EditHints, EditTopLine, FindingLine
from rise_tui.editor.dialogs import SaveDialog, choose_finding
from rise_tui.editor.exploring import Explorer, ExploringBeside
from rise_tui.editor.model.draft import StudyDraft, count, is_study_alone
from rise_tui.editor.model.explored import ExploredStudy
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.study_rows import row_id
from rise_tui.editor.page import EditPage
from rise_tui.editor.pages import PAGES
from rise_tui.editor.pick_list import AskText, Picked, PickList
from rise_tui.editor.study import EditedStudy, NoSessions, RunningHere, SessionWatch
from rise_tui.editor.study_page import StudyPage
from rise_tui.messages import RunAction
from rise_tui.model.notice import Level
from rise_tui.rendering.later import Later
from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.too_small import TooSmallScreen, is_too_small
from rise_tui.typed_ahead import EDITOR
from rise_tui.widgets.prompt_bar import PromptBar
from rise_tui.widgets.row_list import RowView
from rise_tui.widgets.static_lines import StaticLines
from rise_tui.widgets.study_bars import StudyNotice

WATCH_SECONDS = 2.0
"""How soon it is seen that a file has changed outside, or that a session has begun."""
WIDE = 110
"""Columns from which the list of the study stays beside an open page."""


class EditScreen(Screen[None]):
    """Implements `rise_tui.editor.page.EditFrame`."""

    DEFAULT_CSS = """
    EditScreen { layout: vertical; background: $background; }
    EditScreen #body { height: 1fr; }
    EditScreen #body.-page.-wide StudyPage { width: 44; }
    EditScreen #body.-page.-narrow StudyPage { display: none; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [*bindings_in("edit"), *bindings_of(*IN_EDITOR)]

    def __init__(
        self,
        study: EditedStudy,
        *,
        sessions: SessionWatch | None = None,
        notice: str = "",
        may_suspend: bool = True,
        explorer: Explorer | None = None,
    ) -> None:
        """`sessions`: finds a session that runs meanwhile; None: the console below has the stop key.

        `explorer`: explores the study when it has been opened, and each time that it was saved; None: nobody does.

        `may_suspend`: whether another program may have the terminal for a while: not where a session runs here.
        """
        super().__init__(classes=EDITOR)
        self.study, self._sessions = study, sessions or NoSessions()
        self._may_suspend, self._first_notice = may_suspend, notice
        self._exploring = ExploringBeside(explorer)
        self.running: RunningHere | None = None
        self._has_stop = sessions is not None
        self.home = StudyPage(self)
        self.opened: EditPage | None = None
        """The page over, or beside, the list of the study."""
        self.top, self.findings, self.banner = EditTopLine(), FindingLine(), BannerLine()
        self.notice, self.hints = StudyNotice(), EditHints()
        self.find_bar = PromptBar("find ", "a name, a text; esc clears")
        self._is_closing = False
        self._works = 0
        """Pieces of work that keys have begun."""

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
        self.set_interval(WATCH_SECONDS, self._watch)
        self._lay_out()
        self.set_focus(self.home.first_focus)
        if self._first_notice:
            self.say(self._first_notice, "wait")
        self._work(self._offer_draft())
        self._explore()

    def _explore(self) -> None:
        """Explore what is saved now, beside everything else; what an earlier one has not found yet is not wanted."""
        self.workers.cancel_group(self, "explore")
        if not is_study_alone(self.study.draft) and self._exploring.ask(self.study.draft):
            self.run_worker(self._explore_saved(self.study.draft), group="explore")

    async def _explore_saved(self, draft: StudyDraft) -> None:
        await self._exploring.explore(draft)
        self.draw()

    async def _offer_draft(self) -> None:
        """What an earlier editor has not saved is offered before anything is changed."""
        draft = await self.study.read_draft()
        if draft is None:
            return

        def answer(key: str | None) -> None:
            if key == "t":
                self._work(self._take_up(draft))
            elif key == "d":
                self._work(self.study.discard_draft())
            else:
                self.close()

        self.app.push_screen(dialogs.draft_dialog(draft), answer)

    async def _take_up(self, draft: Draft) -> None:
        outside = await self.study.take_up(draft)
        self.say("your changes are restored: ctrl+o saves them")
        self.draw()
        if outside.clash:
            self._ask_about_clash(outside.clash)

    def _ask_about_clash(self, files: Sequence[str]) -> None:
        dialogs.ask_about_clash(self.app, files, lambda: self._work(self._take_outside(files)))

    async def _take_outside(self, files: Sequence[str]) -> None:
        self._said(await self.study.take_outside(files))
        self.draw()

    async def on_unmount(self) -> None:
        await self.study.close()

    # --- the frame, as pages know it --------------------------------------------------------------------------------

    @property
    def explored(self) -> ExploredStudy:
        """What exploring has found."""
        return self._exploring.found

    @property
    def page(self) -> EditPage:
        """The page that gets the keys."""
        return self.opened or self.home

    def say(self, sentence: str, level: Level = "info") -> None:
        self.notice.draw(clean(sentence), level)

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        if edits:
            self._work(self._make(edits, then))

    def work(self, work: Coroutine[Any, Any, str]) -> None:
        self._work(self._and_say(work))

    async def _and_say(self, work: Coroutine[Any, Any, str]) -> None:
        sentence = await work
        self.say(sentence)
        self.draw()

    async def _make(self, edits: Sequence[AnyEdit], then: Callable[[], None] | None) -> None:
        change = await self.study.apply(*edits)
        self._said(change)
        self.draw()
        if then is not None:
            then()

    def open_page(self, kind: str, name: str = "", *, back: tuple[str, str] | None = None) -> None:
        make = PAGES.get(kind)
        if make is None:
            self.say(f"a {kind} is changed in its file: e opens it in your editor", "wait")
            return
        page = make(self, name)
        page.back = back
        self._work(self._show_page(page))

    async def _show_page(self, page: EditPage) -> None:
        before, self.opened = self.opened, page
        self._lay_out()
        await self.query_one("#body").mount(page)
        if before is not None:
            await before.remove()
        self.set_focus(page.first_focus)
        self.home.rows.select(row_id(page.KIND, page.shown_name))  # also where a finding has led here
        page.draw()
        self.draw_bars()

    def close_page(self) -> None:
        if self.opened is not None and self.opened.back is not None:
            self.open_page(*self.opened.back)
        else:
            self._work(self._close_page())

    async def _close_page(self) -> None:
        page, self.opened = self.opened, None
        self._lay_out()
        self.set_focus(self.home.first_focus)
        if page is not None:
            await page.remove()
        self.draw()

    def ask_text(self, title: str, text: str, take: Callable[[str], None], *, hint: str = "") -> None:
        self.app.push_screen(AskText(title, text, hint), lambda typed: take(typed) if typed else None)

    def choose(
        self, title: str, choices: Sequence[FieldChoice], take: Callable[[str], None], *, now: str = "", new: str = ""
    ) -> None:
        def taken(picked: Picked | None) -> None:
            if picked is not None:
                take(picked.value)

        self.app.push_screen(PickList(title, choices, now=now, new=new), taken)

    def choose_many(
        self, title: str, choices: Sequence[FieldChoice], now: Sequence[str], take: Callable[[tuple[str, ...]], None]
    ) -> None:
        def taken(picked: Picked | None) -> None:
            if picked is not None:
                take(picked.ticked)

        self.app.push_screen(PickList(title, choices, ticked=now), taken)

    # --- drawing ----------------------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        body = self.query_one("#body")
        body.set_class(self.opened is not None, "-page")
        body.set_class(self.app.size.width >= WIDE, "-wide")
        body.set_class(self.app.size.width < WIDE, "-narrow")

    def on_resize(self) -> None:
        self._lay_out()
        if is_too_small(*self.app.size) and not any(isinstance(each, TooSmallScreen) for each in self.app.screen_stack):
            self.app.push_screen(TooSmallScreen(None))

    @on(StaticLines.DrawAgain)
    @on(RowView.Resized)
    def draw(self) -> None:
        """Everything, from the draft as it is now."""
        if self.opened is not None and not self.opened.still_there:
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
            stops = self.running is not None or not self._has_stop
            self.hints.draw(self.page.hints, self.page.own_hints, stops=stops)

    # --- work beside the loop ---------------------------------------------------------------------------------------

    @property
    def is_working(self) -> bool:
        """Whether something is being done that a key has begun, and that may open something."""
        return self._works > 0

    def _work(self, work: Coroutine[Any, Any, None]) -> None:
        self._works += 1
        self.run_worker(self._carry_out(work), group="edit")

    async def _carry_out(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except EditRefused as refused:
            self.say(str(refused), "wait")
            self.draw()
        finally:
            self._works -= 1

    def _said(self, change: Change, verb: str = "") -> None:
        sentence = "; ".join((*change.says, *change.noticed))
        self.say(f"{verb}{sentence}", "wait" if change.noticed else "info")

    def _watch(self) -> None:
        """Look whether files have changed outside or a session has begun, while nothing is being typed."""
        if self.app.screen is self and not self.study.busy and not self.page.is_typing:
            self.run_worker(Later(self._look), group="watch", exclusive=True)

    async def _look(self) -> None:
        found = await asyncio.to_thread(self._sessions.find, dialogs.folder_of(self.study))
        if found != self.running:
            self.running = found
            self.draw_bars()
        await self._look_outside()

    def look_outside(self) -> None:
        """Look now whether files have changed."""
        self.run_worker(Later(self._look), group="watch", exclusive=True)

    async def _look_outside(self) -> bool:
        """Read again what somebody else has written. True: the author is asked which version is to stay."""
        try:
            outside = await self.study.notice_outside()
        except EditRefused as refused:
            self.say(str(refused), "fault")
            return True
        if outside is None:
            return False
        files = ", ".join(outside.files)
        self._explore()
        self.draw()
        if outside.clash:
            self._ask_about_clash(outside.clash)
        else:
            self.say(f"{files} changed on the disk: read again", "wait")
        return bool(outside.clash)

    # --- actions of the registry ------------------------------------------------------------------------------------

    @on(RunAction)
    def _run_action(self, event: RunAction) -> None:
        self.action_do(event.action)

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry that works here; first what it means for the page."""
        if self.page.is_typing and action not in ("stop", "quit"):
            return
        calls: dict[str, Callable[[], object]] = {
            "edit.undo": lambda: self._work(self._step(self.study.undo(), "taken back", "there is nothing to undo")),
            "edit.redo": lambda: self._work(self._step(self.study.redo(), "made again", "nothing was taken back")),
            "edit.save": lambda: self._work(self._ask_to_save()),
            "edit.findings": lambda: choose_finding(self, self.app),
            "edit.file": lambda: self._work(self._open_file()),
            "edit.pages": self._go_home,
            "edit.leave": self._leave,
            "filter": self._open_find,
            "help": lambda: dialogs.open_help(self.app),
            "palette": lambda: dialogs.open_palette(self.app, self.action_do),
            "theme": lambda: dialogs.open_palette(self.app, None),
            "redraw": self._redraw,
            "stop": self.stop_pressed,
            "quit": lambda: self.app.run_worker(self.app.run_action("quit")),
        }
        if action.startswith("edit.") and self.page.carry_out(action):
            return
        if (call := calls.get(action)) is not None:
            call()

    def _redraw(self) -> None:
        if isinstance(self.app, TerminalApp):
            self.app.repaint_everything()

    def _go_home(self) -> None:
        if self.opened is not None:
            self._work(self._close_page())

    async def _step(self, step: Coroutine[Any, Any, Change | None], verb: str, nothing: str) -> None:
        change = await step
        if change is None:
            self.say(nothing, "wait")
        else:
            self._said(change, f"{verb}: ")
        self.draw()

    # --- find ---------------------------------------------------------------------------------------------------------

    def _open_find(self) -> None:
        """Search the page, or the list of the study where a page has nothing to search."""
        if self.opened is not None and not self.opened.CAN_FILTER:
            self._work(self._find_in_list())
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

    # --- saving -------------------------------------------------------------------------------------------------------

    async def _ask_to_save(self) -> None:
        if await self._look_outside():
            return
        if not self.study.draft.changed_files:
            self.say("nothing to save")
            return
        diff = self.study.diff()
        self.app.push_screen(SaveDialog(self.study.draft, diff), self._save_if)

    def _save_if(self, yes: bool | None) -> None:
        if yes:
            self._work(self._save())

    async def _save(self) -> None:
        report = await self.study.save()
        self._explore()
        after = "; the session that runs goes on with its own copy" if self.running is not None else ""
        self.say(f"saved: {', '.join(report.files)}{after}")
        self.draw()

    # --- an editor of one's own ---------------------------------------------------------------------------------------

    async def _open_file(self) -> None:
        place = self.page.place
        if place is None:
            self.say("this row has no line in a file", "wait")
        elif not self._may_suspend or self.running is not None:
            path = dialogs.folder_of(self.study) / place.file
            self.say(f"a session runs, and the stop key must work. Open {path}, line {place.line}, elsewhere", "wait")
        else:
            await external.edit_file(self.app, self, place)
            self.draw()
            self.look_outside()

    # --- leaving ------------------------------------------------------------------------------------------------------

    def stop_pressed(self) -> None:
        """The stop key, where the console below has none of its own."""
        if self.running is None:
            self.say("no session of this study runs here")
        else:
            self.say("sending STOP …", "fault")
            self.run_worker(self._stop(self.running), group="stop")

    async def _stop(self, session: RunningHere) -> None:
        self.say(await asyncio.to_thread(self._sessions.stop, session), "fault")

    def _leave(self) -> None:
        if self.page.leave():
            self.draw_bars()
        elif self.opened is not None:
            self.close_page()
        else:
            self.ask_to_leave()

    def ask_to_leave(self) -> None:
        """Close the editor; with unsaved changes it asks."""
        if not self.study.draft.changed_files:
            self.close()
            return
        number = count(len(self.study.draft.changes), "change")
        question = Dialog(
            "Leave the editor?",
            [f"{number} not saved. They stay as a draft for the next time."],
            DialogChoice("s", "Save first"),
            DialogChoice("l", "Leave"),
            no="Keep editing",
        )

        def answer(key: str | None) -> None:
            if key == "s":
                self._work(self._ask_to_save())
            elif key == "l":
                self.close()

        self.app.push_screen(question, answer)

    def close(self) -> None:
        """Leave the editor; a draft stays."""
        if not self._is_closing:
            self._is_closing = True
            self.dismiss()
