"""All texts of a study beside their translations. Both are changed here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from textual import on
from textual.app import ComposeResult

from rise_engine.author.edit.edits import AddLanguage, AnyEdit, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.model.draft import FilePlace
from rise_tui.editor.model.fields import FieldChoice, FieldNote
from rise_tui.editor.model.text_rows import (
    ORIGINAL,
    TextEntry,
    TextsView,
    column_line,
    confirmation_edits,
    count_texts,
    entry_head,
    folder_from,
    head_line,
    languages_of,
    note_lines,
    original_edits,
    original_lines,
    own_language,
    place_of,
    shown_entries,
    text_entries,
    text_rows,
    translation_edits,
    translation_lines,
    view_named,
)
from rise_tui.editor.page import EditFrame
from rise_tui.editor.sentence_page import SentencePage
from rise_tui.rendering.text import StyledLine
from rise_tui.widgets.lines import RowList, RowView, StaticLines

LANGUAGE_HINT = "Its tag: fr, pt-BR. Another way of speaking to people: de-x-sie."


class TextsPage(SentencePage):
    """Every text of the acts. Column 0 is the act's text, 1 its translation into the shown language."""

    KIND: ClassVar[str] = "texts"
    CAN_FILTER = True
    EXPECTED = ("stale-translation", "untranslated")
    MIN_DETAIL = 6

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name, RowList(id="texts"))
        self.rows: RowList
        self.view = view_named(name)
        self.columns = StaticLines(id="columns")
        self.column = 1
        self._entries: list[TextEntry] = []
        self._shown: list[TextEntry] = []
        self._typing: TextEntry | None = None
        self._following = ""
        """The id of the text to open after the typed text was applied."""

    def compose_head(self) -> ComposeResult:
        yield self.head
        yield self.columns

    @property
    def entry(self) -> TextEntry | None:
        """The text under the cursor."""
        at = self.rows.cursor
        return self._shown[at] if 0 <= at < len(self._shown) else None

    @property
    def place(self) -> FilePlace | None:
        entry = self.entry
        return place_of(self.draft, entry, self.view.language, self.column) if entry is not None else None

    @property
    def hints(self) -> Mapping[str, str]:
        words = {"edit.open": "change"}
        if self.entry is not None and self.entry.state == "stale":
            words["edit.still-right"] = "still right"
        if self.view.language:
            words["edit.only"] = "all" if self.view.only else "only ✗ ▲"
        return {**words, "edit.go": "act", "edit.language": "languages"}

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        return (*super().own_hints, *([("←→", "language")] if self.view.language else []))

    # --- drawing ----------------------------------------------------------------------------------------------------

    def draw(self) -> None:
        self.hide_list(True)  # two languages side by side need the whole width
        languages = languages_of(self.draft)
        if self.view.language not in languages:
            self.view = self.view._replace(language=languages[0] if languages else "")
        if not self.view.language:
            self.column = 0
        self._entries = text_entries(self.draft, self.view.language)
        self._shown = shown_entries(self._entries, self.view)
        width = max(40, self.size.width)
        row_width = max(38, self.rows.row_width)
        self.head.show(head_line(self.draft, self.view, self._entries, len(self._shown), width))
        self.columns.show(column_line(self.draft, self.view, self.column, row_width))
        self.rows.show(text_rows(self.draft, self.view, self._shown, self.column, row_width))
        if self.view.id:  # the last place on the page, or the requested one
            self.rows.select(self.view.id)
            self.view = self.view._replace(id="")
        if self.rows.cursor < 0:
            self.rows.move_cursor(0, by_wizard=False)
        if self._typing is not None:
            self._typing = next((each for each in self._entries if each.text.id == self._typing.text.id), None)
            if self._typing is None:
                self.close_field()
        self.draw_detail()

    @on(RowView.CursorMoved)
    def draw_detail(self) -> None:
        if not self.is_typing:
            self._typing = None
        width, entry = max(40, self.size.width), self._typing or self.entry
        if entry is None:
            if not self._entries:
                nothing = "this study has no texts yet"
            elif self.view.only and not self.view.wanted:
                nothing = f"every translation into {self.view.language} is there and up to date: m shows all"
            else:
                nothing = "no such text: esc shows all"
            self.parting.show(((f" {nothing}", "muted"),))
            self.show_detail([])
            return
        self.parting.show(entry_head(self.draft, entry, width))
        self.show_detail(self._detail_lines(entry, width))

    def _detail_lines(self, entry: TextEntry, width: int) -> list[StyledLine]:
        """The whole text; during a change, only the other language."""
        language, typing = self.view.language, self.is_typing
        own = original_lines(self.draft, entry, width, is_marked=self.column == 0)
        other = translation_lines(self.draft, entry, language, width, is_marked=self.column == 1) if language else []
        if typing:
            return own if self.column == 1 else other
        folder = folder_from(Path.cwd(), self.draft.folder)
        return [*own, *other, *note_lines(self.draft, entry, language, folder, width)]

    def on_unmount(self) -> None:
        self.hide_list(False)

    # --- keys -------------------------------------------------------------------------------------------------------

    def filter(self, text: str) -> None:
        self.view = self.view._replace(wanted=text)
        self.draw()

    def leave(self) -> bool:
        if self.view.only or self.view.wanted:
            self._show_view(self.view._replace(only=False, wanted=""))
            return True
        return False

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        return {
            "edit.open": self.open_current,
            "edit.other": lambda: self._select_column(1 - self.column),
            "edit.only": lambda: self._show_view(self.view._replace(only=not self.view.only)),
            "edit.still-right": self._confirm_translation,
            "edit.go": self._go_to_act,
            "edit.language": self._choose_language,
            "edit.add": self._ask_for_language,
            "edit.remove": self._remove,
        }

    def _show_view(self, view: TextsView) -> None:
        """Show another part of the texts. The cursor stays on its text if that is still shown."""
        self.view = view._replace(id=self.entry.text.id if self.entry is not None else "")
        self.draw()
        self.frame.draw_bars()

    def _select_column(self, column: int) -> None:
        if column == 1 and not self.view.language:
            raise EditRefused("the study has one language: a adds another")
        self.column = column
        self._show_view(self.view)

    def turn(self, step: int) -> bool:
        """Go through the acts' texts and then the languages in order."""
        languages = languages_of(self.draft)
        at = languages.index(self.view.language) if self.view.language else 0
        at = at + step if self.column == 1 else (0 if step > 0 and self.view.language else -1)
        if 0 <= at < len(languages):
            self.view, self.column = self.view._replace(language=languages[at]), 1
        elif at < 0:
            self.column = 0
        self._show_view(self.view)
        return True

    def _confirm_translation(self) -> None:
        if self.entry is not None:
            self.make(*confirmation_edits(self.entry, self.view.language))

    def _remove(self) -> None:
        """Remove the translation."""
        if self.entry is None or self.column == 0 or self.entry.translation is None:
            raise EditRefused("del removes only translations here; remove a text on its act's page (j)")
        self.make(*translation_edits(self.entry, self.view.language, ""))

    def _go_to_act(self) -> None:
        if (entry := self.entry) is not None:
            back = self.view._replace(id=entry.text.id)
            self.frame.open_page("act", f"{entry.text.act}\0{entry.text.action.id}", back=(self.KIND, back.name))

    def _show_language(self, language: str) -> None:
        self.column = 1
        self._show_view(self.view._replace(language=language))

    def _choose_language(self) -> None:
        """Let the author choose a language, or add a new one."""
        languages = languages_of(self.draft)
        if not languages:
            self._ask_for_language()
            return
        choices = []
        for language in languages:
            counts = count_texts(text_entries(self.draft, language))
            help = f"✓ {counts.there}  ▲ {counts.stale} changed since  ✗ {counts.missing} missing"
            choices.append(FieldChoice(language, language, help))
        title = f"Translate {own_language(self.draft) or 'the acts'} into; a new tag adds a language"
        self.frame.choose(title, choices, self._take_language, now=self.view.language, new="a new language")

    def _ask_for_language(self) -> None:
        self.frame.ask_text("Another language", "", self._add_language, hint=LANGUAGE_HINT)

    def _take_language(self, language: str) -> None:
        if language in languages_of(self.draft):
            self._show_language(language)
        else:
            self._add_language(language)

    def _add_language(self, language: str) -> None:
        """Add a language. For the first one, also ask for the language of the acts."""

        def add(*edits: AnyEdit) -> None:
            self.make(*edits, AddLanguage(language), then=lambda: self._show_language(language))

        if own_language(self.draft):
            add()
            return
        self.frame.ask_text(
            "In which language are the acts?", "en", lambda own: add(SetSetting(("language",), own)),
            hint="Its tag: en, de, pt-BR.",
        )  # fmt: skip

    # --- changing a text ----------------------------------------------------------------------------------------------

    def open_current(self) -> None:
        """Change the original or the translation under the cursor."""
        entry = self.entry
        if entry is None:
            return
        if self.column == 0:  # refuse before typing
            original_edits(self.draft, entry, f"{entry.text.text} …")
        self._typing = entry
        name = self.view.language if self.column == 1 else own_language(self.draft) or ORIGINAL
        self.open_field(name, entry.text.text if self.column == 0 else entry.translated)

    def edits_typed(self, translated: str) -> tuple[AnyEdit, ...]:
        entry = self._typing
        if entry is None:
            return ()
        if self.column == 0:
            return original_edits(self.draft, entry, translated)
        return translation_edits(entry, self.view.language, translated)

    def step_over(self, step: int) -> int:
        """Find the next text now, because a changed text may no longer be among the shown ones."""
        at = self.rows.cursor + step
        self._following = self._shown[at].text.id if step and 0 <= at < len(self._shown) else ""
        return step

    def go_on(self, step: int, *, changed: bool) -> None:
        entry = self.entry
        if not changed and entry is not None and entry.state == "stale" and self.column == 1:
            self.frame.say("not changed; the text has changed since: press s if the translation is still right")
        if self._following:
            self.rows.select(self._following)
            self.open_current()

    def new_findings(self, edits: Callable[[], tuple[AnyEdit, ...]]) -> list[FieldNote]:
        found, entry = super().new_findings(edits), self._typing
        if found or entry is None or self.column == 1 or not edits():
            return found
        languages = [tag for tag, each in self.draft.checked.translations.items() if entry.text.id in each.texts]
        changed = f"the text will have changed since its translation into {', '.join(languages)}"
        return [FieldNote("info", changed)] if languages else []
