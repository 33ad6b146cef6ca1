"""Finds errors in an author's SSML before a session begins (docs/reference/cra.md, "SSML")."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.speech.ssml import (
    BEGINNING,
    LANGUAGE_ATTRIBUTE,
    TIME,
    SsmlElement,
    begins_as_ssml,
    parse_ssml,
)
from rise_engine.scenario.speech.template import Template

ELEMENTS = (
    *("speak", "p", "s", "token", "w", "break", "emphasis", "prosody", "voice", "lang", "sub", "say-as", "phoneme"),
    *("audio", "mark", "desc", "lexicon", "lookup", "meta", "metadata"),
)
"""The elements of SSML 1.1. A manufacturer's own elements have a prefix."""
_SLOT = "\ue000"
"""Replaces a memory value while the rest is read as XML: a private character that no name can contain."""
_PROLOG = ("<?xml", "<!DOCTYPE")
_LONGEST_PIECE = 12
_MAX_PROBLEMS = 20
"""Maximum number of problems of one kind that are reported for a message."""


class SsmlProblem(NamedTuple):
    """A problem with a message."""

    is_error: bool
    text: str
    piece: str = ""
    """The text at its place in the message."""
    nth: int = 0
    """How often that text occurs earlier in the message."""

    def index_in(self, text: str) -> int:
        """Its offset in a text that contains the message; 0: unknown."""
        at = -1
        for _ in range(self.nth + 1):
            at = text.find(self.piece, at + 1)
            if at < 0:
                return 0
        return at


def find_ssml_problems(template: Template) -> Iterator[SsmlProblem]:
    """Yield all problems with a message that is meant as SSML, and none for any other text."""
    if template.text.startswith(_PROLOG) and "<speak" in template.text:
        yield SsmlProblem(True, "SSML begins with `<speak`; delete what comes before it", template.text[:5])
    if not begins_as_ssml(template.text):
        return
    text = _without_slots(template)
    root = parse_ssml(text)
    if root is None:
        yield _explain(text)
    else:
        yield from islice(_slot_problems(template, root), _MAX_PROBLEMS)
        yield from islice(_element_problems(root, text), _MAX_PROBLEMS)


def languages_in(template: Template) -> Iterator[str | None]:
    """Yield every `xml:lang` in SSML; None for a language from the memory."""
    root = parse_ssml(_without_slots(template))
    for element in root.walk() if root is not None else ():
        if (language := element.attributes.get(LANGUAGE_ATTRIBUTE)) is not None:
            yield None if _SLOT in language else language


def _without_slots(template: Template) -> str:
    return "".join(part if isinstance(part, str) else _SLOT for part in template.parts)


def _problem_at(text: str, index: int, message: str, piece: str = "") -> SsmlProblem:
    """A problem at a character of a text without slots: an error, or a warning about `piece`."""
    found = piece or re.split(rf"[\s{_SLOT}]", text[index : index + _LONGEST_PIECE], maxsplit=1)[0]
    return SsmlProblem(not piece, message, found or BEGINNING, text.count(found, 0, index) if found else 0)


def _explain(text: str) -> SsmlProblem:
    """Explain why a text is not SSML in the words for XML files: libxml2 gives more details than expat."""
    from rise_engine.syntax.xml_errors import describe_syntax_error, parse_error  # lxml is rarely needed

    try:
        error = parse_error(text)
    except ValueError:
        return SsmlProblem(True, "this text holds half a character, which no XML can", BEGINNING)
    if error is None:
        return SsmlProblem(True, "a name in these tags has a character that no XML name can have", BEGINNING)
    _, index, sentence = describe_syntax_error(error, text)
    message = error.msg or ""
    if "Extra content" in message:
        sentence = "the message goes on after its `</speak>`; one `<speak>` holds all of it"
    elif "EntityRef" in message or "Entity" in message:
        index = text.rfind("&", 0, index + 2)
        sentence = "in SSML, `&` is written `&amp;`; other characters are written as they are"
    elif "invalid element name" in message:
        index = text.rfind("<", 0, index + 2)
        sentence = "`<` is not allowed here; in SSML, write `&lt;`"
    return _problem_at(text, max(index, 0), sentence.replace(" of line 1", ""))


def _slot_problems(template: Template, root: SsmlElement) -> Iterator[SsmlProblem]:
    """Yield problems with texts beside or instead of a value, which must not change the tags."""
    slots, within_tags = template.slots, list(_slots_within_tags(root))
    if slots and (len(within_tags) != _without_slots(template).count(_SLOT) or "<![CDATA[" in template.text):
        message = "a memory value belongs between the tags or in an attribute, not in a comment or in CDATA"
        yield SsmlProblem(True, message, "<!" if "<!" in template.text else BEGINNING)
        return
    if len(within_tags) != len(slots):  # the text itself contains the character that replaces slots
        within_tags = [True] * len(slots)
    for slot, within_tag in zip(slots, within_tags, strict=True):
        for piece in filter(None, (slot.fallback, slot.before, slot.after)):
            if not _is_words(piece) or (within_tag and ('"' in piece or "'" in piece)):
                message = (
                    f"`{piece}` is beside a memory value, or is its fallback: only words are allowed there. Write "
                    "`&lt;` for `<`, `&amp;` for `&` and, within a tag, `&quot;` for quotation marks"
                )
                yield SsmlProblem(True, message, piece)


def _slots_within_tags(root: SsmlElement) -> Iterator[bool]:
    """Yield for each slot, in the order of the text, whether it is in an attribute."""
    yield from (True for value in root.attributes.values() for _ in range(value.count(_SLOT)))
    yield from (False for _ in range(root.text.count(_SLOT)))
    for child in root:
        yield from _slots_within_tags(child)
        yield from (False for _ in range(child.tail.count(_SLOT)))


def _is_words(piece: str) -> bool:
    """Whether a text consists only of words in SSML."""
    return "<" not in piece and ("&" not in piece or parse_ssml(f"<speak>{piece}</speak>") is not None)


def _element_problems(root: SsmlElement, text: str) -> Iterator[SsmlProblem]:
    unknown: set[str] = set()
    for element in root.walk():
        name = element.tag
        if ":" not in name and name not in ELEMENTS and name not in unknown:
            unknown.add(name)
            message = f"SSML has no element `<{name}>`{did_you_mean(name, ELEMENTS)}"
            yield _problem_at(text, text.find(f"<{name}"), message, f"<{name}")
        time = element.attributes.get("time") if name == "break" else None
        if time is not None and _SLOT not in time and TIME.match(time) is None:
            message = f'`{time}` is not a time; write <break time="500ms"/> or <break time="1.5s"/>'
            yield _problem_at(text, max(text.find(f'"{time}'), text.find(f"'{time}")) + 1, message, time)
