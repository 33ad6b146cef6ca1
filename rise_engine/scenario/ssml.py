"""SSML, the markup of speech (https://www.w3.org/TR/speech-synthesis11): messages with pauses and emphasis in them
(docs/reference/cra.md, "SSML"; semantics.md 2.6).

A message is SSML when it begins with `<speak` and is well-formed. Any other text is said as it stands. It is read by
expat alone: before `<speak` no DOCTYPE can stand, so there are no entities, and nothing outside is ever read.
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
"""Elements within each other, as in all XML files of a scenario."""
TIME = re.compile(r"\s*\+?(\d+(?:\.\d+)?|\.\d+)(ms|s)\s*\Z", re.ASCII)
"""How long a `<break>` is: `500ms`, `1.5s`."""
_BEGINNING = re.compile(r"<speak(?=[\s/>])")
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_NOT_SAID = frozenset({"desc", "meta", "metadata", "lexicon", "lookup"})
_SAID_AS_WRITTEN = frozenset({"phoneme", "say-as", "sub"})
"""Elements in which the author says how something is pronounced."""
_APART = frozenset({"break", "p", "s"})
"""Elements between words, as a blank is."""
_GAP = "\0"
"""Stands for them while words are gathered; no XML has it."""


class XmlElement(Protocol):
    """What an element is, whoever has read it."""

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
        """With its prefix; an element of SSML has none."""
        self.attributes = attributes
        self.text = ""
        """What stands before its first child. Comments leave no trace."""
        self.tail = ""
        """What stands behind it, before the next element."""

    def walk(self) -> Iterator[SsmlElement]:
        """It, and all in it, in the order of the text."""
        yield self
        for child in self:
            yield from child.walk()


class SpokenSsml(NamedTuple):
    """What is heard of SSML."""

    words: str
    """Without tags, and with single blanks."""
    pause: float
    """Seconds of all breaks that say how long they are."""


def begins_as_ssml(text: str) -> bool:
    """Whether a text begins with `<speak`: then it is meant as SSML."""
    return text.startswith(BEGINNING) and _BEGINNING.match(text) is not None


def plain_words(text: str) -> str:
    """What is heard of a message: of SSML the words, any other text as it stands.

    >>> plain_words('<speak>Hello<break time="1s"/>you, <sub alias="doctor">Dr.</sub> <emphasis>Who</emphasis></speak>')
    'Hello you, doctor Who'
    >>> plain_words("a < b"), plain_words("<speak>a < b")
    ('a < b', '<speak>a < b')
    """
    found = _read(text) if begins_as_ssml(text) else None
    return found.words if found is not None else text


def pause_seconds(text: str) -> float:
    """Seconds of silence that the breaks of a message name; 0 for one that is no SSML."""
    found = _read(text) if begins_as_ssml(text) else None
    return found.pause if found is not None else 0.0


def escape_value(text: str) -> str:
    """A text as it stands in SSML, in an attribute too. Characters that no XML can hold become U+FFFD."""
    return escape(_NOT_XML.sub("\ufffd", text))


def literal_ssml(text: str) -> str:
    """SSML in which a text is said as it stands, whatever is in it."""
    return f"<speak>{escape_value(text)}</speak>"


def change_words(text: str, change: Callable[[str, str], str]) -> str | None:
    """SSML in which `change` has been applied to all that is said, but in `<phoneme>`, `<say-as>` and `<sub>`.

    :param change: given a piece of text and the language that `xml:lang` says it is in (or an empty text).
    :return: the same text when nothing has changed; None when it is no SSML.
    """
    root = parse_ssml(text)
    if root is None:
        return None
    changed = False

    def changed_text(piece: str, language: str) -> str:
        nonlocal changed
        said = change(piece, language) if piece and not piece.isspace() else piece
        changed = changed or said != piece
        return said

    def visit(element: SsmlElement, language: str) -> None:
        language = element.attributes.get(LANGUAGE_ATTRIBUTE, language)
        if element.tag not in _SAID_AS_WRITTEN | _NOT_SAID:
            element.text = changed_text(element.text, language)
            for child in element:
                visit(child, language)
                child.tail = changed_text(child.tail, language)

    visit(root, "")
    return write_element(root) if changed else text


def write_element(element: XmlElement) -> str:
    """An element as a text, without what stands behind it: without comments, and with each character as itself."""
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in element.attributes.items())
    inner = escape(element.text, quote=False) + "".join(
        write_element(child) + escape(child.tail, quote=False) for child in element
    )
    return f"<{element.tag}{attributes}>{inner}</{element.tag}>" if inner else f"<{element.tag}{attributes}/>"


def parse_ssml(text: str) -> SsmlElement | None:
    """The `<speak>` of a message; None when it is no SSML."""
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
    except (expat.ExpatError, ValueError):  # half a character is a ValueError too
        return None
    return outside[0]


def break_seconds(time: str) -> float:
    """How long a `<break>` with this `time` is; 0 for a time that cannot be read."""
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
        apart = _GAP if element.tag in _APART else ""
        pieces.append(apart)
        if element.tag == "sub" and (alias := element.attributes.get("alias")) is not None:
            pieces.append(alias)
        elif element.tag not in _NOT_SAID:
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
