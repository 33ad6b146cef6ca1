"""The texts of a study as rows: the text, its translation, and whether that is missing or stale."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from msgspec.structs import replace

from rise_engine.author.edit.edits import AnyEdit, SetTranslation
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.translations import edit_of_original, written_original
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.reading.translations import Translation, slot_problem
from rise_engine.scenario.speech.spoken_texts import SpokenText
from rise_engine.scenario.speech.template import Template
from rise_tui.editor.model.acts import call_seconds, when_text
from rise_tui.editor.model.draft import FilePlace, StudyDraft
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    align_at_both_ends,
    clean,
    crop,
    fixed_span,
    format_seconds,
    wrap,
)

TextState: TypeAlias = Literal["there", "stale", "wrong", "missing", "not needed"]
"""The state of a translation: up to date; outdated; with other memory values; missing; missing and not needed."""
INCOMPLETE_STATES: tuple[TextState, ...] = ("stale", "wrong", "missing")
MARKS: dict[TextState, StyledSpan] = {
    "there": ("✓ ", "muted"),
    "stale": ("▲ ", "wait"),
    "wrong": ("✗ ", "fault"),
    "missing": ("✗ ", "fault"),
    "not needed": ("· ", "muted"),
}
WIDE = 100
"""Minimum width in cells for rows with the time of a text and its company."""
LABEL = 8
"""Cells before a text shown in full."""
_MEASURE = 16
"""Cells for the length of a text."""
ORIGINAL = "acts"
"""The language of the acts if none is given."""


class TextEntry(NamedTuple):
    """A text with its translation into one language."""

    text: SpokenText
    translation: Translation | None
    state: TextState

    @property
    def translated(self) -> str:
        """The text in the other language; empty: none."""
        return self.translation.template.text if self.translation is not None else ""


class TextCounts(NamedTuple):
    """The progress of a language."""

    there: int
    stale: int
    wrong: int
    missing: int
    of: int
    """All texts that need a translation."""


class TextsView(NamedTuple):
    """The visible part of the texts, which is restored when the page is opened again."""

    language: str = ""
    id: str = ""
    """The id of the text under the cursor."""
    only: bool = False
    """Show only texts that are missing, stale or wrong."""
    wanted: str = ""

    @property
    def name(self) -> str:
        """The view as a page's name."""
        return "\0".join((self.language, self.id, "only" if self.only else "", self.wanted))


def view_named(name: str) -> TextsView:
    """The view of this `TextsView.name`. Missing parts are as on a newly opened page."""
    language, id, only, wanted = (name.split("\0") + [""] * 4)[:4]
    return TextsView(language, id, only == "only", wanted)


def own_language(draft: StudyDraft) -> str:
    """The language of the acts, even while there are errors; empty: not given."""
    found = draft.values_in(SCENARIO_FILE).get("language")
    return found.strip() if isinstance(found, str) else ""


def languages_of(draft: StudyDraft) -> tuple[str, ...]:
    """The languages that texts are translated into."""
    return tuple(draft.checked.translations)


def text_entries(draft: StudyDraft, language: str) -> list[TextEntry]:
    """All texts in the order of the acts. Without a language, none of them needs a translation."""
    found = draft.checked.translations.get(language)
    if found is None:
        return [TextEntry(text, None, "not needed") for text in draft.checked.texts]
    given = [(text, found.texts.get(text.id)) for text in draft.checked.texts]
    return [TextEntry(text, translation, _state(text, translation)) for text, translation in given]


def _state(text: SpokenText, translation: Translation | None) -> TextState:
    if translation is None:
        return "missing" if text.is_needed else "not needed"
    if translation.of != text.text:
        return "stale"
    return "wrong" if slot_problem(text.template, translation.template) else "there"


def count_texts(entries: Sequence[TextEntry]) -> TextCounts:
    """The counts over all texts of a study."""
    states = [each.state for each in entries]
    there, stale, wrong, missing = (states.count(state) for state in ("there", *INCOMPLETE_STATES))
    return TextCounts(there, stale, wrong, missing, there + stale + wrong + missing)


