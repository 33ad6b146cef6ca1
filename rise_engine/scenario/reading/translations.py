"""Reads translations, `texts/LANGUAGE.toml`, and replaces the texts of the acts by them (docs/reference/languages.md).

[R_Praise]
"2/1" = { text = "Sehr gut!", of = "Very good!" }     # of: the text that it was translated from
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.expression.errors import shorten
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.study_paths import TEXTS_FOLDER
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, toml_of
from rise_engine.scenario.model import Act, Action, ActionCall, RobotProfile, SourceLocation
from rise_engine.scenario.parameters import LANGUAGE
from rise_engine.scenario.reading.ssml_checks import find_ssml_problems
from rise_engine.scenario.speech.languages import language_fits, language_problem
from rise_engine.scenario.speech.spoken_texts import (
    SpokenText,
    TableText,
    missing_sentences,
    own_language,
    spoken_texts,
    table_texts,
)
from rise_engine.scenario.speech.template import Template, TemplateError, parse_template

MAX_TEXTS_BYTES = 4_000_000
_FORM = '"2/1" = { text = "Sehr gut!", of = "Very good!" }, under [ACT]'
_SHOWN = 60
"""Maximum characters of a text in a sentence."""
_LISTED = 8
"""Maximum number of texts of an act that a sentence names."""
_MAX_ACTS = 5
"""Maximum number of incompletely translated acts that are reported singly, unless the language was requested."""


class Translation(Struct, frozen=True):
    """The translation of one text."""

    template: Template
    of: str
    """The text from which it was translated."""
    location: SourceLocation
    """The place of its key."""
    text_location: SourceLocation
    """The place of the translated text."""


class LanguageTexts(Struct, frozen=True):
    """All translations into one language."""

    language: str
    """As in the file's name."""
    file: str
    texts: dict[str, Translation] = field(default_factory=dict)
    """By the id of the text, `ACT/ID/VARIANT`, including texts that have changed or no longer exist."""
    keys: dict[tuple[str, str], SourceLocation] = field(default_factory=dict)
    """The place of each translation, by act and key of the text, including invalid ones."""
    acts: dict[str, SourceLocation] = field(default_factory=dict)
    """The place at which the translations of an act begin."""

    def stale(self, texts: Iterable[SpokenText]) -> list[SpokenText]:
        """The texts that have changed after their translation."""
        found = ((text, self.texts.get(text.id)) for text in texts)
        return [text for text, given in found if given is not None and given.of != text.text]

    def missing(self, texts: Iterable[SpokenText]) -> list[SpokenText]:
        """The texts without a necessary translation."""
        return [text for text in texts if text.is_needed and text.id not in self.texts]


def language_file(language: str) -> str:
    """The file with the translations into a language, relative to the scenario's folder."""
    return f"{TEXTS_FOLDER}/{language}.toml"


def translated_languages(files: FileReader, wanted: Iterable[str]) -> tuple[str, ...]:
    """The valid languages into which a study is translated.

    :param wanted: the languages in `[languages]`. Each file in the folder `texts` adds one.
    """
    tags: list[str] = []
    with suppress(OSError):  # `TranslationReader` reports it
        tags = [Path(name).stem for name in _text_files(files)]
    by_tag = {tag.lower(): tag for tag in (*wanted, *tags) if not language_problem(tag)}
    return tuple(sorted(by_tag.values()))


def _text_files(files: FileReader) -> list[str]:
    """:raises OSError: the folder cannot be read."""
    try:
        names = files.tree.names(files.folder / TEXTS_FOLDER)
        return [name for name in names if name.endswith(".toml") and name[0] != "."]
    except (FileNotFoundError, NotADirectoryError):
        return []


