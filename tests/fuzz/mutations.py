"""Mutations of scenario files: of bytes, tokens, structure, characters, TOML, JSON and expressions.

Each takes the content of a file and a source of chance, and gives another content. They know nothing of the program.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence
from pathlib import PurePath
from random import Random
from typing import TypeAlias

Mutation: TypeAlias = Callable[[bytes, Random], bytes]

CHARACTERS = (
    *("\u00a0", "\u0085", "\u2028", "\u2029", "\u3000", "\u200b", "\u200d", "\u200e", "\ufeff", "\u00ad", "\u061c"),
    *("\u202e", "\u2066", "\u2069", "\u206a", "\ufff9", "\ufffb", "\ufffd", "\ufffe", "\uffff", "\u3164", "\u115f"),
    *("\U0001f600", "\U0001f469\u200d\U0001f52c", "\U000e0041", "\U0001d400", "\u0308", "\u0301" * 20, "u\u0308", "ü"),
    *("\x00", "\x01", "\x07", "\x0b", "\x0c", "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x9b", "\r", "\r\n", "\n\r", "\t"),
    *("“", "”", "„", "’", "«", "–", "—", "…", "−", "×", "²", "½", "ſ", "ﬁ", "İ", "ı", "ß", "а", "Α", "٣", "߁", "१"),
)
BYTES = (b"\xff", b"\xfe", b"\xc3", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xc0\x80", b"\xef\xbb\xbf", b"\x00\x00")
PIECES = (
    *("<", ">", "&", '"', "'", "{", "}", "[", "]", "(", ")", "=", ",", ";", "|", "\\", "/", "#", "!", "%", "`", "-"),
    *(
        "<!--",
        "-->",
        "<!-- a -->",
        "<![CDATA[",
        "]]>",
        "<?x",
        "?>",
        "<?xml version='1.0'?>",
        "<!DOCTYPE a>",
        "</",
        "/>",
    ),
    *("&lt;", "&amp;", "&amp;&amp;", "&nbsp;", "&#0;", "&#xA0;", "&#x1F600;", "&#xFFFE;", "&#55296;", "&#10;", "&#13;"),
    *("<else/>", '<elseif cond="a"/>', "<oneOf>", '<if cond="a">', "</if>", "<onExit/>", "<State/>", "<transition/>"),
    *("<Variants>", "<waitForActions>1, 2</waitForActions>", "<onFailure>continue</onFailure>", "<Wait/>", "<a:b/>"),
    *(' xmlns="x"', ' xml:lang="de"', ' xmlns:a="b"', ' name="A"', ' after="1s"', ' cond="a"', ' target="S"', " a=b"),
    *(
        '"""',
        "'''",
        "[[a]]",
        "[act.x]",
        "a.b.c = 1",
        "x = { y = [1, {}] }",
        "1979-05-27T07:32:00Z",
        "0x10",
        "inf",
        "nan",
    ),
    *("NaN", "Infinity", "-0", "1e999", "1e-999", "9" * 30, "0." + "1" * 400, "\\u00e4", "\\ud83d", "\\ud83d\\ude00"),
    *("null", "true", "[]", "{}", "[[[[[[]]]]]]", '{"a": {"b": 1}}', "<<<<<<< HEAD\n", "=======\n", ">>>>>>> other\n"),
)
WORDS = (
    *("a", "b.c", "a.0", "_", "e", "pi", "rand", "min", "max", "length", "lower", "defined", "true", "false", "null"),
    *(
        "1",
        "0",
        "-1",
        "+3",
        "2.5",
        ".5",
        "1.",
        "1e5",
        "1e309",
        "12345678901234567890",
        "'x'",
        '"y"',
        "'",
        '"',
        "'\\u0041'",
    ),
    *("and", "or", "xor", "not", "&&", "||", "!", "=", "==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/", "^", "%"),
    *("(", ")", ",", ".", "starts with", "ends with", "contains", "AND", "{a}", "[0]", "sin(", "a.b.c.d", "ü", "²"),
)
VALUES = (
    *(
        '""',
        '"a"',
        "1",
        "-1",
        "0",
        "1.5",
        "true",
        "false",
        "[]",
        "{}",
        "['a', 1]",
        "inf",
        "nan",
        "1979-05-27",
        "07:32:00",
    ),
    *(
        '{ act = "x" }',
        '{ rule = "x" }',
        '{ event = "/x" }',
        '{ set = "a = 1" }',
        '{ stop_act = "" }',
        "99999999999999999999",
    ),
)
KEYS = (
    *("title", "robot", "mode", "acts", "rules", "memory", "keys", "act", "fillers", "study", "actions", "conditions"),
    *("trials", "explore", "always", "reachable", "eventually"),
    *(
        "hold",
        "debounce",
        "filler",
        "calling_type",
        "offer_after",
        "auto_after",
        "label",
        "set",
        "event",
        '""',
        '"\\u0000"',
    ),
    *(
        "parameters",
        "type",
        "codes",
        "names",
        "without",
        "substitute",
        "limit",
        "seconds",
        "carrier",
        "x.y",
        '"ä"',
        "'.'",
    ),
)
_TOKEN = re.compile(r"<[^<>]*>|\"[^\"\n]*\"|[\w.]+|\s+|.", re.DOTALL)
_TAG = re.compile(r"<[^<>]*>")
_VALUE = re.compile(r"(?<==\")[^\"]*(?=\")|(?<=>)[^<>]+(?=<)")
_EXPRESSION = re.compile(r"(?<=cond=\")[^\"]*|(?<=assignValue=\")[^\"]*|(?<=set = \")[^\"]*")
_JSON = re.compile(r'"(?:[^"\\]|\\.)*"|-?\d+(?:\.\d+)?|true|false|null|[\[\]{},:]')
_PAIR = re.compile(r"^([^=\n]+?)(\s*=\s*)(.*)$", re.MULTILINE)


