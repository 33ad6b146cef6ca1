"""A page with a list, below which what is under the cursor is changed over as many lines as it needs."""

from __future__ import annotations

from abc import abstractmethod

from textual import on
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.widgets import TextArea

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import clean
from rise_engine.scenario.loader import LoadResult
from rise_tui.editor.model.draft import first_new_finding
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.editor.sentence_field import SentenceField
from rise_tui.rendering.later import Later
from rise_tui.rendering.text import TextRole, crop, shorten, wrap
from rise_tui.widgets.static_lines import StaticLines

LABEL = 8
"""Cells before what is typed."""
SAID = 2
"""Rows for what is said of it."""


class SentencePage(EditPage):
    """Subclasses say what becomes of what is typed (`edits_typed`), and yield `compose_field` at their end."""

    DEFAULT_CSS = """
    SentencePage #typed { display: none; height: auto; }
    SentencePage #label { width: 8; }
    SentencePage #said { display: none; height: 2; }
    SentencePage.-typing #typed, SentencePage.-typing #said { display: block; }
    """

    def __init__(self, frame: EditFrame, name: str = "", *, exact: bool = False) -> None:
        """`exact`: whether blanks and line ends within what is typed count."""
        super().__init__(frame, name)
        self.label, self.field, self.said = StaticLines(id="label"), SentenceField(exact=exact), StaticLines(id="said")
        self._is_open = False

    def compose_field(self) -> ComposeResult:
        """The field with its label, and what is said of it."""
        with Horizontal(id="typed"):
            yield self.label
            yield self.field
        yield self.said

    @abstractmethod
    def edits_typed(self, said: str) -> tuple[AnyEdit, ...]:
        """What makes it this. :raises EditRefused: it cannot be meant."""

    @abstractmethod
    def go_on(self, step: int, *, changed: bool) -> None:
        """The field was taken and is closed; go on to the next (1) or the one before (-1), 0: to none."""

    @abstractmethod
    def focus_list(self) -> None:
        """The field is closed."""

    def step_over(self, step: int) -> int:
        """Called when what is typed is taken, before it is made: gives what `go_on` is called with."""
        return step

    def finding_of(self, checked: LoadResult, edits: tuple[AnyEdit, ...]) -> tuple[str, TextRole]:
        """What is said of what is typed, from the check of the study as it would be."""
        found = first_new_finding(self.draft, checked)
        if found is None:
            return "", "muted"
        return found.message, "fault" if found.severity == "error" else "wait"

    @property
    def is_typing(self) -> bool:
        return self._is_open

    def open_field(self, label: str, text: str) -> None:
        """Type in this."""
        self._is_open = True
        self.add_class("-typing")
        self.label.show(((f" ▸{shorten(label, LABEL - 3)}", "accent"),))
        with self.field.prevent(TextArea.Changed):
            self.field.begin(text)
        self.field.focus()
        self.say_typed("")
        self.frame.draw_bars()

    def close_field(self) -> None:
        """Leave the field."""
        self._is_open = False
        self.remove_class("-typing")
        self.focus_list()
        self.frame.draw_bars()

    def say_typed(self, sentence: str, role: TextRole = "muted") -> None:
        """Say something of what is typed."""
        mark = {"fault": "✗ ", "wait": "▲ "}.get(role, "")
        pieces = wrap(f"{mark}{sentence}", max(20, self.size.width - LABEL - 2))[:SAID] if sentence else []
        self.said.show(*(crop(((" " * LABEL + piece, role),), self.size.width) for piece in pieces))

    @on(SentenceField.LeaveSentence)
    def _left(self, event: SentenceField.LeaveSentence) -> None:
        event.stop()
        self.close_field()

    @on(SentenceField.TakeSentence)
    def _taken(self, event: SentenceField.TakeSentence) -> None:
        event.stop()
        if not self.is_typing:
            return
        try:
            edits = self.edits_typed(event.text)
        except EditRefused as refused:
            self.say_typed(clean(str(refused)), "fault")
            return
        step = self.step_over(event.step)
        self.close_field()
        if edits:
            self.frame.make(*edits, then=lambda: self.go_on(step, changed=True))
        else:
            self.go_on(step, changed=False)

    @on(TextArea.Changed)
    def _typed(self, event: TextArea.Changed) -> None:
        event.stop()
        if self.is_typing:
            self.run_worker(Later(self._preview, self.field.sentence), group="preview", exclusive=True)

    async def _preview(self, said: str) -> None:
        """Say what would be wrong with the files then that is not wrong now."""
        found: tuple[str, TextRole] = ("", "muted")
        try:
            if edits := self.edits_typed(said):
                found = self.finding_of(await self.frame.study.preview(*edits), edits)
        except EditRefused as refused:
            found = str(refused), "fault"
        if self.is_typing:
            self.say_typed(clean(found[0]), found[1])