class TranslationReader:
    """Reads all translations of a scenario, and compares them with the texts of its acts."""

    def __init__(
        self, robot: RobotProfile, draft: ScenarioDraft, language: str, asked: str, diagnostics: Diagnostics
    ) -> None:
        """
        :param draft: the scenario, whose acts have been read.
        :param language: the language of the acts; empty: unknown.
        :param asked: the requested language of a session; empty: that of the acts.
        """
        self.robot = robot
        self.draft = draft
        self.language = language
        self.asked = asked
        self.diagnostics = diagnostics
        self.is_whole = "acts" not in draft.unreadable_parts
        self.all_texts = tuple(spoken_texts(draft.acts.values(), robot, language))
        self.table_texts: tuple[TableText, ...] = ()
        """The texts in the tables; empty: nothing is translated."""
        self.texts: dict[str, SpokenText] = {}
        self.found: dict[str, LanguageTexts] = {}
        """By language, in the order of their names."""
        self.unread: set[str] = set()
        """The languages with an unreadable file, whose missing texts are unknown."""

    def read(self, files: FileReader, wanted: Iterable[str]) -> None:
        """Read the files of the folder `texts`.

        :param wanted: the languages in `[languages]`, which may have no file yet.
        """
        folder = files.folder / TEXTS_FOLDER
        by_tag: dict[str, Path] = {}
        for path in self._files(files, folder):
            if (before := by_tag.setdefault(path.stem.lower(), path)) != path:
                message = f"{before.name} is for the same language; put all translations into one of the files"
                self.diagnostics.error("duplicate-name", SourceLocation(files.display_name(path)), message)
        for tag in wanted:
            by_tag.setdefault(tag.lower(), folder / f"{tag}.toml")
        if not by_tag:
            return
        self._index_texts()
        self.table_texts = tuple(table_texts(self.draft.tables, self.all_texts))
        if not self.language and "settings" not in self.draft.unreadable_parts:
            message = "the study has translations, but the language of its acts is not known: write it at the top of "
            message += 'scenario.toml: language = "en"'
            first = min(by_tag.values(), key=lambda path: path.name)
            self.diagnostics.warning("no-language", SourceLocation(files.display_name(first)), message)
        for tag, path in sorted(by_tag.items()):
            name = files.display_name(path)
            if problem := language_problem(path.stem):
                message = f"a file of translations is named after its language, such as de.toml: {problem}"
                self.diagnostics.error("unknown-language", SourceLocation(name), message)
            elif self.language and tag == self.language.lower():
                message = f"the acts are in `{self.language}` themselves: change their texts there, not here"
                self.diagnostics.error("wrong-value", SourceLocation(name), message)
            else:
                self._read_language(path, files)

    def _files(self, files: FileReader, folder: Path) -> list[Path]:
        try:
            return [folder / name for name in _text_files(files)]
        except OSError as error:
            message = f"this folder cannot be read: {error.strerror or error}"
            self.diagnostics.error("unreadable", SourceLocation(TEXTS_FOLDER), message)
            return []

    def _index_texts(self) -> None:
        for text in self.all_texts:
            if text.id in self.texts:
                message = f"this text and another one of the act are both called `{text.id}` in translations; give one "
                message += "of the actions another actionID"
                self.diagnostics.error("duplicate-id", text.action.location, message)
            self.texts.setdefault(text.id, text)

    def _read_language(self, path: Path, files: FileReader) -> None:
        name = files.display_name(path)
        source = files.read(path, MAX_TEXTS_BYTES) if files.tree.exists(path) else None
        file = toml_of(source, files) if source is not None else None
        found = LanguageTexts(path.stem, name)
        if file is not None:
            key = ("texts", source, path.stem)
            found = files.memo.read(key, self.diagnostics, partial(_read_texts, file, path.stem))
        elif files.tree.exists(path):
            self.unread.add(path.stem)
        self.found[path.stem] = found
        if self.is_whole:
            self._compare(found)

    def _compare(self, found: LanguageTexts) -> None:
        """Report translations that do not fit their texts."""
        acts = self.draft.acts
        for act, location in found.acts.items():
            if act not in acts:
                near = suggest(act, acts, limit=0, otherwise="; if it is gone, delete its translations")
                self.diagnostics.error("unknown-text", location, f"there is no act `{act}`", near)
        for (act, key), location in found.keys.items():
            text, translation = self.texts.get(f"{act}/{key}"), found.texts.get(f"{act}/{key}")
            if act in acts and text is None:
                known = [each.key for each in self.texts.values() if each.act == act]
                otherwise = "; if it is gone, delete its translation"
                near = suggest(key, known, limit=_LISTED, otherwise=otherwise)
                self.diagnostics.error("unknown-text", location, f"the act `{act}` has no text `{key}`", near)
            elif text is not None and translation is not None:
                self._compare_text(text, translation, is_asked=found.language == self.asked)

    def _compare_text(self, text: SpokenText, given: Translation, *, is_asked: bool) -> None:
        problem, is_stale = slot_problem(text.template, given.template), given.of != text.text
        if is_stale:
            message = f"the text has changed since: it is “{shorten(text.text, _SHOWN)}” now, and this translates "
            message += f"“{shorten(given.of, _SHOWN)}”; translate it again, or write the present text into `of`"
            self.diagnostics.warning("stale-translation", given.location, message)
        if problem and (not is_stale or is_asked):
            self.diagnostics.error("slot-differs", given.text_location, problem)

    def report_missing(self, *, allow: bool) -> None:
        """Report each act that is not completely translated.

        :param allow: whether untranslated texts may be spoken in the language of the acts.
        """
        if not self.is_whole:
            return
        for tag, found in self.found.items():
            report = self.diagnostics.error if tag == self.asked and not allow else self.diagnostics.warning
            for location, message in missing_sentences(self.table_texts, tag):
                report("untranslated", location, message)
            if tag in self.unread:
                continue
            by_act: dict[str, list[SpokenText]] = {}
            for text in found.missing(self.texts.values()):
                by_act.setdefault(text.act, []).append(text)
            if len(by_act) > _MAX_ACTS and (tag != self.asked or allow):
                count = sum(map(len, by_act.values()))
                message = f"{count} of {len(self.texts)} texts are not translated into `{tag}`, in {len(by_act)} acts; "
                message += "`rise-engine texts export DIR --only missing` makes a table of them"
                self.diagnostics.warning("untranslated", SourceLocation(found.file), message)
                continue
            for act, texts in by_act.items():
                report("untranslated", self.draft.acts[act].location, _missing_text(act, texts, tag))

    def translated(self, language: str) -> dict[str, Act]:
        """The acts in a language: their own, or that of translations."""
        found = self.found.get(language) or LanguageTexts(language, "")
        is_own = language not in self.found
        return {
            name: replace(act, actions=tuple(self._translate(act, action, found, is_own) for action in act.actions))
            for name, act in self.draft.acts.items()
        }

    def _translate(self, act: Act, action: Action, found: LanguageTexts, is_own: bool) -> Action:
        by_variant: dict[int, list[SpokenText]] = {}
        for text in spoken_texts([Act(act.name, (action,))], self.robot, self.language):
            by_variant.setdefault(text.variant, []).append(text)
        calls = tuple(
            self._translate_call(call, by_variant.get(variant, []), found, is_own)
            for variant, call in enumerate(action.calls)
        )
        return replace(action, calls=calls)

    def _translate_call(
        self, call: ActionCall, texts: list[SpokenText], found: LanguageTexts, is_own: bool
    ) -> ActionCall:
        """Translate one action, and set its language unless its author gives it another one."""
        if not texts:
            return call
        parameters: dict[str, Template] = dict(call.parameters)
        given = {text.parameter: found.texts[text.id].template for text in texts if text.id in found.texts}
        parameters.update(given)
        spec = self.robot.actions[call.type]
        language = found.language if is_own or given or not any(text.is_needed for text in texts) else self.language
        if language and LANGUAGE in spec.parameters:
            own = own_language(call, spec)
            is_ours = own is not None and self.language != "" and language_fits(self.language, own)
            if LANGUAGE not in call.parameters or (is_ours and given):
                parameters[LANGUAGE] = parse_template(language)
        return ActionCall(call.type, parameters)


