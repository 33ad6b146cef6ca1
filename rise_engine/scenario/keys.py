"""The keys of the keyboard that a scenario may bind (docs/reference/scenario.md, "Keys").

Names are those of Textual, the console's toolkit: `.` is `full_stop`. The engine does not import Textual, so they are
listed here. Keys that terminals, tmux, macOS or editors intercept or confuse are refused with the reason.
"""

from __future__ import annotations

from unicodedata import name as unicode_name

from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.base.nearest_name import Correction, suggest

PUNCTUATION = {
    "!": "exclamation_mark",
    '"': "quotation_mark",
    "#": "number_sign",
    "$": "dollar_sign",
    "%": "percent_sign",
    "&": "ampersand",
    "'": "apostrophe",
    "(": "left_parenthesis",
    ")": "right_parenthesis",
    "*": "asterisk",
    "+": "plus",
    ",": "comma",
    "-": "minus",
    ".": "full_stop",
    "/": "slash",
    ":": "colon",
    ";": "semicolon",
    "<": "less_than_sign",
    "=": "equals_sign",
    ">": "greater_than_sign",
    "?": "question_mark",
    "@": "at",
    "[": "left_square_bracket",
    "\\": "backslash",
    "]": "right_square_bracket",
    "^": "circumflex_accent",
    "_": "underscore",
    "`": "grave_accent",
    "{": "left_curly_bracket",
    "|": "vertical_line",
    "}": "right_curly_bracket",
    "~": "tilde",
}
"""ASCII punctuation and Textual's name for each character."""

CONSOLE_KEYS: dict[str, str] = {
    "f2": "the console",
    "f3": "the console",
    "f4": "the console",
    "f8": "the console",
    "f9": "stop-all",
    "ctrl+g": "stop-all",
    "ctrl+e": "repeating a failed act",
    "ctrl+k": "going on without a failed act",
    "ctrl+j": "the console",
    "ctrl+d": "jumping to a pane",
    "f7": "locking the keyboard",
    "ctrl+underscore": "locking the keyboard",
    "ctrl+t": "the say line",
    "ctrl+u": "undoing",
    "ctrl+x": "making the keys safe",
    "exclamation_mark": "marking a mistake",
    "comma": "the next filler",
    "ctrl+l": "the console",
    "ctrl+o": "the console",
    "ctrl+r": "the console",
    "ctrl+w": "stopping what the robot still does",
    "ctrl+y": "the console",
    "ctrl+c": "copying",
    "ctrl+q": "quitting",
    "question_mark": "help",
    "slash": "finding",
    "colon": "commands",
    "tab": "moving between panes",
    "shift+tab": "moving between panes",
    "enter": "choosing",
    "space": "the participant's cue",
    "underscore": "taking back the cue",
    "escape": "leaving",
    "backspace": "stopping what runs now",
    **dict.fromkeys(("up", "down", "left", "right", "home", "end", "pageup", "pagedown", "ctrl+n", "ctrl+p"), "moving"),
    **dict.fromkeys(("delete", "insert"), "editing"),
}
"""The keys that belong to the console, and their purpose."""

FREE_FUNCTION_KEYS = ("f5", "f6", "f12")
_ALIASES = {
    "esc": "escape",
    "return": "enter",
    "ins": "insert",
    "del": "delete",
    "page_up": "pageup",
    "page_down": "pagedown",
    "period": "full_stop",
    "dot": "full_stop",
    "hyphen": "minus",
    " ": "space",
}
_REFUSED = {
    "f1": "GNOME Terminal opens its help with F1",
    "f10": "terminals open their menu with F10",
    "f11": "terminals and macOS use F11 for the full screen",
    "ctrl+h": "terminals send the same for ctrl+h and backspace",
    "ctrl+i": "terminals send the same for ctrl+i and tab",
    "ctrl+m": "terminals send the same for ctrl+m and enter",
    "ctrl+left_square_bracket": "terminals send the same for ctrl+[ and escape",
    "ctrl+space": "terminals send a null character for ctrl+space, and input methods take it",
    "ctrl+a": "screen takes ctrl+a for its own commands",
    "ctrl+b": "tmux takes ctrl+b for its own commands",
    "ctrl+s": "terminals may freeze at ctrl+s",
    "ctrl+z": "ctrl+z suspends programs",
    "ctrl+q": "ctrl+q quits the console and thaws frozen terminals",
}
_SHIFTED = "write the character that the key types instead: `N`, `#`"


