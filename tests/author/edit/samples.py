"""The shipped studies, each written in the ways in which files come: for all tests of edits.

`study_files("greeting", "crlf")` are a study's files, `study_state(...)` what an edit is planned on, and `after(...)`
what has come of edits.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from random import Random

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import Files, apply_plan
from rise_engine.author.edit.planning import StudyState, plan
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.syntax.xml import XmlTree
from tests.author.edit.guard import check_guard

SCENARIOS = Path(__file__).parents[3] / "scenarios"
NAMES = ("greeting", "lablinking", "lab_opening", "negation")

_MESSAGE = re.compile(r"<message>([^<&]*)</message>")
_ELEMENT_AT_LINE_END = re.compile(r"(/>|</\w+>)$", re.MULTILINE)
_FIRST_IN_STATE = re.compile(r"(<State [^>]*[^/]>)$", re.MULTILINE)


def _crlf(_file: str, text: str) -> str:
    return text.replace("\n", "\r\n")


def _cr(file: str, text: str) -> str:
    return text if file.endswith((".toml", ".csv", ".jsonl")) else text.replace("\n", "\r")


def _bom_tabs(file: str, text: str) -> str:
    if not file.endswith(".xml"):
        return "\ufeff" + text if file.endswith(".toml") else text
    indented = re.sub(r"^ +", lambda found: "\t" * (len(found[0]) // 2) + " " * (len(found[0]) % 2), text, flags=re.M)
    return "\ufeff" + indented


def _comments(file: str, text: str) -> str:
    """A comment behind elements, in states, and before everything, with tags in it."""
    if not file.endswith(".xml"):
        return text
    numbers = iter(range(1, 100_000))
    text = _ELEMENT_AT_LINE_END.sub(lambda found: f"{found[1]} <!-- {next(numbers)}: <State id='no'/> ä -->", text)
    return _FIRST_IN_STATE.sub(lambda found: f"{found[1]}\n    <!-- first\n    of all -->", text)


def _cdata(file: str, text: str) -> str:
    return _MESSAGE.sub(r"<message><![CDATA[\1]]></message>", text) if file.endswith(".xml") else text


def _nfd(file: str, text: str) -> str:
    said = unicodedata.normalize("NFD", "Grün, naïve: ") + "😀 "
    return _MESSAGE.sub(rf"<message>{said}\1</message>", text) if file.endswith(".xml") else text


def _quotes(file: str, text: str) -> str:
    """Single quotation marks, where the value allows it, and blanks that nobody needs."""
    if not file.endswith(".xml"):
        return text
    return re.sub(r'([\w:]+)="([^"\'<>&]*)"', r"\1 = '\2'", text).replace("'/>", "' />")


def _one_line(file: str, text: str) -> str:
    if not file.endswith(".xml"):
        return text
    return re.sub(r"\s*\n\s*", " ", re.sub(r">\s*\n\s*<", "><", text.strip()))


def _ragged(file: str, text: str) -> str:
    """Something else between any two elements: nothing, blanks, line ends of all kinds, comments."""
    if not file.endswith(".xml"):
        return text
    random = Random(file)
    gaps: list[tuple[int, int]] = []
    for element in XmlTree(text).root.walk():
        if element and element.tag not in ("message", "speak"):
            gaps += element.gaps()
    for start, end in sorted(gaps, reverse=True):
        if not text[start:end].strip():
            text = text[:start] + random.choice(_GAPS) + text[end:]
    return text


_GAPS = ("", "", " ", "\n", "\n  ", "\n\t", "\r\n    ", "\n\n  ", " <!-- a -->\n  ", "\n  <!-- b\n -->\n  ", "<!---->")


SPELLINGS: dict[str, Callable[[str, str], str]] = {
    "lf": lambda _file, text: text,
    "crlf": _crlf,
    "cr": _cr,
    "bom_tabs": _bom_tabs,
    "comments": _comments,
    "cdata": _cdata,
    "nfd": _nfd,
    "quotes": _quotes,
    "one_line": _one_line,
    "ragged": _ragged,
}


@lru_cache(maxsize=64)
def study_files(name: str, spelling: str = "lf") -> Files:
    """The files of a shipped study in one of SPELLINGS. They mean the same in all of them but "nfd"."""
    folder = SCENARIOS / name
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
    write = SPELLINGS[spelling]
    return {file: write(file, data.decode()).encode() for file, data in files.items()}


@lru_cache(maxsize=8)
def _checker(folder: Path) -> ScenarioChecker:
    return ScenarioChecker(folder)


def state_of(files: Files, name: str) -> StudyState:
    """What an edit is planned on, for files that began as those of a shipped study."""
    folder = SCENARIOS / name
    gone = {file: None for file in study_files(name) if file not in files}
    checked = _checker(folder).check({**files, **gone})
    return StudyState(files, checked, folder)


@lru_cache(maxsize=64)
def study_state(name: str, spelling: str = "lf") -> StudyState:
    """A shipped study in one of SPELLINGS."""
    return state_of(study_files(name, spelling), name)


def after(study: StudyState, *edits: AnyEdit) -> StudyState:
    """The study after these edits, one by one; the guard has looked at each."""
    for edit in edits:
        following = state_of(apply_plan(study.files, plan(edit, study)), study.folder.name)
        check_guard([edit], study, following)
        study = following
    return study


def changed_lines(before: Files, after: Files) -> tuple[int, int]:
    """How many lines `git diff --numstat` would say were added and removed. Lines end with LF, CRLF or CR."""
    added = removed = 0
    for file in {*before, *after}:
        old, new = (_lines(files.get(file, b"")) for files in (before, after))
        if old != new:
            more, less = _numstat(old, new)
            added, removed = added + more, removed + less
    return added, removed


def _lines(data: bytes) -> list[bytes]:
    return re.findall(rb"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+", data)


def _numstat(old: list[bytes], new: list[bytes]) -> tuple[int, int]:
    """By the longest common subsequence, within what differs."""
    head = _common(zip(old, new, strict=False))
    old, new = old[head:], new[head:]
    tail = _common(zip(old[::-1], new[::-1], strict=False))
    old, new = old[: len(old) - tail], new[: len(new) - tail]
    lengths = [0] * (len(new) + 1)
    for line in old:
        before = 0
        for index, other in enumerate(new):
            at = lengths[index + 1]
            lengths[index + 1] = before + 1 if line == other else max(lengths[index], at)
            before = at
    return len(new) - lengths[-1], len(old) - lengths[-1]


def _common(pairs: Iterable[tuple[bytes, bytes]]) -> int:
    number = 0
    for one, other in pairs:
        if one != other:
            break
        number += 1
    return number
