"""The study in the editor: changes, exploring, outside changes to files, saving, stopping, leaving."""

from __future__ import annotations

import asyncio
import os
import shlex
import subprocess
import tempfile
from abc import abstractmethod
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any

from msgspec.structs import replace
from textual import work
from textual.app import App
from textual.screen import Screen

from rise_engine.author.edit.drafts import Draft
from rise_engine.author.edit.edits import AnyEdit, ReplaceFile
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Change, Workspace
from rise_engine.base.text import clean, pluralize
from rise_tui.editor import dialogs
from rise_tui.editor.dialogs import SaveDialog
from rise_tui.editor.model.draft import FilePlace, StudyDraft, is_study_alone
from rise_tui.editor.page import EditPage
from rise_tui.editor.study import EditedStudy, ExploredStudy, Explorer, RunningHere, SessionWatch
from rise_tui.model.notice import Level
from rise_tui.rendering.terminal_app import repaint_everything
from rise_tui.rise_app import EDITOR
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.widgets.bars import StudyNotice

WATCH_SECONDS = 2.0
"""Seconds until the editor notices an outside change to the files, or a new session."""
USUAL_EDITORS = ("nano", "vim", "vi")


def editor_command() -> list[str]:
    """The program in `$VISUAL` or `$EDITOR`, or else the first usual one."""
    named = os.environ.get("VISUAL") or os.environ.get("EDITOR")
    if named:
        return shlex.split(named)
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    return [next((each for each in USUAL_EDITORS if any(Path(at, each).is_file() for at in folders)), "vi")]


def arguments_at(command: list[str], path: str, line: int) -> list[str]:
    """Return the command line that opens a file at a line, in this editor's syntax.

    >>> arguments_at(["vim"], "a.xml", 3), arguments_at(["hx"], "a.xml", 3)
    (['vim', '+3', 'a.xml'], ['hx', 'a.xml:3'])
    >>> arguments_at(["code"], "a.xml", 3)
    ['code', '--wait', '--goto', 'a.xml:3']
    """
    name = Path(command[0]).name
    if name in ("code", "codium", "code-insiders"):
        waits = [] if "--wait" in command or "-w" in command else ["--wait"]
        return [*command, *waits, "--goto", f"{path}:{line}"]
    if name in ("hx", "helix", "subl", "zed"):
        return [*command, f"{path}:{line}"]
    return [*command, f"+{line}", path]


async def edit_file(app: App[Any], frame: StudyFrame, place: FilePlace) -> None:
    """Give the terminal to the editor until it ends. The caller then looks for changes on the disk.

    A file without unsaved changes is edited in place and read again. Otherwise the editor gets a copy of the draft, and
    the result becomes a change of the draft. :raises EditRefused: the draft cannot take it.
    """
    draft = frame.study.draft
    content = draft.files.get(place.file)
    if place.file in draft.above:  # a file of the study above is outside the draft
        await _run(app, frame, place.file, place.line)
        return
    if content is None:
        frame.say(f"{place.file} no longer exists", "wait")
        return
    if content == draft.saved.get(place.file):
        await _run(app, frame, str(Path(draft.folder, place.file)), place.line)
        return
    written = await _edit_copy(app, frame, place, content)
    if written != content:
        try:
            text = written.decode("utf-8")
        except UnicodeDecodeError:
            frame.say(f"{place.file} was not read: it is not UTF-8", "fault")
            return
        frame.make(ReplaceFile(place.file, text))


async def _edit_copy(app: App[Any], frame: StudyFrame, place: FilePlace, content: bytes) -> bytes:
    """Edit a copy of the draft's file. Returns its new content."""
    with tempfile.TemporaryDirectory(prefix="rise-draft-") as folder:
        copy = Path(folder, Path(place.file).name)
        await asyncio.to_thread(copy.write_bytes, content)
        await _run(app, frame, str(copy), place.line)
        return await asyncio.to_thread(copy.read_bytes)


async def _run(app: App[Any], frame: StudyFrame, path: str, line: int) -> None:
    arguments = arguments_at(editor_command(), path, line)
    try:
        with app.suspend():
            await asyncio.to_thread(subprocess.run, arguments, check=False)
    except OSError as error:
        frame.say(f"{arguments[0]} could not be started ({error.strerror}): name your editor in $EDITOR", "fault")
    repaint_everything(app)


