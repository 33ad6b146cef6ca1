"""What a page of the editor is, and what it can ask of the frame around it.

A page is added in three steps: a subclass of `EditPage` with its `KIND`; one line in `pages.PAGES`; rows that open it,
by `frame.open_page(KIND, NAME)`. Top line, findings, save, undo, `e`, drafts and F9 come from the frame.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Any, ClassVar, Protocol

from textual.containers import Vertical
from textual.widget import Widget

from rise_engine.author.edit.edits import AnyEdit
from rise_tui.editor.model.draft import FilePlace, StudyDraft
from rise_tui.editor.model.explored import ExploredStudy
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.study import EditedStudy
from rise_tui.model.notice import Level


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

        What cannot be made is said. Nothing is to be made without edits.
        """

    def work(self, work: Coroutine[Any, Any, str]) -> None:
        """Do something beside the loop, draw everything anew, and say the sentence that it gives.

        What is refused is said.
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

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__()
        self.frame, self.shown_name = frame, name
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

    def carry_out(self, action: str) -> bool:
        """Do what an action of scope `edit` means here; False: nothing."""
        return False

    def leave(self) -> bool:
        """`esc`: whether there was something in the page to go back from."""
        return False

    def filter(self, text: str) -> None:
        """Show only rows with this text."""

    @property
    def place(self) -> FilePlace | None:
        """Where what is under the cursor stands: for `e`, and for the lines of the file."""
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
    def is_opening(self) -> bool:
        """Whether a field is about to open, to which the keys go that come now."""
        return False

    @property
    def is_typing(self) -> bool:
        """Whether a field is open; then what was changed outside waits."""
        return False
