"""The usual layout of all of a study's files: what `rise-engine fmt` writes, and the language server."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from msgspec import Struct

from rise_engine.author.edit.format_data import format_memory, format_toml
from rise_engine.author.edit.memory import memory_file
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.text_edits import EditedText
from rise_engine.base.json_codec import decode
from rise_engine.base.text import BLANKS
from rise_engine.scenario.element_templates import PATTERNS
from rise_engine.scenario.file_names import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.syntax.xml import XmlSyntaxError, XmlTree, comments_of
from rise_engine.syntax.xml_format import format_xml

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class StudyLayout(Struct, frozen=True):
    """What the usual layout makes of a study's files."""

    changed: dict[str, bytes]
    """The files that look different then."""
    problems: dict[str, str]
    """Files that stay as they are, each with the reason."""
    files: int
    """How many were looked at."""


def lay_out(files: Files) -> StudyLayout:
    """Acts, rules, settings, start values and translations in the usual layout. What is no such file is left alone."""
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
    """One file in the usual layout, with the byte order mark and the kind of line ends that it has.

    :raises EditRefused: it cannot be read, or is of a kind that has no layout here.
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
    """ "xml", "toml", "memory", or empty for what has no layout."""
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
    """What is read of a file, and its comments."""
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
