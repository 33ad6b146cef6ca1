from __future__ import annotations

import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from rise_engine.author.edit.plan import Files
from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.screen import EditApp, EditScreen
from rise_tui.editor.study import EditedStudy, Explorer, RunningHere
from rise_tui.rendering.terminal_driver import mark_together
from tests.patience import PATIENCE
from tests.tui.conftest import Shown
from tests.virtual_time import real_monotonic

STUDIES = Path(__file__).parents[3] / "scenarios"


class OneSession:
    """A watch on sessions that finds what a test says, and remembers that it was stopped."""

    def __init__(self, running: RunningHere | None = None) -> None:
        self.running, self.stopped = running, 0

    def find(self, folder: Path) -> RunningHere | None:
        return self.running

    def stop(self, session: RunningHere) -> str:
        self.stopped += 1
        return "STOPPED: it was told"


class Editor:
    """An editor under test."""

    def __init__(self, pilot: Pilot[None], screen: EditScreen, folder: Path) -> None:
        self.pilot, self.screen, self.folder = pilot, screen, folder

    @property
    def draft_text(self) -> str:
        """All files of the draft."""
        return "\n".join(data.decode("utf-8", "replace") for data in self.screen.study.draft.files.values())

    @property
    def notice(self) -> str:
        """As one line, however it is wrapped here: it may name a file, and a folder has a name of any length."""
        return " ".join(self.screen.notice.text.split())

    async def press(self, *keys: str) -> None:
        for key in keys:
            await self.pilot.press(key)
            await self.until_carried_out()

    async def type(self, text: str) -> None:
        names = {
            "'": "apostrophe",
            "=": "equals_sign",
            " ": "space",
            ".": "full_stop",
            "{": "left_curly_bracket",
            "}": "right_curly_bracket",
            "_": "underscore",
        }
        for character in text:
            await self.pilot.press(names.get(character, character))
        await self.until_carried_out()

    async def until_carried_out(self) -> None:
        """Until all keys have done what they do."""
        app = self.pilot.app
        assert isinstance(app, EditApp)
        await self.until(lambda: app.key_queue.is_empty)
        await self.pilot.pause(0.01)

    async def send_together(self, *keys: str) -> None:
        """Keys as they come over a slow line: in one piece."""
        found = [events.Key(key, key if len(key) == 1 else None) for key in keys]
        mark_together(found, True)
        for each in found:
            self.pilot.app.post_message(each)
        await self.pilot.pause(0.01)
        await self.until_carried_out()

    async def until(self, holds: Callable[[], object], what: str = "") -> None:
        end = real_monotonic() + PATIENCE
        while not holds():
            assert real_monotonic() < end, what or f"did not happen in time; it says: {self.notice}"
            await self.pilot.pause(0.01)

    async def shows(self, kind: type[Shown]) -> Shown:
        """The dialog of this kind that opens over the editor."""
        app = self.pilot.app
        await self.until(lambda: isinstance(app.screen, kind) and app.screen.is_mounted, f"no {kind.__name__}")
        await self.pilot.pause()
        assert isinstance(app.screen, kind)
        return app.screen

    async def go_home(self) -> None:
        """Leave the page that is open."""
        while self.screen.opened is not None or self.pilot.app.screen is not self.screen:
            await self.press("escape")

    async def take_back(self, files: Files) -> None:
        """Undo until the draft is as it was."""
        while self.screen.study.draft.files != files:
            before = self.screen.study.draft
            self.screen.action_do("edit.undo")
            await self.until(lambda before=before: self.screen.study.draft is not before)  # type: ignore[misc]
            await self.until_carried_out()

    async def open(self, kind: str, name: str = "") -> None:
        self.screen.open_page(kind, name)
        await self.until(lambda: self.screen.opened is not None and kind == self.screen.opened.KIND)
        await self.pilot.pause()


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the greeting, with a place of its own for drafts."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shutil.copytree(STUDIES / "greeting", tmp_path / "study")
    return tmp_path / "study"


@asynccontextmanager
async def editor(
    folder: Path,
    size: tuple[int, int] = (80, 24),
    sessions: OneSession | None = None,
    explorer: Explorer | None = None,
) -> AsyncIterator[Editor]:
    workspace = Workspace(folder)
    app = EditApp(EditedStudy(workspace, draft_of(workspace)), sessions=sessions or OneSession(), explorer=explorer)
    async with app.run_test(size=size) as pilot:
        found = Editor(pilot, app.edit_screen, folder)
        await found.until(lambda: found.screen.home.rows.count)
        await found.until(lambda: found.screen.home.rows.cursor >= 0)
        yield found
