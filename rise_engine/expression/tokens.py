"""Splits an expression into tokens: words, numbers, texts and operators, each with its place.

Synonyms are unified here (`&&` is `and`, `=` is `==`), so the parser gets one spelling of each operator.
"""

from __future__ import annotations

import re
from math import inf
from typing import Any, NamedTuple
from unicodedata import combining, normalize

from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.base.nearest_name import Correction
from rise_engine.base.text import match_end
from rise_engine.expression.environment import native_number
from rise_engine.expression.errors import ExpressionError

MAX_LENGTH = 100_000
"""Maximum characters of an expression or assignment."""

RESERVED = frozenset({"or", "xor", "and", "not", "true", "false", "null"})
"""Words that cannot be keys."""

KEY = re.compile(r"[^\W\d][\w.]*")
"""A memory key in an expression: a letter or `_`, then letters, digits, `_` and dots."""

_TOKEN = re.compile(
    r"""\s*(?:
      ([^\W\d][\w.]*)
    | (?<=\])((?:\.\w+)+)
    | ((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    | (&&|\|\||==(?!=)|!=(?!=)|<=(?!>)|>=|=(?![=!])|!(?!=)|<(?!>)|[>()\[\]+\-/^,]|\*(?!\*))
    | ("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')
    | (\Z)
    | (.)
    )""",
    re.VERBOSE | re.DOTALL,
)
_WORD, _NAMES, _NUMBER, _OPERATOR, _TEXT, _END, _BAD = range(1, 8)
_SYNONYMS = {"&&": "and", "||": "or", "!": "not", "=": "=="}
_ESCAPE = re.compile(r"\\(?:u([0-9a-fA-F]{4})|(.))", re.DOTALL)
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "/": "/", "\\": "\\", '"': '"', "'": "'"}
_INTENDED_OPERATORS = {
    "&": "and",
    "|": "or",
    "=": "=",
    "!": "!=",
    "<": "!=",
    "*": "^",
    "≥": ">=",
    "≤": "<=",
    "≠": "!=",
    "×": "*",
    "·": "*",
    "÷": "/",
    "¬": "not",
    "∧": "and",
    "∨": "or",
    "²": "^2",
    "³": "^3",
    ":": "=",
}
"""Replacements of wrong characters."""
_HINTS = {
    "%": "there is no remainder operator; the remainder of n by 2 is `n - 2 * floor(n / 2)`",
    "&": "write `and` or `&&`",
    "|": "write `or` or `||`",
    "=": "write `=` or `==`",
    "<": "write `!=` for different",
    "*": "write `^` for powers",
    ";": "separate arguments by a comma",
    "{": "braces belong to the parameters of actions; write the key alone",
    "}": "braces belong to the parameters of actions; write the key alone",
    ".": "a name follows a dot directly: `items[i].text`",
    "−": "write the plain minus sign `-`",
    "–": "write the plain minus sign `-`",
    "$": "write the key alone",
    "?": "choose with `if` and `else` in the rule",
    ":": "write `=` to compare",
}
_PATH_PIECE = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[\[\]"']""", re.DOTALL)
_NAMES_BEHIND = re.compile(r"(?:\.\w+)*")
_NEXT_INDEX = re.compile(r"\s*\[")
TYPOGRAPHIC_QUOTES = "“”„‟‘’‚«»‹›`´"
_CLOSING = re.compile(rf"[{TYPOGRAPHIC_QUOTES}](?!\w)")


class Token(NamedTuple):
    """`kind` is word, names (`.text` after a `]`), number, text, end, or the unified operator or reserved word."""

    kind: str
    value: Any
    start: int
    end: int


