"""What a robot is given to say: the text of the record, with its words as the lexicon says them (semantics.md 2.5), and
without markup when the robot takes none (2.6).

The engine asks for it before it gives a goal to a driver, whichever it is, so that each is given the same, the
simulated one too; a console asks for it to show it.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple
from unicodedata import normalize

import regex

from rise_engine.scenario.languages import language_fits
from rise_engine.scenario.model import ActionSpec, LexiconTable, Scenario
from rise_engine.scenario.spoken import LANGUAGE, MESSAGE, says_message
from rise_engine.scenario.ssml import begins_as_ssml, change_words, literal_ssml, plain_words

_PART_OF_WORD = regex.compile(r"[\w--[\p{Han}\p{Hiragana}\p{Katakana}\p{Thai}\p{Lao}\p{Khmer}\p{Myanmar}]]", regex.V1)
"""A letter, digit, mark or underscore, but of no script that leaves no blanks between words."""
_GAP = re.compile(r"\s+")


class _Entry(NamedTuple):
    word: str
    said: str
    any_case: bool
    """It is written in small letters, and stands for its word with capitals too."""
    open_before: bool
    """It does not begin like a word: anything may stand before it."""
    open_behind: bool


class Pronunciation:
    """Replaces words in texts of one language for one robot."""

    def __init__(self, words: dict[str, str]) -> None:
        """`words`: what is said, by word (`LexiconTable.words`)."""
        self._entries: dict[str, list[_Entry]] = {}
        """By their first character in small letters: the longest first; of equal ones, that with a capital."""
        for word in sorted(words, key=lambda word: (-len(word), word == word.lower(), word)):
            ends = (_PART_OF_WORD.match(word[at]) is None for at in (0, -1))
            self._entries.setdefault(word[0].lower(), []).append(_Entry(word, words[word], word == word.lower(), *ends))

    def apply(self, text: str) -> str:
        """The text with its words replaced, from its beginning on, in Unicode's normal form C and with single blanks;
        the same text when none of the words stands in it. What was put in is not looked at again.

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
                pieces += (found[start:at], entry.said)
                start = at = at + len(entry.word)
        return "".join((*pieces, found[start:])) if pieces else text

    def _entry_at(self, text: str, at: int) -> _Entry | None:
        """The longest entry that stands there as a whole word."""
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
    """The words that hold for a text in a language and a robot. What is said of the robot alone goes before what is
    said of all, and then the more exact language before the other."""
    tables = [table for table in lexicon if table.robot in ("", robot) and language_fits(table.language, language)]
    words: dict[str, str] = {}
    for table in sorted(tables, key=lambda table: (table.robot != "", len(table.language))):
        words.update(table.words)
    return words


class RobotWording:
    """Knows in which words the scenario's robot is given what it says."""

    def __init__(self, scenario: Scenario) -> None:
        self._robot = scenario.robot
        self._lexicon = scenario.lexicon
        self._language = scenario.language
        self._pronunciations: dict[str, Pronunciation] = {}
        """By language; made when something is said in it."""

    def parameters_for_robot(self, action: str, parameters: dict[str, Any]) -> dict[str, Any]:
        """An action's parameters with the message as this robot is to get it.

        :param action: which action the robot does, the substitute where it does one.
        :param parameters: as they are recorded, with the memory filled in.
        :return: the same object where nothing changes.
        """
        spec = self._robot.actions.get(action)
        message = parameters.get(MESSAGE)
        if spec is None or not isinstance(message, str):
            return parameters
        language = parameters.get(LANGUAGE)
        said = self._word(spec, message, language if isinstance(language, str) and language else self._language)
        return parameters if said == message else {**parameters, MESSAGE: said}

    def _word(self, spec: ActionSpec, message: str, language: str) -> str:
        def pronounce(text: str, own_language: str = "") -> str:
            return self._pronounce(text, own_language or language) if says_message(spec) else text

        if not spec.ssml:
            return pronounce(plain_words(message))
        changed = change_words(message, pronounce)
        if changed is not None:
            return changed
        text = pronounce(message)
        return literal_ssml(text) if begins_as_ssml(text) else text  # a text, which the robot must not take for markup

    def _pronounce(self, text: str, language: str) -> str:
        if not self._lexicon:
            return text
        pronunciation = self._pronunciations.get(language)
        if pronunciation is None:
            pronunciation = Pronunciation(words_for(self._lexicon, language, self._robot.name))
            self._pronunciations[language] = pronunciation
        return pronunciation.apply(text)