def shown_entries(entries: Sequence[TextEntry], view: TextsView) -> list[TextEntry]:
    """The texts that a view shows."""
    wanted = view.wanted.casefold()
    return [
        each
        for each in entries
        if (not view.only or each.state in INCOMPLETE_STATES)
        and wanted in f"{each.text.id}\n{each.text.text}\n{each.translated}".casefold()
    ]


def find_text(draft: StudyDraft, file: str, line: int) -> TextsView | None:
    """The translation at a line of a file of translations."""
    for language, found in draft.checked.translations.items():
        if found.file == file:
            before = [(where.line, f"{act}/{key}") for (act, key), where in found.keys.items() if where.line <= line]
            return TextsView(language, max(before, default=(0, ""))[1])
    return None


# --- rows -----------------------------------------------------------------------------------------------------------


class _Columns(NamedTuple):
    """Cells of each column."""

    act: int
    key: int
    when: int
    beside: int
    text: int
    translated: int


def _columns(width: int, *, is_translated: bool) -> _Columns:
    act, key, when, beside = (17, 7, 11, 22) if width >= WIDE else (13, 6, 0, 0)
    room = width - 1 - act - 1 - key - when - beside
    translated = (room - 3) // 2 if is_translated else 0
    return _Columns(act, key, when, beside, max(8, room - (translated + 3 if translated else 0)), translated)


def head_line(draft: StudyDraft, view: TextsView, entries: Sequence[TextEntry], shown: int, width: int) -> StyledLine:
    """TEXTS, the two languages, the progress, and the shown texts."""
    own, languages = own_language(draft) or ORIGINAL, languages_of(draft)
    left: list[StyledSpan] = [(" TEXTS", "strong"), (f"  {own}", "accent")]
    if view.language:
        counts = count_texts(entries)
        at = f" ({languages.index(view.language) + 1} of {len(languages)})" if len(languages) > 1 else ""
        left.append((f" → {view.language}{at}", "accent"))
        left.append((f"   ✓ {counts.there}", "plain"))
        left.append((f"   ▲ {counts.stale} changed since", "wait" if counts.stale else "muted"))
        left += [(f"   ✗ {counts.wrong} wrong", "fault")] if counts.wrong else []
        left.append((f"   ✗ {counts.missing} missing", "fault" if counts.missing else "muted"))
        left.append((f"   of {counts.of}", "muted"))
    else:
        left.append((f"   {pluralize(len(entries), 'text')}, in no other language: a adds one", "muted"))
    notes = [*(["only ✗ ▲"] if view.only else []), *([f"find {view.wanted}"] if view.wanted else [])]
    right = f"{' · '.join(notes)}: {shown} " if notes else ""
    return align_at_both_ends(tuple(left), ((clean(right), "wait"),), width)


def column_line(draft: StudyDraft, view: TextsView, column: int, width: int) -> StyledLine:
    """The names of the columns; the one for Enter is marked.

    :param column: 0: the acts' texts; 1: the translation.
    """
    cells = _columns(width, is_translated=bool(view.language))
    own = own_language(draft) or ORIGINAL
    line: list[StyledSpan] = [fixed_span(" act", cells.act + 2, "muted"), fixed_span("no.", cells.key, "muted")]
    if cells.when:
        line += [fixed_span("when", cells.when, "muted"), fixed_span("with", cells.beside, "muted")]
    line.append(fixed_span(f"▸{own}" if column == 0 else own, cells.text, "accent" if column == 0 else "muted"))
    if cells.translated:
        name = f" ▸{view.language}" if column == 1 else f"  {view.language}"
        line.append(fixed_span(f" {name}", cells.translated + 3, "accent" if column == 1 else "muted"))
    return crop(tuple(line), width)


def text_rows(draft: StudyDraft, view: TextsView, shown: Sequence[TextEntry], column: int, width: int) -> list[ListRow]:
    """One row for each text. The first text of an act also shows the act's name."""
    cells = _columns(width, is_translated=bool(view.language))
    rows, before = [], ""
    for each in shown:
        text, act = each.text, each.text.act
        line: list[StyledSpan] = [
            (" ", "plain"),
            fixed_span(act if act != before else "", cells.act, "strong"),
            (" ", "plain"),
            fixed_span(text.key, cells.key, "accent"),
        ]
        if cells.when:
            line += [fixed_span(when_text(text.action.wait_for), cells.when, "muted")]
            line += [fixed_span(spoken_together(draft.checked, text), cells.beside - 1, "muted"), (" ", "plain")]
        line.append(fixed_span(text.text, cells.text, "plain" if column == 0 else "muted"))
        if cells.translated:
            other = each.translated or ("–" if each.state == "missing" else "")
            line += [(" ", "plain"), MARKS[each.state]]
            line.append(fixed_span(other, cells.translated, "plain" if column == 1 else "muted"))
        rows.append(ListRow(text.id, tuple(line), full=f"{text.id} {text.text} {each.translated}"))
        before = act
    return rows


