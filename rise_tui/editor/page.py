"""A page of the editor, the frame around it, and the lines between them.

To add a page: write a subclass of `EditPage` with its `KIND`, add it to `screen.PAGES`, and make rows open it with
`frame.open_page(KIND, NAME)`. The frame provides the top line, diagnostics, save, undo, `e`, drafts and F9.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Protocol, TypeAlias

from textual import events, work
from textual.containers import Vertical
from textual.widget import Widget

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import pluralize
from rise_tui.actions import BY_ID
from rise_tui.editor.model.draft import FilePlace, StudyDraft, first_new_finding
from rise_tui.editor.model.fields import NOTE_MARKS, FieldChoice, FieldNote, note_of
from rise_tui.editor.study import EditedStudy, ExploredStudy, explored_line
from rise_tui.key_labels import first_key_label
from rise_tui.model.notice import Level
from rise_tui.rendering.text import StyledLine, StyledSpan, align_at_both_ends, clean, crop, line_width, shorten
from rise_tui.widgets.bars import KeyHints
from rise_tui.widgets.lines import StaticLines

TURNS = {"left": -1, "right": 1}
PAINTED = 0.02
"""Seconds until a typed letter is painted. The check of the study must not delay it."""


class EditFrame(Protocol):
    """The frame, as pages see it."""

    study: EditedStudy

    @property
    def explored(self) -> ExploredStudy:
        """The result of exploring the saved files."""

    def say(self, sentence: str, level: Level = "info") -> None:
        """Show the author a sentence, above the key hints."""

    def attempt(self, work: Callable[[], object]) -> None:
        """Do something that may raise EditRefused, with a notice of the reason."""

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        """Make edits as one step, and draw everything again. `then` is called after them, or if there are none.

        A notice reports refused edits.
        """

    def open_page(self, kind: str, name: str = "", *, back: tuple[str, str] | None = None) -> None:
        """Open the page of this kind and name. `esc` leads to the page `back`, or to the list."""

    def close_page(self) -> None:
        """Go back to the previous page."""

    def ask_text(self, title: str, text: str, take: Callable[[str], None], *, hint: str = "") -> None:
        """Ask for a line. `take` receives it, unless it is empty or the author pressed `esc`."""

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
        """Let the author choose one; typing filters.

        :param new: the use of a name that is not among the choices. :param enter: what Enter does.
        """

    def draw_bars(self) -> None:
        """Draw the lines around the page again, after its content or its keys have changed."""


class EditPage(Vertical):
    """Fills the frame. `draw` makes all its contents from `draft`."""

    DEFAULT_CSS = "EditPage { height: 1fr; width: 1fr; layers: default edit; }"

    KIND: ClassVar[str]
    """The kind by which it is opened."""
    CAN_FILTER: ClassVar[bool] = False
    """Whether the page has rows to search."""
    EXPECTED: ClassVar[tuple[str, ...]] = ()
    """Codes of diagnostics that are normal while typing here, and need no remark."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__()
        self.frame, self.shown_name = frame, name
        self.wanted = ""
        """The text to search for."""
        self.back: tuple[str, str] | None = None
        """Kind and name of the page that opened it, to which `esc` leads; None: the list of the study."""

    @property
    def draft(self) -> StudyDraft:
        return self.frame.study.draft

    @property
    def hints(self) -> Mapping[str, str]:
        """The actions of scope `edit` that work here now, each with its word for the hint line."""
        return {}

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        """The keys that the page binds itself, each as printed, with a word for the hint line."""
        return ()

    def draw(self) -> None:
        """Show the present draft. Called after each change, and when the size has changed."""
        raise NotImplementedError

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        """The actions of scope `edit` that the page carries out."""
        return {}

    def turn(self, step: int) -> bool:
        """Handle `left` (-1) and `right` (1) while nothing is typed; False: they have no meaning here."""
        return False

    def on_key(self, event: events.Key) -> None:
        if event.key in TURNS and not self.is_typing and self.turn(TURNS[event.key]):
            event.stop()
            event.prevent_default()

    def leave(self) -> bool:
        """Handle `esc`. Returns whether the page had something to go back from."""
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
        """The lines of the item under the cursor, for `e` and for the lines of the file."""
        return None

    @property
    def shown_state(self) -> str:
        """The state of a rule under the cursor; empty: none."""
        return ""

    @property
    def content_exists(self) -> bool:
        """Whether the content of the page still exists. Otherwise the frame closes it."""
        return True

    @property
    def first_focus(self) -> Widget | None:
        """The widget that gets the focus when the page opens."""
        return None

    @property
    def is_typing(self) -> bool:
        """Whether a field is open. Outside changes then wait."""
        return False

    def hide_list(self, hidden: bool) -> None:
        """Give the page the room of the study's list beside it, or give that room back."""
        for page in self.screen.query("StudyPage"):
            if hidden:
                page.styles.display = "none"
            else:
                page.styles.clear_rule("display")

    def make(self, *edits: AnyEdit, then: Callable[[], None] | None = None) -> None:
        """Make edits as one step, as the frame does."""
        self.frame.make(*edits, then=then)

    @work(group="preview", exclusive=True)
    async def preview(self, edits: Callable[[], tuple[AnyEdit, ...]], say: Callable[..., None]) -> None:
        """While something is typed: `say` what would be newly wrong with the study."""
        await asyncio.sleep(PAINTED)
        if self.is_typing:
            say(*self.new_findings(edits))

    def new_findings(self, edits: Callable[[], tuple[AnyEdit, ...]]) -> list[FieldNote]:
        """The worst diagnostic that edits would add, or why they cannot be made."""
        try:
            made = edits()
            if not made:
                return []
            checked = self.frame.study.workspace.preview(*made)
            return note_of(first_new_finding(self.draft, checked, but=self.EXPECTED))
        except EditRefused as refused:
            return [FieldNote("error", clean(str(refused)))]


