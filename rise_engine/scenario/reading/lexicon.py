"""The pronunciation of words: lexicon.toml, and the text for the robot (semantics.md 2.5, 2.6).

The engine applies it before it sends a goal, so all drivers get the same text. Consoles use it to show the words.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any, NamedTuple
from unicodedata import normalize

import regex
from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable
from rise_engine.scenario.model import ActionSpec, LexiconTable, Scenario
from rise_engine.scenario.parameters import LANGUAGE, MESSAGE, says_message
from rise_engine.scenario.speech.languages import language_fits, language_problem
from rise_engine.scenario.speech.ssml import begins_as_ssml, change_words, literal_ssml, plain_words

MAX_WORDS = 2_000
"""Maximum number of entries of a file, because each sentence is searched for each of them."""
MAX_LENGTH = 200
"""Maximum characters of an entry and of a pronunciation."""
_FORM = '"WORD" = "how it is said", under its language: [en]'


def normal_word(written: str) -> str:
    """A normalized entry: in Unicode's normal form C, with one blank between its words."""
    return normalize("NFC", " ".join(written.split()))


def read_lexicon(
    file: TomlFile, language: str, robots: Collection[str], draft: ScenarioDraft, diagnostics: Diagnostics
) -> tuple[LexiconTable, ...]:
    """Read the tables of the file; with errors, the valid part.

    :param language: the scenario's language; empty: not set.
    :param robots: the names of all robots.
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
        """Languages as written, by their tag in lower case."""
        self.count = 0

    def read(self) -> None:
        for language, values in self.top.values.items():
            if not isinstance(values, dict):
                self.top.report_key("wrong-type", f"a word belongs under its language; write {_FORM}", language)
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
        words = {word: spoken for word, spoken in table.values.items() if not isinstance(spoken, dict)}
        self.tables.append(LexiconTable(table.name, "", self.read_words(table, words)))
        for robot in (name for name in table.values if name not in words):
            inner = TomlTable(table.file, (table.name, robot), table.values[robot], self.diagnostics)
            if robot not in self.robots:
                near = suggest(robot, sorted(self.robots))
                if not near.meant:
                    near = replace(near, words=f"{near.words}; a word with a point in it needs quotation marks")
                message = f"there is no robot `{robot}`, so no robot says this"
                self.diagnostics.warning("no-effect", inner.key_location(), message, near)
            self.tables.append(LexiconTable(table.name, robot, self.read_words(inner, inner.values)))

    def read_words(self, table: TomlTable, values: dict[str, Any]) -> dict[str, str]:
        words: dict[str, str] = {}
        first: dict[str, str] = {}
        for written, spoken in values.items():
            self.count += 1
            word = normal_word(written)
            if isinstance(spoken, dict):
                table.report_key("wrong-type", f"a table is not allowed here; write {_FORM}", written)
            elif not isinstance(spoken, str):
                table.report_value("wrong-type", written, f"how a word is said is a text; write {_FORM}")
            elif not word or not spoken.strip():
                message = f"a word, and how it is said, cannot be empty; write {_FORM}"
                table.report_value("missing-value", written, message)
            elif len(word) > MAX_LENGTH or len(spoken) > MAX_LENGTH:
                message = f"a word, and how it is said, have at most {MAX_LENGTH} characters"
                table.report_value("out-of-range", written, message)
            elif word in words:
                line = table.key_location(first[word]).line
                message = f"`{word}` is already in line {line}: blanks and the way of writing accents do not count"
                table.report_key("duplicate-key", message, written)
            else:
                words[word] = spoken.strip()
                first[word] = written
                if words[word] == word:
                    message = f"`{word}` is said as it is written anyway; delete this line"
                    self.diagnostics.warning("no-effect", table.key_location(written), message)
        return words

    def report_unused_languages(self, language: str, draft: ScenarioDraft) -> None:
        """Warn if no text is known to be in any of the languages. (A shared file may have further languages.)"""
        if draft.has_languages_from_memory or "acts" in draft.unreadable_parts:
            return
        spoken = {language, *draft.spoken_languages} - {""}
        if any(language_fits(written, each) for written in self.languages.values() for each in spoken):
            return
        for written in self.languages.values():
            known = f"; it is in {', '.join(sorted(spoken))}" if spoken else ""
            hint = "" if language else f'. scenario.toml sets the language of the acts: language = "{written}"'
            message = f"nothing in this study is said in `{written}`{known}{hint}"
            self.diagnostics.warning("no-effect", self.top.key_location(written), message)


# --- the words for the robot ------------------------------------------------------------------------------------------


_PART_OF_WORD = regex.compile(r"[\w--[\p{Han}\p{Hiragana}\p{Katakana}\p{Thai}\p{Lao}\p{Khmer}\p{Myanmar}]]", regex.V1)
"""A letter, digit, mark or underscore, except of scripts without blanks between words."""
_GAP = re.compile(r"\s+")


class _Entry(NamedTuple):
    word: str
    pronunciation: str
    any_case: bool
    """Whether it is in lower case, and therefore also matches capitals."""
    open_before: bool
    """Whether its first character does not belong to a word, so that anything may precede it."""
    open_behind: bool


class Pronunciation:
    """Replaces words in texts of one language for one robot."""

    def __init__(self, words: dict[str, str]) -> None:
        """`words`: pronunciations by word (`LexiconTable.words`)."""
        self._entries: dict[str, list[_Entry]] = {}
        """By their first character in lower case: the longest first; of equal ones, the one with a capital first."""
        for word in sorted(words, key=lambda word: (-len(word), word == word.lower(), word)):
            ends = (_PART_OF_WORD.match(word[at]) is None for at in (0, -1))
            self._entries.setdefault(word[0].lower(), []).append(_Entry(word, words[word], word == word.lower(), *ends))

    def apply(self, text: str) -> str:
        """Replace the words of a text from left to right. Replacements are not searched again.

        The result is in Unicode's normal form C and has single blanks; a text without any of the words is unchanged.

        >>> pronunciation = Pronunciation({"Rise": "rize", "rise up": "get up", "e.g.": "for example"})
        >>> pronunciation.apply("Rise, e.g. Rise's authors, enterprise: Rise up, and rise  up.")
        "rize, for example rize's authors, enterprise: get up, and get up."
        """
        found = _GAP.sub(" ", normalize("NFC", text)) if self._entries else ""
        pieces: list[str] = []
        start = at = 0
        while at < len(found):
            entry = self._entry_at(found, at)
            if entry is None:
                at += 1
            else:
                pieces += (found[start:at], entry.pronunciation)
                start = at = at + len(entry.word)
        return "".join((*pieces, found[start:])) if pieces else text

    def _entry_at(self, text: str, at: int) -> _Entry | None:
        """The longest entry that matches as a whole word at an offset."""
        for entry in self._entries.get(text[at].lower(), ()):
            end = at + len(entry.word)
            written = text[at:end]
            if written != entry.word and not (entry.any_case and written.lower() == entry.word):
                continue
            before = entry.open_before or at == 0 or _PART_OF_WORD.match(text[at - 1]) is None
            if before and (entry.open_behind or end == len(text) or _PART_OF_WORD.match(text[end]) is None):
                return entry
        return None


def words_for(lexicon: tuple[LexiconTable, ...], language: str, robot: str) -> dict[str, str]:
    """The words for a language and a robot. The robot's own override those for all; then the more exact language."""
    tables = [table for table in lexicon if table.robot in ("", robot) and language_fits(table.language, language)]
    words: dict[str, str] = {}
    for table in sorted(tables, key=lambda table: (table.robot != "", len(table.language))):
        words.update(table.words)
    return words


