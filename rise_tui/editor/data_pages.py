"""Memory, keys and settings: one form each. Rows can be added, renamed and removed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.widget import Widget

from rise_engine.author.edit.edits import AnyEdit, RemoveStartValue, Rename, RenameSetting, SetSetting, SetStartValue
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_tui.editor.form import FormPage
from rise_tui.editor.model.additions import Addition, additions
from rise_tui.editor.model.data_fields import key_choices, key_fields, memory_fields, new_key_edits
from rise_tui.editor.model.draft import FilePlace, is_study_alone
from rise_tui.editor.model.fields import TYPED, EditField, FieldNote
from rise_tui.editor.model.setting_fields import depends_on_design, plan_lines, setting_fields
from rise_tui.editor.page import EditFrame
from rise_tui.rendering.text import StyledLine, crop
from rise_tui.widgets.lines import RowView, StaticLines


def _is_empty(field: EditField, after: EditField | None) -> bool:
    """Whether a field is a heading without a field below it."""
    return field.kind == "heading" and (after is None or after.kind == "heading")


class DataPage(FormPage):
    """A form that fills the page."""

    DEFAULT_CSS = "DataPage #head { background: $rise-bar; }"
    CAN_FILTER = True
    TITLE: ClassVar[str]
    EMPTY: ClassVar[str]
    """The text for an empty page, which shows how to make the first row."""
    COUNTED: ClassVar[tuple[str, str]] = "value", ""
    """The name of the rows, and the text after their number."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.head = StaticLines(id="head")

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.form

    @property
    def first_focus(self) -> Widget | None:
        return self.form.rows

    @property
    def title(self) -> str:
        """The title on the page."""
        return self.TITLE

    @abstractmethod
    def make_fields(self) -> Sequence[EditField]:
        """All fields, from the draft."""

    def draw(self) -> None:
        fields, (noun, after) = self.make_fields(), self.COUNTED
        number = sum(each.kind != "heading" for each in fields)
        count = pluralize(number, noun) + after
        note = self.EMPTY if not number else count if not self.wanted else f"find {self.wanted}"
        head: StyledLine = ((f" {self.title}", "strong"), (f"  {note}", "muted"))
        self.head.show(crop(head, max(20, self.size.width)))
        found = [each for each in fields if each.kind == "heading" or self._is_wanted(each)]
        self.form.show([each for each, after in zip_longest(found, found[1:]) if not _is_empty(each, after)])

    def _is_wanted(self, field: EditField) -> bool:
        return self.wanted.casefold() in f"{field.label} {field.text} {field.note}".casefold()

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        return self.form_calls

    def go_to(self, id: str) -> None:
        """Put the cursor on a field."""
        self.form.rows.select(id)
        self.frame.draw_bars()


class MemoryPage(DataPage):
    """Start values."""

    KIND: ClassVar[str] = "memory"
    TITLE, EMPTY = "MEMORY", "no start values yet: a adds a key"
    COUNTED = "key", " with a start value"

    @property
    def hints(self) -> Mapping[str, str]:
        return {"edit.open": "change", "edit.add": "add", "edit.rename": "rename", "edit.remove": "remove"}

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        more = {"edit.add": self._ask_to_add, "edit.rename": self._ask_to_rename, "edit.remove": self._remove}
        return {**self.form_calls, **more}

    def make_fields(self) -> Sequence[EditField]:
        return memory_fields(self.draft)

    @property
    def place(self) -> FilePlace | None:
        field = self.form.current
        where = self.draft.checked.draft.memory_key_locations.get(field.id) if field is not None else None
        return FilePlace(where.file, where.line, where.line) if where is not None else FilePlace("memory.json", 1, 1)

    def _ask_to_add(self) -> None:
        def take(key: str) -> None:
            if key in self.draft.checked.draft.memory:
                self.go_to(key)
                raise EditRefused(f"there is a key {key} already")
            self.make(SetStartValue(key, ""), then=lambda: self._type_value(key))

        self.frame.ask_text("A new key", "", take, hint="Its name for conditions and texts: score, side.")

    def _type_value(self, key: str) -> None:
        self.go_to(key)
        self.form.open_current()

    def _ask_to_rename(self) -> None:
        if (field := self.form.current) is not None:
            number = sum(not use.defines for use in self.draft.uses.of("key", field.id))
            self.frame.ask_text(
                f"Rename the key {field.id}", field.id,
                lambda new: self.make(*([Rename("key", field.id, new)] if new != field.id else [])),
                hint=f"Also in the {pluralize(number, 'place')} that use it.",
            )  # fmt: skip

    def _remove(self) -> None:
        if (field := self.form.current) is not None:
            self.make(RemoveStartValue(field.id))