def mutate(name: str, content: bytes, chance: Random) -> bytes:
    """A file after one to four mutations that fit its kind."""
    known = BY_KIND.get(PurePath(name).suffix, ()) or (of_bytes,)
    for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        content = chance.choice((*known, *EVERYWHERE))(content, chance)
    return content[:60_000]


# --- of any file ----------------------------------------------------------------------------------------------------


def of_bytes(content: bytes, chance: Random) -> bytes:
    """Bytes are lost, changed, put in, or given twice."""
    at, length = chance.randint(0, len(content)), chance.choice((0, 1, 1, 2, 5, 20, 200))
    new = chance.choice(
        (b"", chance.randbytes(chance.randint(1, 4)), chance.choice(BYTES), content[at : at + length] * 2)
    )
    return content[:at] + new + content[at + length :]


def of_length(content: bytes, chance: Random) -> bytes:
    """The end is lost, or a part is there many times."""
    at = chance.randint(0, len(content))
    if chance.random() < 0.5:
        return content[:at]
    length = chance.choice((1, 3, 10, 60))
    return content[:at] + content[at : at + length] * chance.choice((2, 10, 100)) + content[at:]


def of_characters(content: bytes, chance: Random) -> bytes:
    """Characters that look like others, or like nothing; accents taken apart; other line ends."""
    text = content.decode("utf-8", "surrogateescape")
    match chance.randrange(8):
        case 0:
            text = unicodedata.normalize(chance.choice(("NFD", "NFC", "NFKD")), text)
        case 1:
            text = text.replace(
                "\n", chance.choice(("\r", "\r\n", "\u2028", "\x85", "\n\n\n")), chance.choice((1, 5, -1))
            )
        case 2:
            text = text.replace(chance.choice(" \"'=<>aeS"), chance.choice(CHARACTERS), chance.choice((1, 3, -1)))
        case _:
            at = chance.randint(0, len(text))
            text = text[:at] + chance.choice(CHARACTERS) + text[at + chance.choice((0, 0, 1)) :]
    return text.encode("utf-8", "surrogateescape" if chance.random() < 0.9 else "surrogatepass")


def of_pieces(content: bytes, chance: Random) -> bytes:
    """Something from the languages involved stands where it should not."""
    text = content.decode("utf-8", "surrogateescape")
    at = chance.randint(0, len(text))
    return _encoded(text[:at] + chance.choice(PIECES) + text[at + chance.choice((0, 0, 1, 4)) :])


def of_tokens(content: bytes, chance: Random) -> bytes:
    """Tags, words and texts are lost, swapped, given twice or replaced by others of the same file."""
    tokens = _TOKEN.findall(content.decode("utf-8", "surrogateescape"))
    for _ in range(chance.choice((1, 1, 2, 5))):
        if len(tokens) < 2:
            break
        one, other = chance.randrange(len(tokens)), chance.randrange(len(tokens))
        match chance.randrange(4):
            case 0:
                del tokens[one]
            case 1:
                tokens[one], tokens[other] = tokens[other], tokens[one]
            case 2:
                tokens.insert(one, tokens[other])
            case 3:
                tokens[one] = tokens[other]
    return _encoded("".join(tokens))


# --- of XML ---------------------------------------------------------------------------------------------------------