def spoken_together(checked: LoadResult, text: SpokenText) -> str:
    """Everything that begins at the same time; empty: nothing."""
    act = checked.draft.acts.get(text.act)
    found = []
    for other in act.actions if act is not None else ():
        if other.id != text.action.id and set(other.wait_for) == set(text.action.wait_for):
            value = other.calls[0].parameters.get("value")
            found.append(value.text if value is not None else other.calls[0].type)
    return ", ".join(found)


# --- one text in full -----------------------------------------------------------------------------------------------


def entry_head(draft: StudyDraft, entry: TextEntry, width: int) -> StyledLine:
    """The text's id, its time and company, and its line."""
    text, where = entry.text, _place_of_original(draft, entry.text)
    beside = spoken_together(draft.checked, text)
    left: StyledLine = (
        (f" {clean(text.id)}", "accent"),
        (f"  {when_text(text.action.wait_for)}{f', with {clean(beside)}' if beside else ''}", "muted"),
    )
    return align_at_both_ends(left, ((f"{where.file}:{where.line} ", "muted"),), width)


def whole_text(label: str, text: str, measure: str, width: int, *, is_marked: bool, role: TextRole) -> list[StyledLine]:
    """A text on the lines that it needs, after its label. Its length is at the end of the first line."""
    room = max(10, width - LABEL - _MEASURE)
    pieces = wrap(text, room)
    mark = "▸" if is_marked else " "
    head: StyledSpan = fixed_span(f" {mark}{label}", LABEL - 1, "accent" if is_marked else "muted")
    lines = [align_at_both_ends((head, (" ", "plain"), (pieces[0], role)), ((f"{measure} ", "muted"),), width)]
    return [*lines, *(((" " * LABEL, "plain"), (piece, role)) for piece in pieces[1:])]


def original_lines(draft: StudyDraft, entry: TextEntry, width: int, *, is_marked: bool) -> list[StyledLine]:
    """The act's text."""
    text = entry.text
    measure = _measure(draft.checked, text, text.template)
    return whole_text(
        own_language(draft) or ORIGINAL, text.text, measure, width, is_marked=is_marked, role="plain"
    )  # fmt: skip


def translation_lines(
    draft: StudyDraft, entry: TextEntry, language: str, width: int, *, is_marked: bool
) -> list[StyledLine]:
    """The text in another language."""
    if entry.translation is None:
        missing = entry.state == "missing"
        sentence = "✗ not translated yet" if missing else "needs no translation"
        return whole_text(language, sentence, "", width, is_marked=is_marked, role="fault" if missing else "muted")
    measure = _measure(draft.checked, entry.text, entry.translation.template)
    return whole_text(language, entry.translated, measure, width, is_marked=is_marked, role="plain")


def note_lines(draft: StudyDraft, entry: TextEntry, language: str, folder: str, width: int) -> list[StyledLine]:
    """Notes about a text: whether it has changed, its slots, and how to start a session in this language.

    :param folder: the study's folder, as a command names it from here.
    """
    notes: list[tuple[str, TextRole]] = []
    if entry.state == "stale" and entry.translation is not None:
        was = clean(entry.translation.of)
        notes.append((f"▲ the text has changed since it was translated. It was “{was}”. s: it is still right", "wait"))
    if entry.state == "wrong" and entry.translation is not None:
        notes.append((f"✗ {slot_problem(entry.text.template, entry.translation.template)}", "fault"))
    slots = list(dict.fromkeys(f"{{{slot.key}}}" for slot in entry.text.template.slots))
    if slots:
        notes.append((f"{', '.join(slots)}: from the memory. Keep it, and translate the words after |", "muted"))
    notes.append((session_note(draft, language, folder), "muted"))
    return [
        ((" " * (2 if not at else 4) + piece, role),)
        for note, role in notes
        for at, piece in enumerate(wrap(note, width - 5))
    ]


