"""Edits of translations, `texts/LANGUAGE.toml` (docs/reference/languages.md)."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct

from rise_engine.author.edit.edits import AddLanguage, Edit, SetSetting, SetTranslation
from rise_engine.author.edit.plan import EditRefused, Plan, Splice
from rise_engine.author.edit.settings import plan_set_setting
from rise_engine.author.edit.study_state import StudyState
from rise_engine.author.edit.text_edits import EditedText, file_of
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.file_names import SCENARIO_FILE, TEXTS_FOLDER
from rise_engine.scenario.languages import language_problem
from rise_engine.scenario.spoken_texts import SpokenText
from rise_engine.scenario.toml_syntax import KeyPath, TomlPair, TomlSection, TomlValue, read_sections
from rise_engine.scenario.toml_tables import quote_toml_key
from rise_engine.scenario.translations import language_file
from rise_engine.syntax.changes import TextEdit, changed_text

_CONTROL = re.compile("[\x00-\x1f\x7f]")
_SHOWN = 60
"""Characters of a text that a sentence shows."""


def plan_set_translation(edit: SetTranslation, study: StudyState) -> Plan:
    """What a text is in another language, and of which text that is the translation: what the act says now. Without a
    value the translation goes, also one of an act that is not there any more.

    :raises EditRefused: there is no such text or language, or the file cannot be changed there.
    """
    if problem := language_problem(edit.language):
        raise EditRefused(problem)
    language, name = existing_language(study, edit.language)
    if edit.value is None:
        return _plan_removal(edit, study, name)
    text, value = _find_text(edit, study), " ".join(edit.value.split())
    if not value:
        raise EditRefused(f"the translation of `{text.id}` is empty; to have none, remove it")
    entries = {"text": value, "of": text.text}
    says = f"{text.id} in {language}: “{_short(value)}”"
    if name not in study.files:
        content = f"[{quote_toml_key(text.act)}]\n{_pair_text(text.key, entries)}\n"
        return Plan(written={name: content.encode()}, says=(f"{says} (the first in {language})",))
    file = TranslationsFile(file_of(study.files, name))
    found = file.entries.get((text.act, text.key))
    if found is None:
        edits, was = [file.insertion(text, entries, study.checked.texts)], " (new)"
    else:
        edits, before = file.replacements(found, entries), file.string(found.values.get("text"))
        was = ": it is right still" if before == value else f" (was “{_short(before)}”)"
    return Plan(splices=file.splices(edits), says=(says + was,))


def plan_add_language(edit: AddLanguage, study: StudyState) -> Plan:
    """A language that texts are to be translated into; its file is made with the first translation.

    :raises EditRefused: it is no language, the study has it already, or the acts are in it.
    """
    language = edit.language.strip()
    if problem := language_problem(language):
        raise EditRefused(problem)
    checked = study.checked
    own = checked.scenario.language if checked.scenario is not None else ""
    if language.lower() == own.lower():
        raise EditRefused(f"the acts are in `{own}` themselves")
    known = {each.lower(): each for each in checked.translations}
    if language.lower() in known:
        raise EditRefused(f"the study is translated into `{known[language.lower()]}` already")
    also = _also(study)
    plan = plan_set_setting(SetSetting(("languages", "also"), [*also, language]), study)
    return Plan(plan.splices, plan.written, (f"texts can be translated into {language}",), plan.noticed)


def _also(study: StudyState) -> list[str]:
    """What `[languages]` lists now; nothing, where it cannot be read."""
    try:
        table = tomllib.loads(file_of(study.files, SCENARIO_FILE).text).get("languages", {})
    except (EditRefused, ValueError, RecursionError):
        return []
    found = table.get("also", []) if isinstance(table, dict) else []
    return [each for each in found if isinstance(each, str)] if isinstance(found, list) else []


def existing_language(study: StudyState, language: str) -> tuple[str, str]:
    """A language as its file is called, and that file, which need not be there yet."""
    for file in study.files:
        if file.lower() == language_file(language).lower():
            return file.rpartition("/")[2].removesuffix(".toml"), file
    return language, language_file(language)


def follow_texts(study: StudyState, moved: Mapping[tuple[str, str], str | None]) -> tuple[Splice, ...]:
    """What becomes of the translations of texts that an edit of an act removes, or gives another number.

    :param moved: by act and key of a text (`("R_Yes", "2/1")`), its new key in the act; None: it goes.
    :raises EditRefused: a file of translations is written so that this cannot be done in it.
    """
    found: list[Splice] = []
    for name in sorted(study.files):
        if not (name.startswith(f"{TEXTS_FOLDER}/") and name.endswith(".toml")):
            continue
        file = TranslationsFile(file_of(study.files, name))
        gone = [entry for of, entry in file.entries.items() if of in moved and moved[of] is None]
        edits = file.removals(gone)
        for of, entry in file.entries.items():
            if (key := moved.get(of)) is not None:
                edits.append(file.renaming(entry, key))
        found += file.splices(edits) if edits else ()
    return tuple(found)


def _plan_removal(edit: SetTranslation, study: StudyState, name: str) -> Plan:
    file = TranslationsFile(file_of(study.files, name)) if name in study.files else None
    found = file.entries.get((edit.act, edit.text)) if file is not None else None
    if file is None or found is None:
        raise EditRefused(f"`{edit.act}/{edit.text}` has no translation into `{edit.language}`")
    was = _short(file.string(found.values.get("text")))
    says = f"{edit.act}/{edit.text} has no translation into {edit.language} any more (was “{was}”)"
    return Plan(splices=file.splices([file.removal(found)]), says=(says,))


def _find_text(edit: SetTranslation, study: StudyState) -> SpokenText:
    texts = study.checked.texts
    found = next((each for each in texts if (each.act, each.key) == (edit.act, edit.text)), None)
    if found is not None:
        return found
    acts = list(dict.fromkeys(each.act for each in texts))
    if edit.act not in acts:
        near = did_you_mean(edit.act, acts, limit=0)
        raise EditRefused(f"there is no act `{edit.act}` that says something{near}")
    keys = [each.key for each in texts if each.act == edit.act]
    raise EditRefused(f"the act `{edit.act}` has no text `{edit.text}`{did_you_mean(edit.text, keys)}")


class TranslationEntry(Struct, frozen=True):
    """A translation as it is written."""

    section: TomlSection
    pair: TomlPair | None
    """The whole of it, `"2/1" = { ... }`; None: it is a section of its own, or lies in a larger value."""
    whole: TomlValue | None
    """Its value; None: it has none of its own."""
    values: dict[str, TomlValue]
    """`text` and `of`."""


class TranslationsFile:
    """A file of translations, for changes that leave all else in it alone."""

    def __init__(self, file: EditedText) -> None:
        """:raises EditRefused: it is no TOML."""
        self._file = file
        self._text = file.text
        self._line_end = "\r\n" if "\r\n" in file.text else "\n"
        try:
            tomllib.loads(file.text)
        except (ValueError, RecursionError) as error:
            raise EditRefused(f"{file.name} cannot be read, so it is not changed: {error}; mend it first") from None
        self._sections = read_sections(file.text)
        self.entries: dict[tuple[str, str], TranslationEntry] = {}
        """By act and text."""
        for section in self._sections:
            self._read_section(section)

    def _read_section(self, section: TomlSection) -> None:
        if len(section.path) == 2:
            values = {pair.names[0]: pair.value for pair in section.pairs if len(pair.names) == 1}
            self.entries.setdefault((section.path[0], section.path[1]), TranslationEntry(section, None, None, values))
            return
        for pair in section.pairs:
            for path, value in _walk((*section.path, *pair.names), pair.value):
                if len(path) == 2:
                    own = pair if path == (*section.path, *pair.names) else None
                    values = {each.names[0]: each.value for each in value.pairs if len(each.names) == 1}
                    self.entries.setdefault((path[0], path[1]), TranslationEntry(section, own, value, values))

    def splices(self, edits: Sequence[TextEdit]) -> tuple[Splice, ...]:
        """The edits in bytes. :raises EditRefused: the file would be no TOML any more, because it is written so."""
        try:
            tomllib.loads(changed_text(self._text, edits))
        except (ValueError, RecursionError):
            raise EditRefused(
                f"{self._file.name} is written in a way in which this cannot be put in; change it in an editor"
            ) from None
        return self._file.splices(edits)

    def string(self, value: TomlValue | None) -> str:
        """What a value says; empty for none, and for another one than a text."""
        if value is None:
            return ""
        found = tomllib.loads(f"_ = {self._text[value.start : value.end]}")["_"]
        return " ".join(found.split()) if isinstance(found, str) else ""

    def replacements(self, found: TranslationEntry, entries: Mapping[str, str]) -> list[TextEdit]:
        """Other values in the place of those of a translation."""
        whole = found.whole
        if whole is not None and (whole.kind != "table" or not found.values):
            return [TextEdit(whole.start, whole.end, _inline(entries))]
        edits = []
        last = max(value.end for value in found.values.values()) if found.values else found.section.header_end
        for name, text in entries.items():
            value = found.values.get(name)
            if value is None:
                between = ", " if whole is not None else self._line_end
                edits.append(TextEdit(last, last, f"{between}{name} = {_quoted(text)}"))
            elif self.string(value) != text:
                edits.append(TextEdit(value.start, value.end, _quoted(text)))
        return edits

    def insertion(self, text: SpokenText, entries: Mapping[str, str], texts: Sequence[SpokenText]) -> TextEdit:
        """A translation that is not there yet, where the order of the acts wants it."""
        new = _pair_text(text.key, entries)
        section = next((each for each in self._sections if each.path == (text.act,)), None)
        if section is not None:
            before = _before(text.key, [each.key for each in texts if each.act == text.act])
            pairs = [pair for pair in section.pairs if pair.names and pair.names[0] in before]
            at = self._line_behind(pairs[-1].value.end if pairs else section.header_end)
            return TextEdit(at, at, f"{self._line_end}{new}")
        head = f"[{quote_toml_key(text.act)}]{self._line_end}{new}"
        before = _before(text.act, [each.act for each in texts])
        sections = [each for each in self._sections if each.path and each.path[0] in before]
        if sections:
            at = self._line_behind(sections[-1].end)
            return TextEdit(at, at, f"{self._line_end * 2}{head}")
        following = next((each for each in self._sections if each.path), None)
        if following is not None:
            at = self._text.rfind("\n", 0, following.start) + 1
            return TextEdit(at, at, f"{head}{self._line_end * 2}")
        gap = "" if not self._text or self._text.endswith("\n") else self._line_end
        gap += self._line_end if self._text.strip() else ""
        return TextEdit(len(self._text), len(self._text), f"{gap}{head}{self._line_end}")

    def removals(self, gone: Sequence[TranslationEntry]) -> list[TextEdit]:
        """Several that go at once; a section of which nothing is left goes whole."""
        edits: list[TextEdit] = []
        emptied: list[TomlSection] = []
        for entry in gone:
            section = entry.section
            if any(section is each for each in emptied):
                continue
            of_section = [each.pair for each in gone if each.section is section]
            if entry.pair is not None and section.path and all(pair in of_section for pair in section.pairs):
                emptied.append(section)
                edits.append(self._lines_of(section.start, section.end))
            else:
                edits.append(self.removal(entry))
        return edits

    def renaming(self, entry: TranslationEntry, key: str) -> TextEdit:
        """A translation under another key. :raises EditRefused: its key stands nowhere by itself."""
        parts = entry.pair.parts if entry.pair is not None else entry.section.parts
        if entry.pair is None and entry.whole is not None:
            raise EditRefused(f"{self._file.name} is written in a way in which this cannot be changed by itself")
        return TextEdit(parts[-1].start, parts[-1].end, quote_toml_key(key))

    def removal(self, found: TranslationEntry) -> TextEdit:
        """A translation that goes, with its line; with the last one of an act, the header, too.

        :raises EditRefused: it does not stand on a line of its own.
        """
        section, pair = found.section, found.pair
        if pair is None and found.whole is not None:
            raise EditRefused(f"{self._file.name} is written in a way in which this cannot be taken out by itself")
        start, end = (section.start, section.end) if pair is None else (pair.start, pair.value.end)
        if pair is not None and section.path and section.pairs == [pair]:
            start = section.start
        return self._lines_of(start, end)

    def _lines_of(self, start: int, end: int) -> TextEdit:
        """Takes lines out, and the blank line before a header."""
        start, end = self._text.rfind("\n", 0, start) + 1, self._line_behind(end)
        if self._text[start:end].lstrip().startswith("[") and (gap := re.search(r"(\r?\n)\r?\n\Z", self._text[:start])):
            start = gap.end(1)
            return TextEdit(start, min(end + self._end_length(end), len(self._text)), "")
        return TextEdit(start, end + self._end_length(end), "")

    def _end_length(self, at: int) -> int:
        """How many characters the line end there has."""
        return 2 if self._text.startswith("\r\n", at) else int(at < len(self._text))

    def _line_behind(self, at: int) -> int:
        """Where the line ends, with its comment, in which a place is."""
        end = self._text.find("\n", at)
        end = len(self._text) if end < 0 else end
        return end - 1 if end > at and self._text[end - 1] == "\r" else end


def _walk(path: KeyPath, value: TomlValue) -> Iterator[tuple[KeyPath, TomlValue]]:
    """A value and all that is in it, with their paths."""
    yield path, value
    for pair in value.pairs:
        yield from _walk((*path, *pair.names), pair.value)


def _before(name: str, names: Sequence[str]) -> set[str]:
    return set(names[: names.index(name)])


def _pair_text(key: str, entries: Mapping[str, str]) -> str:
    return f"{quote_toml_key(key)} = {_inline(entries)}"


def _inline(entries: Mapping[str, str]) -> str:
    return "{ " + ", ".join(f"{name} = {_quoted(text)}" for name, text in entries.items()) + " }"


def _quoted(text: str) -> str:
    """A text as TOML has it; one with many quotation marks in those in which they stand as they are."""
    if '"' in text and "'" not in text and not _CONTROL.search(text):
        return f"'{text}'"
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04X}", escaped) + '"'


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetTranslation: plan_set_translation,
    AddLanguage: plan_add_language,
}