def _read_texts(file: TomlFile, language: str, diagnostics: Diagnostics) -> LanguageTexts:
    """Read all translations of a file."""
    top = TomlTable(file, (), file.values, diagnostics)
    found = LanguageTexts(language, file.source.name)
    for act in top.values:
        table = top.subtable(act, f"translations belong under their act: {_FORM}")
        if table is None:
            continue
        found.acts[act] = table.key_location()
        for key in table.values:
            found.keys[act, key] = table.key_location(key)
            translation = _read_text(table, key)
            if translation is not None:
                found.texts[f"{act}/{key}"] = translation
    return found


def _read_text(act: TomlTable, key: str) -> Translation | None:
    values = act.values[key]
    if not isinstance(values, dict):
        act.report_value("wrong-type", key, f"a translation names the text that it translates; write {_FORM}")
        return None
    table = TomlTable(act.file, (*act.path, key), values, act.diagnostics)
    table.report_unknown_keys(("text", "of"))
    text, of = (" ".join((_read_entry(table, name) or "").split()) for name in ("text", "of"))
    if not text or not of:
        return None
    location = table.value_location("text")
    try:
        template = parse_template(text)
    except TemplateError as error:
        act.diagnostics.error("template", location, str(error))
        return None
    for problem in find_ssml_problems(template):
        report = act.diagnostics.error if problem.is_error else act.diagnostics.warning
        report("ssml", location, problem.text)
    return Translation(template, of, table.key_location(), location)


def _read_entry(table: TomlTable, key: str) -> str | None:
    form = f"; write {_FORM}"
    value: str | None = table.read(key, str, None, form=form)
    if key not in table.values or (isinstance(value, str) and not value.strip()):
        what = "what is said" if key == "text" else "the text that it was translated from"
        table.report_key("missing-value", f"`{key}`, {what}, is missing{form}")
        return None
    return value


def slot_problem(original: Template, translation: Template) -> str:
    """Return the error of the memory values in a translation, as a sentence; empty: they match the text."""
    keys, others = ({slot.key for slot in each.slots} for each in (original, translation))
    if missing := sorted(keys - others):
        return f"the translation leaves out {', '.join(f'{{{key}}}' for key in missing)}, which the text has"
    if added := sorted(others - keys):
        near = suggest(added[0], sorted(keys), limit=0).words if keys else ""
        return f"the translation has {', '.join(f'{{{key}}}' for key in added)}, which the text does not have{near}"
    optional = {slot.key for slot in original.slots if slot.fallback is not None}
    needed = sorted({slot.key for slot in translation.slots if slot.fallback is None} & optional)
    certain = {slot.key for slot in original.slots if slot.fallback is None}
    if needed := [key for key in needed if key not in certain]:
        return (
            f"{{{needed[0]}}} has a fallback in the text, for when the memory has no value, and none in the translation"
        )
    return ""


def _missing_text(act: str, texts: list[SpokenText], language: str) -> str:
    """Report that these texts of an act are not translated."""
    if len(texts) == 1:
        return (
            f"a text of `{act}` is not translated into `{language}`: {texts[0].key}, “{shorten(texts[0].text, _SHOWN)}”"
        )
    listed = ", ".join(text.key for text in texts[:_LISTED]) + (", ..." if len(texts) > _LISTED else "")
    return f"{len(texts)} texts of `{act}` are not translated into `{language}`: {listed}"
