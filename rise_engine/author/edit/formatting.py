"""The usual layout of a study's files, which `rise-engine fmt` and the language server write.

The layout changes no value and keeps all comments.
"""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

from msgspec import Struct

from rise_engine.author.edit.memory import memory_file
from rise_engine.author.edit.plan import EditedText, EditRefused, Files
from rise_engine.base.json_codec import JsonArray, JsonError, JsonObject, decode, read_json
from rise_engine.base.text import BLANKS
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.reading.element_templates import PATTERNS
from rise_engine.scenario.reading.memory import LIST_KEY
from rise_engine.syntax.changes import TextEdit, changed_text
from rise_engine.syntax.toml import TomlSection
from rise_engine.syntax.toml_edits import TomlText
from rise_engine.syntax.xml import XmlSyntaxError, XmlTree, comments_of
from rise_engine.syntax.xml_writing import format_xml

_WIDTH = 100
"""Maximum columns of a memory value on one line."""
_LINE_ENDS = re.compile(r"\r\n?|\n")


def format_toml(text: str) -> str:
    """Lay out a TOML file: entries at the margin, ` = `, one empty line before a table and between groups.

    The text of values stays, and aligned `=` stay aligned.

    :param text: without byte order mark.
    :raises EditRefused: it is not TOML.
    """
    toml = TomlText(text)
    edits: list[TextEdit] = []
    for section in toml.sections:
        for pair, width in zip(section.pairs, _key_widths(toml, section), strict=True):
            key_end = pair.parts[-1].end
            pad = max(0, width - (key_end - pair.start))
            edits.append(TextEdit(key_end, pair.value.start, " " * pad + " = "))
    text = _without_margins(changed_text(text, edits), toml)
    return _with_gaps(text, toml.newline)


def _key_widths(toml: TomlText, section: TomlSection) -> list[int]:
    """Compute for each entry of a section the width of its key with the blanks after it that stay.

    Blanks stay if the `=` is aligned with that of the previous or next entry.
    """
    lengths = [pair.parts[-1].end - pair.start for pair in section.pairs]
    widths = []
    for pair, length in zip(section.pairs, lengths, strict=True):
        blanks = len(toml.text[pair.parts[-1].end : pair.value.start].partition("=")[0])
        widths.append(length + max(0, blanks - 1))
    kept = []
    for at, (width, length) in enumerate(zip(widths, lengths, strict=True)):
        beside = [*widths[max(0, at - 1) : at], *widths[at + 1 : at + 2]]
        kept.append(width if width in beside else length)
    return kept


def _without_margins(text: str, before: TomlText) -> str:
    """Strip the blanks before entries, headers and comments on their own lines, and the blanks at line ends."""
    toml = TomlText(text)
    kept = [(pair.value.start, pair.value.end) for section in toml.sections for pair in section.pairs]
    lines: list[str] = []
    at = which = 0
    for line in text.splitlines(keepends=True):
        end = at + len(line)
        while which < len(kept) and kept[which][1] <= at:
            which += 1
        begins_inside = which < len(kept) and kept[which][0] < at
        last = which
        while last + 1 < len(kept) and kept[last + 1][0] < end:
            last += 1
        ends_inside = last < len(kept) and kept[last][0] < end and kept[last][1] >= end
        bare = line.rstrip("\r\n")
        if not ends_inside:
            bare = bare.rstrip(" \t")
        if not begins_inside:
            bare = bare.lstrip(" \t")
        lines.append(bare + before.newline if line.endswith(("\n", "\r")) else bare)
        at = end
    return "".join(lines)