MIN_TITLE, MAX_TITLE = 8, 34
"""Cells of the study's title, which gets the remaining space."""


def top_line(draft: StudyDraft, width: int, *, busy: str = "") -> StyledLine:
    """The study, the word EDIT, the robot, errors and warnings, unsaved changes."""
    errors = len(draft.checked.errors)
    warnings = len(draft.checked.diagnostics) - errors
    left: list[StyledSpan] = [("  EDIT", "accent")]
    left.append((f"  {clean(draft.checked.robot.name)}", "muted"))
    left.append((f"  ✗ {pluralize(errors, 'error')}", "fault") if errors else ("  ✓ no errors", "plain"))
    if warnings:
        left.append((f"  ▲ {pluralize(warnings, 'warning')}", "wait"))
    number = len(draft.changes)
    unsaved: StyledSpan = ("saved ", "muted")
    if draft.changed_files:
        unsaved = (f"● {pluralize(number, 'change')} unsaved ", "wait") if number else ("● not saved ", "wait")
    right: StyledLine = ((f"{busy} … ", "muted"), unsaved) if busy else (unsaved,)
    room = width - line_width(left) - line_width(right) - 3
    title: StyledSpan = (f" {shorten(clean(draft.title), max(MIN_TITLE, min(MAX_TITLE, room)))}", "strong")
    return align_at_both_ends((title, *left), right, width)


def finding_line(draft: StudyDraft, about: str) -> StyledLine:
    """The first diagnostic. Those in the file `about` come first."""
    found = draft.findings
    if not found:
        return ()
    errors = [each for each in found if each.severity == "error"]
    near = [each for each in errors or found if each.location.file == about]
    first = (near or found)[0]
    mark, role = NOTE_MARKS[first.severity]
    return ((f" {mark}{first.location.file}:{first.location.line} ", role), (clean(first.message), role))


HintPiece: TypeAlias = tuple[list[StyledSpan], str]
"""A key with its word, and the id of its action."""
COMMON_HINTS = {
    "edit.undo": "undo",
    "edit.save": "save",
    "filter": "find",
    "palette": "command",
    "help": "help",
    "edit.leave": "back",
}


class EditTopLine(StaticLines):
    """The study, EDIT, its errors, and its unsaved changes."""

    DEFAULT_CSS = "EditTopLine { background: $rise-bar; }"

    def draw(self, draft: StudyDraft, busy: str) -> None:
        self.show(top_line(draft, self.size.width, busy=busy))


class FindingLine(StaticLines):
    """The first diagnostic or finding."""

    def draw(self, draft: StudyDraft, file: str, explored: ExploredStudy, about: tuple[str, str, str]) -> None:
        """`file`: the shown file. `about`: kind and name of the page, and the state under the cursor.

        Findings about these come after errors in the file, and before warnings elsewhere.
        """
        found = explored.about(*about)
        is_first = bool(draft.checked.errors) or any(each.location.file == file for each in draft.findings)
        explored_text = explored_line(explored, draft, found)
        line = finding_line(draft, file) if is_first or not found else explored_text
        line = line or explored_text
        number = len(draft.checked.diagnostics) + len(explored.findings)
        if number < 2 and line_width(line) <= self.size.width:
            self.show(line)
            return
        key = first_key_label(BY_ID["edit.findings"])
        tail: StyledLine = ((f"  {key}", "key"), (f" all {number} " if number > 1 else " all of it ", "plain"))
        self.show((*crop(line, self.size.width - line_width(tail)), *tail))


class BannerLine(StaticLines):
    """A permanent line while a session runs. Without text it takes no row."""

    DEFAULT_CSS = """
    BannerLine { display: none; }
    BannerLine.-shown { display: block; }
    """

    def draw(self, sentence: str) -> None:
        self.set_class(bool(sentence), "-shown")
        self.show(crop(((f" {sentence}", "accent"),), self.size.width))


class EditHints(KeyHints):
    """The keys of the page, then those of the frame."""

    def draw(  # type: ignore[override]
        self, own: Mapping[str, str], bound: Sequence[tuple[str, str]], *, stops: bool
    ) -> None:
        """`own`: actions of the page with their words; `bound`: keys that the page binds itself."""
        shown = {**({"stop": "STOP"} if stops else {}), **own}
        common = {id: word for id, word in COMMON_HINTS.items() if id not in shown}
        self.show_pieces([*_pieces(shown), *(_piece(*each) for each in bound), *_pieces(common)])

    def draw_typing(self) -> None:  # type: ignore[override]
        """Draw the keys while a field is open."""
        words = {"enter": "done", "tab": "next field", "esc": "as it was"}
        self.show_pieces([_piece(*each) for each in words.items()])


def _pieces(words: Mapping[str, str]) -> list[HintPiece]:
    return [_piece(first_key_label(BY_ID[id]), word, id) for id, word in words.items()]


def _piece(key: str, word: str, id: str = "") -> HintPiece:
    return [(f" {key}", "fault" if id == "stop" else "key"), (f" {word} ", "plain")], id