class StudyFrame(Screen[None]):
    """The editor's work on the study, on every page."""

    def __init__(
        self,
        study: EditedStudy,
        *,
        sessions: SessionWatch | None = None,
        may_suspend: bool = True,
        explorer: Explorer | None = None,
    ) -> None:
        """
        :param sessions: finds a session that runs beside the editor; None: the console below has the stop key.
        :param may_suspend: whether another program may use the terminal for a while; not if a session runs here.
        :param explorer: explores the study when it is opened and after each save; None: no exploration.
        """
        super().__init__(classes=EDITOR)
        self.study, self._sessions, self._explorer = study, sessions, explorer
        self._may_suspend = may_suspend
        self.explored = ExploredStudy()
        """The result of exploring the saved files."""
        self.running: RunningHere | None = None
        self.notice = StudyNotice()
        self._is_closing = False
        self._works = 0
        """The number of unfinished jobs of keys."""

    @property
    @abstractmethod
    def page(self) -> EditPage:
        """The page that gets the keys."""

    @abstractmethod
    def draw(self) -> None:
        """Draw everything from the current draft."""

    @abstractmethod
    def draw_bars(self) -> None:
        """Draw the lines around the page."""

    def begin(self) -> None:
        """Offer an earlier editor's draft, explore, and watch the files."""
        self.set_interval(WATCH_SECONDS, self._watch)
        self._start_job(self._offer_draft())
        self._explore()

    def say(self, sentence: str, level: Level = "info") -> None:
        self.notice.draw(clean(sentence), level)

    def attempt(self, work: Callable[[], object]) -> None:
        try:
            work()
        except EditRefused as refused:
            self.say(str(refused), "wait")

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        if edits:
            self._start_job(self._make(edits, then))
        elif then is not None:
            self.attempt(then)

    async def _make(self, edits: Sequence[AnyEdit], then: Callable[[], None] | None) -> None:
        change = await self.study.do("changing", lambda workspace: workspace.apply(*edits))
        self._report_change(change)
        self.draw()
        if then is not None:
            then()

    @property
    def is_working(self) -> bool:
        """Whether a job of a key is running that may open something."""
        return self._works > 0

    def _start_job(self, work: Coroutine[Any, Any, None]) -> None:
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

    def _report_change(self, change: Change, verb: str = "") -> None:
        sentence = "; ".join((*change.says, *change.noticed))
        self.say(f"{verb}{sentence}", "wait" if change.noticed else "info")

    async def _undo(self) -> None:
        self._report_step(await self.study.do("undoing", Workspace.undo), "taken back", "there is nothing to undo")

    async def _redo(self) -> None:
        self._report_step(await self.study.do("redoing", Workspace.redo), "made again", "nothing was taken back")

    def _report_step(self, change: Change | None, verb: str, nothing: str) -> None:
        if change is None:
            self.say(nothing, "wait")
        else:
            self._report_change(change, f"{verb}: ")
        self.draw()

    # --- exploring ---------------------------------------------------------------------------------------------------

    def _explore(self) -> None:
        """Explore the saved files in the background. This cancels an earlier exploration.

        Files with known errors are not explored.
        """
        self.workers.cancel_group(self, "explore")
        draft, explorer = self.study.draft, self._explorer
        if is_study_alone(draft):
            return
        has_errors = bool(draft.checked.errors) and not draft.changed_files
        is_asked = explorer is not None and not has_errors
        self.explored = replace(self.explored, is_asked_again=is_asked, has_failed=False)
        if explorer is not None and is_asked:
            self.run_worker(self._explore_saved(draft, explorer), group="explore")

    async def _explore_saved(self, draft: StudyDraft, explorer: Explorer) -> None:
        found = await explorer(draft.folder)
        if found is not None:
            self.explored = replace(found, files=draft.saved)
        else:
            self.explored = replace(self.explored, is_asked_again=False, has_failed=True)
        self.draw()

    # --- outside changes and earlier drafts --------------------------------------------------------------------------

    def _watch(self) -> None:
        """Look for outside changes to files and for a new session, while nothing is being typed."""
        if self.app.screen is self and not self.study.busy and not self.page.is_typing:
            self.check_disk_changes()

    @work(group="watch", exclusive=True)
    async def check_disk_changes(self) -> None:
        """Look for changed files and for a new session now."""
        if self._sessions is not None:
            found = await asyncio.to_thread(self._sessions.find, Path(self.study.draft.folder))
            if found != self.running:
                self.running = found
                self.draw_bars()
        await self._read_disk_changes(settled=True)

    async def _read_disk_changes(self, *, settled: bool = False) -> bool:
        """Read outside changes. True: the author must choose the version that stays."""
        try:
            changes = await self.study.do("", lambda workspace: workspace.read_disk_changes(settled=settled))
        except EditRefused as refused:
            self.say(str(refused), "fault")
            return True
        if changes is None:
            return False
        files = ", ".join(changes.files)
        self._explore()
        self.draw()
        if changes.clash:
            self._ask_about_clash(changes.clash)
        else:
            self.say(f"{files} changed on the disk: read again", "wait")
        return bool(changes.clash)

    def _ask_about_clash(self, files: Sequence[str]) -> None:
        dialogs.ask_about_clash(self.app, files, lambda: self._start_job(self._take_disk_changes(files)))

    async def _take_disk_changes(self, files: Sequence[str]) -> None:
        self._report_change(await self.study.do("changing", lambda workspace: workspace.take_disk_changes(files)))
        self.draw()

    async def _offer_draft(self) -> None:
        """Offer the unsaved changes of an earlier editor before anything is changed."""
        draft = await self.study.do("", lambda workspace: workspace.draft)
        if draft is None:
            return

        def answer(key: str | None) -> None:
            if key == "t":
                self._start_job(self._take_up(draft))
            elif key == "d":
                self._start_job(self.study.do("", Workspace.discard_draft))
            else:
                self.close()

        self.app.push_screen(dialogs.draft_dialog(draft), answer)

    async def _take_up(self, draft: Draft) -> None:
        changes = await self.study.do("reading the draft", lambda workspace: workspace.take_up_draft(draft))
        self.say("your changes are restored: ctrl+o saves them")
        self.draw()
        if changes.clash:
            self._ask_about_clash(changes.clash)

    # --- files -------------------------------------------------------------------------------------------------------

    async def _ask_to_save(self) -> None:
        if await self._read_disk_changes():
            return
        if not self.study.draft.changed_files:
            self.say("nothing to save")
            return
        question = SaveDialog(self.study.draft, self.study.workspace.diff())
        self.app.push_screen(question, lambda yes: self._start_job(self._save()) if yes else None)

    async def _save(self) -> None:
        report = await self.study.do("saving", Workspace.save)
        self._explore()
        after = "; the session that runs goes on with its own copy" if self.running is not None else ""
        self.say(f"saved: {', '.join(report.files)}{after}")
        self.draw()

    async def _open_file(self) -> None:
        place = self.page.place
        if place is None:
            self.say("this row has no line in a file", "wait")
        elif not self._may_suspend or self.running is not None:
            path = Path(self.study.draft.folder) / place.file
            self.say(f"a session runs, and the stop key must work. Open {path}, line {place.line}, elsewhere", "wait")
        else:
            await edit_file(self.app, self, place)
            self.draw()
            self.check_disk_changes()

    # --- stopping and leaving ----------------------------------------------------------------------------------------

    def stop_pressed(self) -> None:
        """Handle the stop key, if the console below has none."""
        if self.running is None or self._sessions is None:
            self.say("no session of this study runs here")
        else:
            self.say("sending STOP …", "fault")
            self.run_worker(self._stop(self._sessions, self.running), group="stop")

    async def _stop(self, sessions: SessionWatch, session: RunningHere) -> None:
        self.say(await asyncio.to_thread(sessions.stop, session), "fault")

    def ask_to_leave(self) -> None:
        """Close the editor. With unsaved changes, ask first."""
        if not self.study.draft.changed_files:
            self.close()
            return
        number = pluralize(len(self.study.draft.changes), "change")
        question = Dialog(
            "Leave the editor?",
            [f"{number} not saved. They stay as a draft for the next time."],
            DialogChoice("s", "Save first"),
            DialogChoice("l", "Leave"),
            no="Keep editing",
        )

        def answer(key: str | None) -> None:
            if key == "s":
                self._start_job(self._ask_to_save())
            elif key == "l":
                self.close()

        self.app.push_screen(question, answer)

    def close(self) -> None:
        """Leave the editor; a draft stays."""
        if not self._is_closing:
            self._is_closing = True
            self.dismiss()

    async def on_unmount(self) -> None:
        await self.study.close()
