"""A page of the editor, and the frame around it.

A page is added in three steps: a subclass of `EditPage` with its `KIND`; one name in `screen.PAGES`; rows that open it,
by `frame.open_page(KIND, NAME)`. Top line, findings, save, undo, `e`, drafts and F9 come from the frame.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Protocol

from textual import events
from textual.containers import Vertical
from textual.widget import Widget

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import clean
from rise_tui.editor.model.draft import FilePlace, StudyDraft, first_new_finding
from rise_tui.editor.model.explored import ExploredStudy
from rise_tui.editor.model.fields import FieldChoice, FieldNote, note_of
from rise_tui.editor.study import EditedStudy
from rise_tui.model.notice import Level
from rise_tui.rendering.later import Later

TURNS = {"left": -1, "right": 1}
PAINTED = 0.02
"""Seconds until a typed letter has been painted: the check of the study must not hold it up."""


class EditFrame(Protocol):
    """The frame, as pages know it."""

    study: EditedStudy

    @property
    def explored(self) -> ExploredStudy:
        """What exploring has found in the files as they were saved."""

    def say(self, sentence: str, level: Level = "info") -> None:
        """Tell the author something, above the key hints."""

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        """Make edits as one step, and draw everything anew; `then` is called when they are made.

        It says what cannot be made. Without edits it does nothing.
        """

    def open_page(self, kind: str, name: str = "", *, back: tuple[str, str] | None = None) -> None:
        """Open the page of this kind, of what has this name; `esc` leads to the page `back`, or to the list."""

    def close_page(self) -> None:
        """Go back to the page before."""

    def ask_text(self, title: str, text: str, take: Callable[[str], None], *, hint: str = "") -> None:
        """Ask for a line; `take` is called with it, unless nothing or `esc` was typed."""

    def choose(
        self, title: str, choices: Sequence[FieldChoice], take: Callable[[str], None], *, now: str = "", new: str = ""
    ) -> None:
        """Let one be chosen; typing filters. `new`: what a name is called that is none of them and may be made."""

    def choose_many(
        self, title: str, choices: Sequence[FieldChoice], now: Sequence[str], take: Callable[[tuple[str, ...]], None]
    ) -> None:
        """Let any number be chosen."""

    def draw_bars(self) -> None:
        """Draw the lines around the page anew: what it shows, or what its keys do, has changed."""


class EditPage(Vertical):
    """Fills the frame. Everything that it shows is made in `draw`, from `draft`."""

    DEFAULT_CSS = """
    EditPage { height: 1fr; width: 1fr; layers: default edit; }
    """

    KIND: ClassVar[str]
    """By which it is opened."""
    CAN_FILTER: ClassVar[bool] = False
    """Whether the page has rows to search."""
    EXPECTED: ClassVar[tuple[str, ...]] = ()
    """Codes of findings that typing brings here, and that need no remark."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__()
        self.frame, self.shown_name = frame, name
        self.wanted = ""
        """The text that is searched."""
        self.back: tuple[str, str] | None = None
        """Kind and name of the page that opened it, to which `esc` leads; None: to the list of the study."""

    @property
    def draft(self) -> StudyDraft:
        return self.frame.study.draft

    @property
    def hints(self) -> Mapping[str, str]:
        """Actions of scope `edit` that mean something here now, each with the word for the hint line."""
        return {}

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        """Keys that the page binds itself, each as it is printed with a word for the hint line."""
        return ()

    def draw(self) -> None:
        """Show the draft as it is now. Called after each change, and when the size has changed."""
        raise NotImplementedError

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        """The actions of scope `edit` that the page carries out."""
        return {}

    def carry_out(self, action: str) -> bool:
        """Carry out an action of scope `edit`; False: it means nothing here."""
        call = self.calls.get(action)
        if call is not None:
            call()
        return call is not None

    def turn(self, step: int) -> bool:
        """`left` (-1) and `right` (1) while nothing is typed; False: they mean nothing here."""
        return False

    def on_key(self, event: events.Key) -> None:
        if event.key in TURNS and not self.is_typing and self.turn(TURNS[event.key]):
            event.stop()
            event.prevent_default()

    def leave(self) -> bool:
        """`esc`: whether there was something in the page to go back from."""
        had = bool(self.wanted)
        if had:
            self.filter("")
        return had

    def filter(self, text: str) -> None:
        """Show only rows with this text."""
        self.wanted = text
        self.draw()

    @property
    def place(self) -> FilePlace | None:
        """The lines of what is under the cursor: for `e`, and for the lines of the file."""
        return None

    @property
    def shown_state(self) -> str:
        """The state of a rule under the cursor; empty: none."""
        return ""

    @property
    def still_there(self) -> bool:
        """Whether what the page shows still exists; else the frame closes it."""
        return True

    @property
    def first_focus(self) -> Widget | None:
        """What gets the keys when the page opens."""
        return None

    @property
    def is_typing(self) -> bool:
        """Whether a field is open; then what was changed outside waits."""
        return False

    def hide_list(self, hidden: bool) -> None:
        """Give the page the room of the list of the study beside it, or take it back."""
        for page in self.screen.query("StudyPage"):
            if hidden:
                page.styles.display = "none"
            else:
                page.styles.clear_rule("display")

    def preview(self, edits: Callable[[], tuple[AnyEdit, ...]], say: Callable[..., None]) -> None:
        """While something is typed: `say` what would be wrong with the study then that is not wrong now."""
        self.run_worker(Later(self._preview, edits, say), group="preview", exclusive=True)

    async def _preview(self, edits: Callable[[], tuple[AnyEdit, ...]], say: Callable[..., None]) -> None:
        await asyncio.sleep(PAINTED)
        if self.is_typing:
            say(*self.new_findings(edits))

    def new_findings(self, edits: Callable[[], tuple[AnyEdit, ...]]) -> list[FieldNote]:
        """The worst finding that edits would bring, or why they cannot be made."""
        try:
            made = edits()
            if not made:
                return []
            checked = self.frame.study.preview(*made)
            return note_of(first_new_finding(self.draft, checked, but=self.EXPECTED))
        except EditRefused as refused:
            return [FieldNote("error", clean(str(refused)))]