def _with_gaps(text: str, newline: str) -> str:
    """Leave at most one empty line in a row, one before each table (and its comment), and none at the ends."""
    toml = TomlText(text)
    values = [(pair.value.start, pair.value.end) for section in toml.sections for pair in section.pairs]
    headers = {toml.text.count("\n", 0, section.start) for section in toml.sections if section.parts}
    frozen: set[int] = set()
    for start, end in values:
        frozen.update(range(text.count("\n", 0, start) + 1, text.count("\n", 0, end) + 1))
    lines = text.split("\n")
    result: list[str] = []
    for number, line in enumerate(lines):
        bare = line.rstrip("\r")
        if number not in frozen and not bare and (not result or not result[-1].rstrip("\r")):
            continue
        if number in headers:
            at = len(result)
            while at and result[at - 1].startswith("#"):
                at -= 1
            if at and result[at - 1].rstrip("\r"):
                result.insert(at, "\r" if newline == "\r\n" else "")
        result.append(line)
    text = "\n".join(result).rstrip("\r\n")
    return text + newline if text else ""


# --- the memory -------------------------------------------------------------------------------------------------------


def format_memory(text: str) -> str:
    """Lay out a memory file in its own form: one entry a line, one empty line between groups.

    The form of numbers and texts stays.

    :raises EditRefused: it is not JSON, or not an object.
    """
    newline = "\r\n" if "\r\n" in text else "\r" if "\r" in text and "\n" not in text else "\n"
    try:
        value = read_json(text, _refuse)
    except JsonError as error:
        line = len(_LINE_ENDS.findall(text[: error.offset])) + 1
        raise EditRefused(f"line {line}: {error}") from None
    if not isinstance(value, JsonObject):
        raise EditRefused("it is not an object of keys and values")
    listed = value.get(LIST_KEY)
    if isinstance(listed, JsonArray) and len(value) == 1:
        entries = [(at, _compact(text, item, at)) for item, at in zip(listed, listed.items_at, strict=True)]
        lines = ["{" + json.dumps(LIST_KEY) + ":", "[", *_entry_lines(text, entries), "]", "}"]
    elif value.members:
        pairs = [
            (member.key_at, f"{_written(text, member.key_at)}: {_value(text, member.value, member.value_at, '  ')}")
            for member in value.members
        ]
        lines = ["{", *_entry_lines(text, pairs), "}"]
    else:
        lines = ["{}"]
    return "\n".join(lines).replace("\n", newline) + newline


def _entry_lines(text: str, entries: list[tuple[int, str]]) -> list[str]:
    lines: list[str] = []
    for number, (at, entry) in enumerate(entries):
        before = text[:at]
        gap = before[len(before.rstrip(" \t\r\n")) :]
        if number and len(_LINE_ENDS.findall(gap)) > 1:
            lines.append("")
        lines.append(f"  {entry}{',' if number + 1 < len(entries) else ''}")
    return lines


def _refuse(key: str, offset: int, first: int) -> None:
    raise EditRefused(f'the key "{key}" is in it twice')


def _written(text: str, at: int) -> str:
    """Return a text or number as in the file."""
    return text[at : json.JSONDecoder().raw_decode(text, at)[1]]


def _compact(text: str, value: Any, at: int) -> str:
    """Write a value on one line."""
    match value:
        case JsonObject():
            inner = (
                f"{_written(text, each.key_at)}: {_compact(text, each.value, each.value_at)}" for each in value.members
            )
            return "{" + ", ".join(inner) + "}"
        case JsonArray():
            return (
                "["
                + ", ".join(_compact(text, each, here) for each, here in zip(value, value.items_at, strict=True))
                + "]"
            )
    return _written(text, at)


def _value(text: str, value: Any, at: int, indent: str) -> str:
    """Write a value on one line if it fits, otherwise one entry a line."""
    compact = _compact(text, value, at)
    if len(compact) <= _WIDTH or not isinstance(value, JsonObject | JsonArray):
        return compact
    inside = indent + "  "
    if isinstance(value, JsonObject):
        parts = [
            f"{_written(text, each.key_at)}: {_value(text, each.value, each.value_at, inside)}"
            for each in value.members
        ]
        opening, closing = "{", "}"
    else:
        parts = [_value(text, each, here, inside) for each, here in zip(value, value.items_at, strict=True)]
        opening, closing = "[", "]"
    return f"{opening}\n{inside}" + f",\n{inside}".join(parts) + f"\n{indent}{closing}"


