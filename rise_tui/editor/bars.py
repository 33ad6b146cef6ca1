"""The lines around every page of the editor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from rise_engine.base.text import pluralize
from rise_tui.actions import BY_ID
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.explored import ExploredStudy, explored_line
from rise_tui.editor.model.fields import NOTE_MARKS
from rise_tui.key_labels import first_key_label
from rise_tui.rendering.text import StyledLine, StyledSpan, align_at_both_ends, clean, crop, line_width, shorten
from rise_tui.widgets.bars import KeyHints
from rise_tui.widgets.static_lines import StaticLines

LEAST_TITLE, MOST_TITLE = 8, 34
"""Cells of the study's title, which gets the space that is left."""


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
    title: StyledSpan = (f" {shorten(clean(draft.title), max(LEAST_TITLE, min(MOST_TITLE, room)))}", "strong")
    return align_at_both_ends((title, *left), right, width)


def finding_line(draft: StudyDraft, about: str) -> StyledLine:
    """The first diagnostic; those in the file `about` come first."""
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
    """The study, EDIT, what is wrong, what is not saved."""

    DEFAULT_CSS = """
    EditTopLine { background: $rise-bar; }
    """

    def draw(self, draft: StudyDraft, busy: str) -> None:
        self.show(top_line(draft, self.size.width, busy=busy))


class FindingLine(StaticLines):
    """The first thing that is wrong."""

    def draw(self, draft: StudyDraft, file: str, explored: ExploredStudy, about: tuple[str, str, str]) -> None:
        """`file`: the file that is shown. `about`: kind and name of the page, and the state under the cursor.

        Findings of exploring about these come after mistakes in the file, and before warnings elsewhere.
        """
        found = explored.about(*about)
        is_first = bool(draft.checked.errors) or any(each.location.file == file for each in draft.findings)
        told = explored_line(explored, draft, found)
        line = finding_line(draft, file) if is_first or not found else told
        line = line or told
        number = len(draft.checked.diagnostics) + len(explored.findings)
        if number < 2 and line_width(line) <= self.size.width:
            self.show(line)
            return
        key = first_key_label(BY_ID["edit.findings"])
        tail: StyledLine = ((f"  {key}", "key"), (f" all {number} " if number > 1 else " all of it ", "plain"))
        self.show((*crop(line, self.size.width - line_width(tail)), *tail))


class BannerLine(StaticLines):
    """A permanent line while a session runs. It takes no row when it is empty."""

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