class RobotWording:
    """Converts messages to the words for the scenario's robot."""

    def __init__(self, scenario: Scenario) -> None:
        self._robot = scenario.robot
        self._lexicon = scenario.lexicon
        self._language = scenario.language
        self._pronunciations: dict[str, Pronunciation] = {}
        """By language, built on demand."""

    def parameters_for_robot(self, action: str, parameters: dict[str, Any]) -> dict[str, Any]:
        """Replace the message in an action's parameters by the words for this robot.

        :param action: the action that the robot performs, which may be the substitute.
        :param parameters: the recorded parameters, with the memory filled in.
        :return: the same object if nothing changes.
        """
        spec = self._robot.actions.get(action)
        message = parameters.get(MESSAGE)
        if spec is None or not isinstance(message, str):
            return parameters
        language = parameters.get(LANGUAGE)
        pronounced = self._word(spec, message, language if isinstance(language, str) and language else self._language)
        return parameters if pronounced == message else {**parameters, MESSAGE: pronounced}

    def _word(self, spec: ActionSpec, message: str, language: str) -> str:
        def pronounce(text: str, own_language: str = "") -> str:
            return self._pronounce(text, own_language or language) if says_message(spec) else text

        if not spec.ssml:
            return pronounce(plain_words(message))
        changed = change_words(message, pronounce)
        if changed is not None:
            return changed
        text = pronounce(message)
        return literal_ssml(text) if begins_as_ssml(text) else text  # the robot must not take plain text for markup

    def _pronounce(self, text: str, language: str) -> str:
        if not self._lexicon:
            return text
        pronunciation = self._pronunciations.get(language)
        if pronunciation is None:
            pronunciation = Pronunciation(words_for(self._lexicon, language, self._robot.name))
            self._pronunciations[language] = pronunciation
        return pronunciation.apply(text)