# --- all files of a study --------------------------------------------------------------------------------------------


_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class StudyLayout(Struct, frozen=True):
    """The result of laying out a study's files."""

    changed: dict[str, bytes]
    """The files that the layout changes."""
    problems: dict[str, str]
    """Files that stay unchanged, each with the reason."""
    files: int
    """How many files it read."""


def lay_out(files: Files) -> StudyLayout:
    """Lay out acts, rules, settings, start values and translations. Other files stay unchanged."""
    changed: dict[str, bytes] = {}
    problems: dict[str, str] = {}
    names = [name for name in sorted(files) if _kind(name, files)]
    for name in names:
        try:
            after = format_file(name, files)
        except EditRefused as error:
            problems[name] = str(error)
        else:
            if after != files[name]:
                changed[name] = after
    return StudyLayout(changed, problems, len(names))


def format_file(name: str, files: Files) -> bytes:
    """Lay out one file, keeping its byte order mark and its kind of line ends.

    :raises EditRefused: it cannot be read, or has a kind without a layout.
    """
    text = EditedText(name, files[name]).text
    kind = _kind(name, files)
    if kind == "xml":
        before = _read_xml(text)
        after = format_xml(text)
        is_same = _xml_meaning(before) == _xml_meaning(XmlTree(after))
    elif kind == "toml":
        after = format_toml(text)
        is_same = _toml_meaning(text) == _toml_meaning(after)
    elif kind == "memory":
        after = format_memory(text)
        is_same = repr(decode(text)) == repr(decode(after))
    else:
        raise EditRefused(f"{name} is of a kind that has no layout here")
    if not is_same:
        raise EditRefused("it is written in a way that the layout would change; it stays as it is")
    mark = _BYTE_ORDER_MARK if files[name].startswith(_BYTE_ORDER_MARK) else b""
    return mark + after.encode()


def _kind(name: str, files: Files) -> str:
    """Return "xml", "toml", "memory", or an empty text for a file without a layout."""
    if name == memory_file(files):
        return "memory"
    folder, _, rest = name.rpartition("/")
    if name.endswith(".toml") and folder in ("", "robots", "tables", "texts"):
        return "toml"
    if not name.lower().endswith(".xml") or rest.startswith("."):
        return ""
    try:
        settings = tomllib.loads(files.get(SCENARIO_FILE, b"").decode("utf-8-sig"))
    except (ValueError, RecursionError):
        settings = {}
    places = [str(settings.get(kind) or DEFAULT_PATHS[kind]).rstrip("/") for kind in ("acts", "rules")]
    return "xml" if folder in (*places, PATTERNS) or name in places else ""


def _read_xml(text: str) -> XmlTree:
    try:
        return XmlTree(text)
    except XmlSyntaxError as error:
        line = len(re.findall(r"\r\n?|\n", text[: error.offset])) + 1
        raise EditRefused(f"line {line}: {error}") from None


def _xml_meaning(tree: XmlTree) -> Any:
    """Return what a reader takes from a file, and its comments."""
    found = []
    for element in tree.root.walk():
        texts = (element.text, *(child.tail for child in element))
        has_text = any(text.strip(BLANKS) for text in texts)
        kept = texts if has_text and element else tuple(text.strip(BLANKS) for text in texts)
        found.append((element.tag, tuple(element.attributes.items()), kept, len(element)))
    return found, list(comments_of(tree.text))


def _toml_meaning(text: str) -> Any:
    comments = [line.strip() for line in text.splitlines() if line.lstrip().startswith("#")]
    return repr(tomllib.loads(text)), comments