class KeysPage(DataPage):
    """The keys of the keyboard."""

    KIND: ClassVar[str] = "keys"
    TITLE, EMPTY = "KEYS", "no keys yet: a adds one"
    COUNTED = "key", ""

    @property
    def hints(self) -> Mapping[str, str]:
        words = {"edit.open": "change", "edit.add": "add", "edit.rename": "key"}
        return {**words, "edit.wording": "label", "edit.remove": "remove"}

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        more = {"edit.add": self._ask_to_add, "edit.rename": self._ask_to_rename, "edit.wording": self._ask_for_label}
        return {**self.form_calls, **more}

    def make_fields(self) -> Sequence[EditField]:
        return key_fields(self.draft)

    @property
    def place(self) -> FilePlace | None:
        field, scenario = self.form.current, self.draft.checked.scenario
        for key in scenario.keys.values() if scenario is not None else ():
            if field is not None and key.label == field.label:
                return FilePlace(key.location.file, key.location.line, key.location.line)
        return FilePlace(SCENARIO_FILE, 1, 1)

    def _ask_to_add(self) -> None:
        def take(key: str) -> None:
            def chosen(value: str) -> None:
                self.make(*new_key_edits(key, value), then=lambda: self.go_to(key))

            taken = next((each for each in key_fields(self.draft) if each.id == key), None)
            if taken is not None:
                self.go_to(key)
                raise EditRefused(f"the key {key} is taken: {taken.text}; enter changes what it does")
            title = f"What does {key} do? A name, or: set score = 1"
            self.frame.choose(title, key_choices(self.draft), chosen, new=TYPED)

        self.frame.ask_text("A new key", "", take, hint="A letter, a digit or a sign: p, 7, .")

    def _ask_to_rename(self) -> None:
        if (field := self.form.current) is not None:
            self.frame.ask_text(
                f"Another key instead of {field.id}", field.id,
                lambda new: self.make(*([RenameSetting(("keys", field.id), new)] if new != field.id else [])),
                hint="A letter, a digit or a sign.",
            )  # fmt: skip

    def _ask_for_label(self) -> None:
        if (field := self.form.current) is not None:
            now = field.note.partition("”")[0].lstrip("“") if field.note.startswith("“") else ""
            self.frame.ask_text(
                f"Label of {field.id}", now,
                lambda label: self.make(SetSetting(("keys", field.id, "label"), label)),
                hint="One or two words for the wizard's screen.",
            )  # fmt: skip


class SettingsPage(DataPage):
    """The settings of scenario.toml and study.toml. Below a setting of a study's design is the plan that it gives."""

    KIND: ClassVar[str] = "settings"
    TITLE, EMPTY = "SETTINGS", "scenario.toml cannot be read: e opens it"
    COUNTED = "setting", ""
    DEFAULT_CSS = "SettingsPage #effect { height: auto; border-top: solid $rise-muted; display: none; }"

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.effect = StaticLines(id="effect")
        self._previewed: Files = {}
        """The files with the typed text; while nothing is typed, they have no meaning."""

    def compose(self) -> ComposeResult:
        yield from super().compose()
        yield self.effect

    @property
    def title(self) -> str:
        return "DESIGN" if is_study_alone(self.draft) else self.TITLE

    @property
    def hints(self) -> Mapping[str, str]:
        return {"edit.open": "change", "edit.add": "add", "edit.remove": "clear"}

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        return {**self.form_calls, "edit.open": self._open, "edit.add": self._ask_to_add}

    def make_fields(self) -> Sequence[EditField]:
        return setting_fields(self.draft)

    def _open(self) -> None:
        self._previewed = {}
        self.form.open_current()

    # --- the plan of a study ------------------------------------------------------------------------------------------

    def draw(self) -> None:
        super().draw()
        self._draw_effect()

    @on(RowView.CursorMoved)
    def _moved(self) -> None:
        self._draw_effect()

    def on_descendant_blur(self) -> None:
        """A field has closed: the typed text no longer counts."""
        self._draw_effect()

    def new_findings(self, edits: Callable[[], tuple[AnyEdit, ...]]) -> list[FieldNote]:
        found = super().new_findings(edits)
        if not any(each.level == "error" for each in found):
            self._previewed = self.frame.study.workspace.preview_edits(*edits())[0].files
            self._draw_effect()
        return found

    def _draw_effect(self) -> None:
        """Show the plan that the design gives, with the typed text, while the cursor is on a setting of the design."""
        field = self.form.current
        files = self._previewed if self.is_typing and self._previewed else self.draft.files
        is_design = field is not None and depends_on_design(field)
        lines, room = plan_lines(self.draft.folder, files) if is_design else [], max(3, self.size.height // 4)
        if len(lines) > room:
            lines = [*lines[: room - 1], f"+{len(lines) - room + 1} more lines: rise-engine study plan shows them all"]
        self.effect.display = bool(lines)
        self.effect.styles.height = len(lines) + 1
        self.effect.show(*(crop(((f" {line}", "plain"),), max(20, self.size.width)) for line in lines))

    # --- additions ----------------------------------------------------------------------------------------------------

    def _ask_to_add(self) -> None:
        """Offer everything that can be added: settings of acts, conditions, properties, checks, factors, recorders."""
        found = {each.choice.value: each for each in additions(self.draft)}

        def take(chosen: str) -> None:
            addition = found[chosen]
            if addition.title:
                self.frame.ask_text(addition.title, "", partial(self._add, addition), hint=addition.hint)
            else:
                self._add(addition, "")

        self.frame.choose("What is added?", [each.choice for each in found.values()], take)

    def _add(self, addition: Addition, typed: str) -> None:
        edits, id = addition.make(typed)
        self.make(*edits, then=lambda: self.go_to(id))

    @property
    def place(self) -> FilePlace | None:
        field = self.form.current
        file = field.id.partition("\0")[0] if field is not None and "\0" in field.id else SCENARIO_FILE
        return FilePlace(file, 1, 1)
