"""SSML, the markup of speech (https://www.w3.org/TR/speech-synthesis11): messages with pauses and emphasis
(docs/reference/cra.md, "SSML"; semantics.md 2.6).

A message is SSML if it begins with `<speak` and is well-formed. Any other text is spoken literally. expat reads it
safely: a DOCTYPE cannot precede `<speak`, so there are no entities and no external files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from html import escape
from math import fsum
from typing import NamedTuple, Protocol
from xml.parsers import expat

BEGINNING = "<speak"
LANGUAGE_ATTRIBUTE = "xml:lang"
MAX_DEPTH = 256
"""Maximum nesting of elements, as in all XML files of a scenario."""
TIME = re.compile(r"\s*\+?(\d+(?:\.\d+)?|\.\d+)(ms|s)\s*\Z", re.ASCII)
"""The length of a `<break>`: `500ms`, `1.5s`."""
_BEGINNING = re.compile(r"<speak(?=[\s/>])")
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_SILENT_ELEMENTS = frozenset({"desc", "meta", "metadata", "lexicon", "lookup"})
_PRONOUNCED_ELEMENTS = frozenset({"phoneme", "say-as", "sub"})
"""Elements with a pronunciation from the author."""
_SEPARATING_ELEMENTS = frozenset({"break", "p", "s"})
"""Elements that separate words, as a blank does."""
_GAP = "\0"
"""Replaces them while words are collected; XML cannot contain it."""


class XmlElement(Protocol):
    """An element of any parser."""

    tag: str
    attributes: dict[str, str]
    text: str
    tail: str

    def __iter__(self) -> Iterator[XmlElement]: ...


class SsmlElement(list["SsmlElement"]):
    """An element of a message: a list of its children."""

    __slots__ = ("attributes", "tag", "tail", "text")

    def __init__(self, tag: str, attributes: dict[str, str]) -> None:
        self.tag = tag
        """With its prefix; elements of SSML have none."""
        self.attributes = attributes
        self.text = ""
        """The text before its first child. Comments leave no trace."""
        self.tail = ""
        """The text after it, before the next element."""

    def walk(self) -> Iterator[SsmlElement]:
        """Yield it and its contents, in the order of the text."""
        yield self
        for child in self:
            yield from child.walk()


class SpokenSsml(NamedTuple):
    """The audible content of SSML."""

    words: str
    """Without tags, and with single blanks."""
    pause: float
    """The total of all breaks with a length, in seconds."""


def begins_as_ssml(text: str) -> bool:
    """Whether a text begins with `<speak`, so that it is meant as SSML."""
    return text.startswith(BEGINNING) and _BEGINNING.match(text) is not None


def plain_words(text: str) -> str:
    """The audible words: those of SSML, or any other text unchanged.

    >>> plain_words('<speak>Hello<break time="1s"/>you, <sub alias="doctor">Dr.</sub> <emphasis>Who</emphasis></speak>')
    'Hello you, doctor Who'
    >>> plain_words("a < b"), plain_words("<speak>a < b")
    ('a < b', '<speak>a < b')
    """
    found = _read(text) if begins_as_ssml(text) else None
    return found.words if found is not None else text


def pause_seconds(text: str) -> float:
    """Seconds of silence in the breaks of a message; 0 if it is not SSML."""
    found = _read(text) if begins_as_ssml(text) else None
    return found.pause if found is not None else 0.0


def escape_value(text: str) -> str:
    """Escape a text for SSML, also in an attribute. Characters that XML cannot contain become U+FFFD."""
    return escape(_NOT_XML.sub("\ufffd", text))


def literal_ssml(text: str) -> str:
    """SSML that speaks a text literally."""
    return f"<speak>{escape_value(text)}</speak>"


def change_words(text: str, change: Callable[[str, str], str]) -> str | None:
    """Apply `change` to all words in SSML, except in `<phoneme>`, `<say-as>` and `<sub>`.

    :param change: gets a piece of text and its `xml:lang` language (or an empty text).
    :return: the same text if nothing has changed; None: it is not SSML.
    """
    root = parse_ssml(text)
    if root is None:
        return None
    changed = False

    def changed_text(piece: str, language: str) -> str:
        nonlocal changed
        after = change(piece, language) if piece and not piece.isspace() else piece
        changed = changed or after != piece
        return after

    def visit(element: SsmlElement, language: str) -> None:
        language = element.attributes.get(LANGUAGE_ATTRIBUTE, language)
        if element.tag not in _PRONOUNCED_ELEMENTS | _SILENT_ELEMENTS:
            element.text = changed_text(element.text, language)
            for child in element:
                visit(child, language)
                child.tail = changed_text(child.tail, language)

    visit(root, "")
    return write_element(root) if changed else text


def write_element(element: XmlElement) -> str:
    """Write an element as text: without its tail and comments, and with characters instead of references."""
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in element.attributes.items())
    inner = escape(element.text, quote=False) + "".join(
        write_element(child) + escape(child.tail, quote=False) for child in element
    )
    return f"<{element.tag}{attributes}>{inner}</{element.tag}>" if inner else f"<{element.tag}{attributes}/>"


def parse_ssml(text: str) -> SsmlElement | None:
    """The `<speak>` of a message; None if it is not SSML."""
    if not begins_as_ssml(text):
        return None
    outside = SsmlElement("", {})
    open_elements = [outside]
    pieces: list[str] = []

    def flush_text() -> None:
        inside = open_elements[-1]
        if inside:
            inside[-1].tail = "".join(pieces)
        else:
            inside.text = "".join(pieces)
        pieces.clear()

    def on_start(tag: str, attributes: dict[str, str]) -> None:
        flush_text()
        if len(open_elements) > MAX_DEPTH:
            raise ValueError("elements are nested too deeply")
        element = SsmlElement(tag, attributes)
        open_elements[-1].append(element)
        open_elements.append(element)

    def on_end(tag: str) -> None:
        flush_text()
        open_elements.pop()

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = on_start
    parser.EndElementHandler = on_end
    parser.CharacterDataHandler = pieces.append
    try:
        parser.Parse(text.encode(), True)
    except (expat.ExpatError, ValueError):  # half a character is a ValueError, too
        return None
    return outside[0]


def break_seconds(time: str) -> float:
    """The length of a `<break>` with this `time` in seconds; 0 for an invalid time."""
    found = TIME.match(time)
    return float(found[1]) * (0.001 if found[2] == "ms" else 1.0) if found is not None else 0.0


@lru_cache(512)
def _read(text: str) -> SpokenSsml | None:
    root = parse_ssml(text)
    if root is None:
        return None
    pieces: list[str] = []
    pauses: list[float] = []

    def visit(element: SsmlElement) -> None:
        apart = _GAP if element.tag in _SEPARATING_ELEMENTS else ""
        pieces.append(apart)
        if element.tag == "sub" and (alias := element.attributes.get("alias")) is not None:
            pieces.append(alias)
        elif element.tag not in _SILENT_ELEMENTS:
            pieces.append(element.text)
            if element.tag == "break":
                pauses.append(break_seconds(element.attributes.get("time", "")))
            for child in element:
                visit(child)
                pieces.append(child.tail)
        pieces.append(apart)

    visit(root)
    gathered = re.sub(f"{_GAP}+(?=\\w)", " ", "".join(pieces)).replace(_GAP, "")
    return SpokenSsml(" ".join(gathered.split()), fsum(pauses))