def of_elements(content: bytes, chance: Random) -> bytes:
    """A stretch between two tags is moved, given twice, nested in itself or lost."""
    text = content.decode("utf-8", "surrogateescape")
    tags = [found.span() for found in _TAG.finditer(text)]
    if len(tags) < 2:
        return content
    first, last = sorted(chance.choices(tags, k=2))
    stretch = text[first[0] : last[1]]
    at = chance.choice(tags)[chance.randrange(2)]
    match chance.randrange(4):
        case 0:
            text = text[: first[0]] + text[last[1] :]
        case 1:
            text = text[:at] + stretch[:5000] + text[at:]
        case 2:
            depth = chance.choice((2, 10, 60, 300))
            opening = text[slice(*first)]
            closing = "</" + (re.match(r"</?([^\s/>]*)", opening) or [opening, "a"])[1] + ">"
            text = text[: first[0]] + opening * depth + closing * chance.choice((depth, depth - 1)) + text[first[1] :]
        case 3:
            text = text[: first[0]] + chance.choice((" ", "x", "\u00a0", "<!-- -->")) + text[first[0] :]
    return _encoded(text)


def of_values(content: bytes, chance: Random) -> bytes:
    """The value of an attribute, or the text of an element, becomes another."""
    new = chance.choice((*WORDS, *PIECES, *CHARACTERS, "", " ", "A" * 3000, "{a}{b}{c}x", "{a|b}" * 30 + "x"))
    return _in_place(_VALUE, content, chance, lambda old: chance.choice((new, old + new, new + old, old * 2)))


def of_expressions(content: bytes, chance: Random) -> bytes:
    """A condition or an assignment gets other words."""

    def change(old: str) -> str:
        words = re.findall(r"\w+|\W", old)
        for _ in range(chance.choice((1, 2, 5, 12))):
            at = chance.randint(0, len(words))
            words[at : at + chance.choice((0, 1, 1))] = [chance.choice((" ", "")), chance.choice(WORDS), " "]
        return "".join(words) if chance.random() < 0.9 else "(" * 200 + "".join(words) + ")" * 200

    escaped = chance.random() < 0.8
    return _in_place(_EXPRESSION, content, chance, lambda old: _escaped(change(old)) if escaped else change(old))


# --- of JSON and TOML -----------------------------------------------------------------------------------------------


def of_json(content: bytes, chance: Random) -> bytes:
    """A value, a key or a bracket becomes another."""
    new = chance.choice(
        (*PIECES, *WORDS, '"WorkingMemory"', '"workingmemory"', '""', '"a.b"', '"a"', "[" * 70 + "]" * 70)
    )
    return _in_place(_JSON, content, chance, lambda old: chance.choice((new, old + new, f"{old},{old}", "")))


def of_toml(content: bytes, chance: Random) -> bytes:
    """A line is lost or given twice, a key or a value becomes another, a table comes from nowhere."""
    lines = content.decode("utf-8", "surrogateescape").split("\n")
    at = chance.randrange(len(lines))
    match chance.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines.insert(chance.randrange(len(lines) + 1), lines[at])
        case 2:
            header = chance.choice(("[{}]", "[[{}]]", "[act.{}]", "[actions.{}]", "[keys.{}]", "[study.{}]"))
            lines.insert(at, header.format(chance.choice((*KEYS, "Speech", "Wait", "A", "names"))))
        case 3:
            lines.insert(at, f"{chance.choice(KEYS)} = {chance.choice(VALUES)}")
        case 4:
            lines[at] = _PAIR.sub(lambda pair: pair[1] + pair[2] + chance.choice((*VALUES, *WORDS)), lines[at])
        case 5:
            lines[at] = _PAIR.sub(lambda pair: chance.choice(KEYS) + pair[2] + pair[3], lines[at])
    return _encoded("\n".join(lines))


def _in_place(pattern: re.Pattern[str], content: bytes, chance: Random, change: Callable[[str], str]) -> bytes:
    text = content.decode("utf-8", "surrogateescape")
    spans = [found.span() for found in pattern.finditer(text)]
    if not spans:
        return content
    start, end = chance.choice(spans)
    return _encoded(text[:start] + change(text[start:end]) + text[end:])


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")


EVERYWHERE: Sequence[Mutation] = (of_bytes, of_length, of_characters, of_characters, of_pieces, of_tokens)
BY_KIND: dict[str, Sequence[Mutation]] = {
    ".xml": (of_elements, of_elements, of_values, of_values, of_values, of_expressions, of_expressions, of_expressions),
    ".json": (of_json,) * 5,
    ".toml": (of_toml,) * 8,
}
