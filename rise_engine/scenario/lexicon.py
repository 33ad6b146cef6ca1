"""Reading lexicon.toml: how a robot says a word (docs/reference/scenario.md, "lexicon.toml"; semantics.md 2.5)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from unicodedata import normalize

from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.languages import language_fits, language_problem
from rise_engine.scenario.model import LexiconTable
from rise_engine.scenario.toml_files import TomlFile
from rise_engine.scenario.toml_tables import TomlTable

MAX_WORDS = 2_000
"""Entries of a file: each of them is looked for in each sentence."""
MAX_LENGTH = 200
"""Characters of an entry, and of what is said for it."""
_FORM = '"WORD" = "how it is said", under its language: [en]'


def normal_word(written: str) -> str:
    """An entry as it is compared: in Unicode's normal form C, with one blank between its words."""
    return normalize("NFC", " ".join(written.split()))


def read_lexicon(
    file: TomlFile, language: str, robots: Collection[str], draft: ScenarioDraft, diagnostics: Diagnostics
) -> tuple[LexiconTable, ...]:
    """The tables of the file. On errors, what could be understood.

    :param language: what scenario.toml says; empty: nothing.
    :param robots: the names of the robots that there are.
    :param draft: the scenario, whose acts have been read.
    """
    reader = _LexiconReader(file, robots, diagnostics)
    reader.read()
    reader.report_unused_languages(language, draft)
    return tuple(reader.tables)


class _LexiconReader:
    def __init__(self, file: TomlFile, robots: Collection[str], diagnostics: Diagnostics) -> None:
        self.robots = robots
        self.diagnostics = diagnostics
        self.top = TomlTable(file, (), file.values, diagnostics)
        self.tables: list[LexiconTable] = []
        self.languages: dict[str, str] = {}
        """As they are written, by what they are in small letters."""
        self.count = 0

    def read(self) -> None:
        for language, values in self.top.values.items():
            if not isinstance(values, dict):
                self.top.report_key("wrong-type", f"a word stands under its language; write {_FORM}", language)
                continue
            if problem := language_problem(language):
                self.top.report_key("unknown-language", problem, language)
                continue
            if (before := self.languages.setdefault(language.lower(), language)) != language:
                message = f"`{language}` and `{before}` are one language; write their words under one of them"
                self.top.report_key("duplicate-key", message, language)
                continue
            self.read_language(TomlTable(self.top.file, (language,), values, self.diagnostics))
        if self.count > MAX_WORDS:
            message = f"this file has {self.count} words; there is room for {MAX_WORDS}"
            self.diagnostics.error("too-large", self.top.file.source.location(0), message)

    def read_language(self, table: TomlTable) -> None:
        words = {word: said for word, said in table.values.items() if not isinstance(said, dict)}
        self.tables.append(LexiconTable(table.name, "", self.read_words(table, words)))
        for robot in (name for name in table.values if name not in words):
            inner = TomlTable(table.file, (table.name, robot), table.values[robot], self.diagnostics)
            if robot not in self.robots:
                near = suggest(robot, sorted(self.robots))
                if not near.meant:
                    near = replace(near, words=f"{near.words}; a word with a point in it stands in quotation marks")
                message = f"there is no robot `{robot}`, so this is said by none"
                self.diagnostics.warning("no-effect", inner.key_location(), message, near)
            self.tables.append(LexiconTable(table.name, robot, self.read_words(inner, inner.values)))

    def read_words(self, table: TomlTable, values: dict[str, Any]) -> dict[str, str]:
        words: dict[str, str] = {}
        first: dict[str, str] = {}
        for written, said in values.items():
            self.count += 1
            word = normal_word(written)
            if isinstance(said, dict):
                table.report_key("wrong-type", f"a table cannot stand here; write {_FORM}", written)
            elif not isinstance(said, str):
                table.report_value("wrong-type", written, f"how a word is said is a text; write {_FORM}")
            elif not word or not said.strip():
                message = f"a word, and how it is said, cannot be empty; write {_FORM}"
                table.report_value("missing-value", written, message)
            elif len(word) > MAX_LENGTH or len(said) > MAX_LENGTH:
                message = f"a word, and how it is said, have at most {MAX_LENGTH} characters"
                table.report_value("out-of-range", written, message)
            elif word in words:
                line = table.key_location(first[word]).line
                message = f"`{word}` stands in line {line} already: blanks and the way of writing accents do not count"
                table.report_key("duplicate-key", message, written)
            else:
                words[word] = said.strip()
                first[word] = written
                if words[word] == word:
                    message = f"`{word}` is said as it is written without this line too"
                    self.diagnostics.warning("no-effect", table.key_location(written), message)
        return words

    def report_unused_languages(self, language: str, draft: ScenarioDraft) -> None:
        """Warn when nothing is said in any of the languages, as far as that can be known. A file that several studies
        share may have others besides."""
        if draft.has_languages_from_memory or "acts" in draft.unreadable_parts:
            return
        spoken = {language, *draft.spoken_languages} - {""}
        if any(language_fits(written, each) for written in self.languages.values() for each in spoken):
            return
        for written in self.languages.values():
            known = f"; it is in {', '.join(sorted(spoken))}" if spoken else ""
            hint = "" if language else f'. Which language the acts are in says scenario.toml: language = "{written}"'
            message = f"nothing in this study is said in `{written}`{known}{hint}"
            self.diagnostics.warning("no-effect", self.top.key_location(written), message)