def tokenize(text: str) -> list[Token]:
    """Split a text into tokens; the last one has the kind `end`. Raises ExpressionError."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression is longer than {MAX_LENGTH:,} characters", text[:200], 1)
    tokens: list[Token] = []
    for match in _TOKEN.finditer(text):
        group = match.lastindex or _BAD
        start, end = match.span(group)
        value: Any = match[group]
        kind = "end"
        if group == _WORD:
            kind = value if value in RESERVED else "word"
            check_key(text, value, start)
        elif group == _NAMES:
            kind = "names"
            check_key(text, value, start)
        elif group == _OPERATOR:
            kind = _SYNONYMS.get(value, value)
        elif group == _NUMBER:
            kind, value = "number", _number(text, value, start, end)
        elif group == _TEXT:
            kind, value = "text", unquote(text, value, start)
        elif group == _BAD:
            raise _bad_character(text, value, start)
        tokens.append(Token(kind, value, start, end))
        if kind == "end":
            break
    return tokens


def path_end(text: str, start: int) -> int:
    """The end of a path such as `[i].text[0]` whose first `[` is at `start`; -1: a bracket is not closed."""
    at, level = start, 0
    while True:
        piece = _PATH_PIECE.search(text, at)
        if piece is None or piece[0] in ('"', "'"):  # an unclosed text
            return -1
        at = piece.end()
        level += {"[": 1, "]": -1}.get(piece[0], 0)
        if level == 0:
            at = match_end(_NAMES_BEHIND, text, at)
            following = _NEXT_INDEX.match(text, at)
            if following is None:
                return at
            at = following.end() - 1


def unquote(text: str, quoted: str, start: int) -> str:
    """The value of a quoted text, with the escapes of JSON (and `\\'`). `start` is its offset in `text`."""
    if "\\" not in quoted:
        return quoted[1:-1]

    def replace(match: re.Match[str]) -> str:
        code, letter = match.groups()
        if code is not None:
            return chr(int(code, 16))
        if letter not in _ESCAPES:
            raise ExpressionError(
                f"`\\{letter}` means nothing in a text", text, start + match.start() + 1, "write `\\\\` for a backslash"
            )
        return _ESCAPES[letter]

    value = _ESCAPE.sub(replace, quoted)[1:-1]
    try:
        # Two \u escapes may form one character; half of such a pair is not a character.
        return value.encode("utf-16", "surrogatepass").decode("utf-16")
    except UnicodeDecodeError:
        raise ExpressionError("a `\\u` escape here is half a character", text, start + 1) from None


def escape_text(value: str, quote: str) -> str:
    """Escape a text for these quotation marks; without a mark it stays unchanged.

    >>> print(escape_text("It's", "'"))
    It\\'s
    """
    return value.replace("\\", "\\\\").replace(quote, "\\" + quote) if quote else value


def _number(text: str, digits: str, start: int, end: int) -> int | float:
    if KEY.match(text, end) or text.startswith(".", end):
        raise ExpressionError(
            f"`{_word_at(text, start)}` is neither a number nor a key",
            text,
            start + 1,
            "a key begins with a letter or `_`, and a product needs its `*`",
        )
    value = number_of(digits)
    if value == inf:
        raise ExpressionError("this number is too large", text, start + 1)
    return value


def number_of(digits: str) -> int | float:
    """The number in a text: an integer if it is whole and fits into 64 bits."""
    if len(digits) < 20 and digits.isdigit() and (whole := int(digits)) < 2**63:
        return whole
    return native_number(float(digits))


def _word_at(text: str, start: int) -> str:
    match = re.compile(r"[\w.]+").match(text, start)
    return match[0][:40] if match else text[start]


def check_key(text: str, word: str, start: int) -> None:
    """Refuse a word that matches `KEY` but cannot be a key. Raises ExpressionError.

    For `re`, superscripts and similar characters are word characters, but people do not mean letters.
    """
    if word.count(".") >= MAX_LEVELS:
        raise ExpressionError(
            f"this key has more than {MAX_LEVELS} parts", text, start + 1, "no memory value is deeper"
        )
    if word.isascii():
        return
    for offset, character in enumerate(word):
        if not ("_" + character).isidentifier() and character != ".":
            raise _bad_character(text, character, start + offset)


def _bad_character(text: str, character: str, start: int) -> ExpressionError:
    column = start + 1
    if character in "\"'":
        curly = next((found.start() for found in _CLOSING.finditer(text, start + 1)), -1)
        if curly >= 0:
            return ExpressionError(
                f"`{text[curly]}` does not close the text that begins with {character}",
                text,
                curly + 1,
                f"write a straight quote: {character}",
            )
        return ExpressionError("this text has no closing quote", text, column, f"add {character} at its end")
    if character in TYPOGRAPHIC_QUOTES:
        return ExpressionError(
            f"`{character}` is a typographic quotation mark, and no quote here",
            text,
            column,
            "write straight quotes: \" or '",
        )
    entity = re.compile(r"&(lt|gt|amp|quot|apos);").match(text, start)
    if entity:
        return ExpressionError(f"`{entity[0]}` is escaped twice", text, column, "escape it once in the XML file")
    if text.startswith("=!", start):
        return ExpressionError("`=!` is not an operator", text, column, "write `!=` for different")
    if combining(character) and start > 0:
        whole = normalize("NFC", text[start - 1 : start + 1])
        hint = f"type it again as one character: `{whole}`" if len(whole) == 1 else "keys have letters without it"
        return ExpressionError(
            f"the accent of `{text[start - 1 : start + 1]}` is a character of its own", text, column, hint
        )
    shown = f"`{character}`" if character.isprintable() else f"The invisible character U+{ord(character):04X}"
    meant = _INTENDED_OPERATORS.get(character, "")
    usual = f"write `{meant}`" if meant else "a key has only letters, digits, `_` and dots"
    suggestion = Correction(character, meant) if meant else None
    return ExpressionError(f"{shown} has no meaning here", text, column, _HINTS.get(character, usual), suggestion)