class KeyRefusedError(RiseError, ValueError):
    """A scenario cannot bind a key. `taken`: whether the console uses it."""

    def __init__(self, message: str, taken: bool = False, suggestion: Correction | None = None) -> None:
        """`suggestion`: the intended key; its words are added to the message."""
        super().__init__(message + (suggestion.words if suggestion else ""))
        self.taken = taken
        self.suggestion = suggestion and replace(suggestion, words="")


def bindable_key_name(written: str) -> str:
    """Textual's name of a key in an author's spelling: `1`, `n`, `N`, `.`, `full_stop`, `F5`, `ctrl+f`.

    Upper and lower case letters are different keys. Raises KeyRefusedError with the reason.
    """
    name = key_name(written)
    if name in CONSOLE_KEYS:
        raise KeyRefusedError(f"`{written}` belongs to the console ({CONSOLE_KEYS[name]})", taken=True)
    return name


def key_name(written: str) -> str:
    """Like `bindable_key_name`, but also for keys of the console. Raises KeyRefusedError with the reason."""
    if len(written) == 1:
        name = _character(written)
    else:
        *modifiers, base = written.split("+") if not written.endswith("++") else [*written[:-2].split("+"), "+"]
        name = _with_modifiers([modifier.strip().lower() for modifier in modifiers], base.strip(), written)
    if name in _REFUSED:
        raise KeyRefusedError(f"`{written}` cannot be used: {_REFUSED[name]}")
    return name


def _character(character: str) -> str:
    if character.isalnum():
        return character
    if character in PUNCTUATION:
        return PUNCTUATION[character]
    if character in _ALIASES:
        return _ALIASES[character]
    known = unicode_name(character, "")
    if not known or not character.isprintable():
        raise KeyRefusedError("a key is a letter, a digit, a punctuation mark or a name such as `f5`")
    return known.lower().replace("-", "_").replace(" ", "_")


def _with_modifiers(modifiers: list[str], base: str, written: str) -> str:
    name = _character(base) if len(base) == 1 else _ALIASES.get(base.lower(), base.lower())
    plain = not modifiers
    if plain and any(name in known for known in (PUNCTUATION.values(), CONSOLE_KEYS, FREE_FUNCTION_KEYS, _REFUSED)):
        return name
    unknown = [modifier for modifier in modifiers if modifier not in ("ctrl", "shift", "alt", "super", "meta", "cmd")]
    if unknown or plain or not base:
        known = (*PUNCTUATION.values(), *FREE_FUNCTION_KEYS, "ctrl+f")
        near = replace(suggest(written.lower(), known), written=written)
        raise KeyRefusedError(f"`{written}` is not the name of a key", suggestion=near)
    if modifiers == ["shift"] and name == "tab":
        return "shift+tab"
    if name == "enter":
        raise KeyRefusedError(f"`{written}` cannot be used: terminals send the same for it and enter")
    if {"super", "meta", "cmd"} & set(modifiers):
        raise KeyRefusedError(f"`{written}` cannot be used: the desktop takes it")
    if "alt" in modifiers:
        reason = (
            "terminals send characters of their own for it" if base.isdigit() else "macOS types a character with it"
        )
        raise KeyRefusedError(f"`{written}` cannot be used: {reason}, and a slow link takes it apart")
    if modifiers == ["shift"]:
        if len(base) == 1:
            raise KeyRefusedError(f"`{written}` is not a key of its own; {_SHIFTED}")
        raise KeyRefusedError(f"`{written}` cannot be used: not every terminal delivers it")
    if "shift" in modifiers:
        raise KeyRefusedError(f"`{written}` cannot be used: terminals send the same for it and ctrl+{base.lower()}")
    if len(base) == 1 and base.isdigit():
        raise KeyRefusedError(f"`{written}` cannot be used: terminals send the digit, another key or nothing")
    key = f"ctrl+{name.lower()}"
    if key in _REFUSED or key in CONSOLE_KEYS or (len(base) == 1 and base.isascii() and base.isalpha()):
        return key
    raise KeyRefusedError(f"`{written}` cannot be used: terminals do not deliver it reliably")