def session_note(draft: StudyDraft, language: str, folder: str) -> str:
    """How to start a session in a language."""
    if not language:
        return f"a session: rise-tui --config {shlex.quote(folder)}"
    command = f"rise-tui --config {shlex.quote(folder)} --language {language}"
    if STUDY_FILE in draft.files:
        command = "from the column `language` of participants.csv"
    counts = count_texts(text_entries(draft, language))
    lacking = [f"{pluralize(counts.missing, 'text')} missing"] if counts.missing else []
    lacking += [f"{pluralize(counts.wrong, 'text')} wrong"] if counts.wrong else []
    after = f"; refused now: {' and '.join(lacking)}" if lacking else ""
    return f"a session in {language}: {command}{after}"


def _measure(checked: LoadResult, text: SpokenText, template: Template) -> str:
    """The number of characters, and the probable time to speak them."""
    return f"{len(template.text)} · {format_seconds(speaking_seconds(checked, text, template))} s"


def speaking_seconds(checked: LoadResult, text: SpokenText, template: Template) -> float:
    """The probable time to speak something in place of a text, with the memory's start values."""
    spec = checked.robot.actions[text.call.type]
    call = replace(text.call, parameters={**text.call.parameters, text.parameter: template})
    return call_seconds(call, spec, checked.draft.memory, {text.parameter: template.text})


def place_of(draft: StudyDraft, entry: TextEntry, language: str, column: int) -> FilePlace:
    """The line of a text or its translation; for a missing one, its act's line in the translation, or line 1."""
    if column == 1 and entry.translation is not None:
        where = entry.translation.location
        return FilePlace(where.file, where.line, where.line)
    if column == 1 and (found := draft.checked.translations.get(language)) is not None and found.file in draft.files:
        section = found.acts.get(entry.text.act)
        return FilePlace(found.file, section.line if section else 1, section.line if section else 1)
    return _place_of_original(draft, entry.text)


def _place_of_original(draft: StudyDraft, text: SpokenText) -> FilePlace:
    act, written = draft.outline.act(text.act), written_original(text, draft.outline)
    if act is None or written is None:
        where = text.action.location
        return FilePlace(where.file, where.line, where.line)
    return FilePlace(act.file, written.line, written.last_line)


def folder_from(here: Path, folder: str) -> str:
    """A folder as a command names it from `here`: relative if it is below, else absolute."""
    path = Path(folder)
    return path.relative_to(here).as_posix() if path.is_relative_to(here) else str(path)


# --- edits ----------------------------------------------------------------------------------------------------------


def original_edits(draft: StudyDraft, entry: TextEntry, typed: str) -> tuple[AnyEdit, ...]:
    """The edits that change an act's text; none if it is the same.

    :raises EditRefused: the text is empty, or can only be changed in its file.
    """
    text, typed = entry.text, " ".join(typed.split())
    if typed == text.text:
        return ()
    if not typed:
        raise EditRefused("a text cannot be empty: remove the action or the wording on the act's page (j)")
    try:
        return (edit_of_original(text, typed, draft.outline),)
    except EditRefused as refused:
        where = text.action.location
        raise EditRefused(f"{refused}; e opens {where.file}, line {where.line}") from None


def translation_edits(entry: TextEntry, language: str, typed: str) -> tuple[AnyEdit, ...]:
    """The edits that set a translation. An empty text removes it."""
    typed = " ".join(typed.split())
    if typed == entry.translated:
        return ()
    return (SetTranslation(language, entry.text.act, entry.text.key, typed or None),)


def confirmation_edits(entry: TextEntry, language: str) -> tuple[AnyEdit, ...]:
    """The edits that confirm a stale translation for the present text.

    :raises EditRefused: the translation is not stale, or has other memory values than the text.
    """
    if entry.translation is None or entry.state != "stale":
        raise EditRefused(f"{entry.text.id} in {language or 'another language'} is not of an earlier text")
    if problem := slot_problem(entry.text.template, entry.translation.template):
        raise EditRefused(f"it cannot still be right: {problem}")
    return (SetTranslation(language, entry.text.act, entry.text.key, entry.translated),)
