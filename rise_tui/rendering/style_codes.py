"""Style codes for a terminal: only what changes from one piece of text to the next. Pure.

Rich writes a full style before each piece and resets it afterwards. For a moved cursor in a list, that is half of the
bytes sent.
"""

from __future__ import annotations

import re
from typing import NamedTuple

_STYLE = re.compile(r"\x1b\[([\d;]*)m")
_MOVE = re.compile(r"\x1b\[[\d;]*[A-HJKfdG]")
_COLOUR = re.compile(r"(?:^|;)((?:38|48);(?:5;\d+|2;\d+;\d+;\d+)|3[0-79]|4[0-79]|9[0-7]|10[0-7])(?=;|$)")
_SEEN_ON_BLANKS = frozenset("479")
"""Underlined, reversed, struck out."""


class _Style(NamedTuple):
    """The effect of a code; empty: the terminal's default."""

    attributes: str = ""
    """Bold and similar."""
    foreground: str = ""
    background: str = ""


def shorten_styles(codes: str) -> str:
    """The same text with the same look, without codes that change nothing. It begins and ends without a style.

    The colour of a blank is invisible, and may differ.
    """
    first, *rest = _STYLE.split(codes)
    written, shown, wanted = [first], _Style(), _Style()
    for parameters, text in zip(rest[::2], rest[1::2], strict=True):
        wanted = _read(parameters)
        if printed := _MOVE.sub("", text):
            is_blank = not printed.strip(" ")
            if not (is_blank and _looks_alike_on_blanks(shown, wanted)):
                written.append(_change(shown, wanted))
                shown = wanted
        written.append(text)
    written.append(_change(shown, _Style()))
    return "".join(written)


def _read(parameters: str) -> _Style:
    if parameters in ("", "0"):
        return _Style()
    colours = _COLOUR.findall(parameters)
    foreground = next((each for each in colours if each[0] in "39"), "")
    background = next((each for each in colours if each[0] in "41"), "")
    return _Style(_COLOUR.sub("", parameters).strip(";"), foreground, background)


def _looks_alike_on_blanks(one: _Style, other: _Style) -> bool:
    seen = _SEEN_ON_BLANKS & {*one.attributes.split(";"), *other.attributes.split(";")}
    return one.background == other.background and not seen


def _change(shown: _Style, wanted: _Style) -> str:
    """The codes from one style to another."""
    if shown == wanted:
        return ""
    if wanted == _Style():
        return "\x1b[0m"
    takes_back = any(before and not after for before, after in zip(shown[1:], wanted[1:], strict=True))
    if takes_back or shown.attributes not in ("", wanted.attributes):
        return f"\x1b[{';'.join(('0', *filter(None, wanted)))}m"
    return f"\x1b[{';'.join(after for before, after in zip(shown, wanted, strict=True) if after and after != before)}m"
