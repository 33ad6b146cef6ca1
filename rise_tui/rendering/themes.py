"""The themes and their own settings: colours, and attributes for roles and backgrounds without a colour.

There is one accent. Red (orange where red and green look alike) is only for stop and faults, amber for waiting. Words
repeat the meaning of each colour, so `mono` loses nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from textual.theme import Theme

ATTRIBUTES: Mapping[str, str] = MappingProxyType(
    {
        "strong": "bold",
        "accent": "bold",
        "alarm": "bold",
        "call": "bold",
        "match": "bold underline",
        **dict.fromkeys(("plain", "muted", "key", "wait", "fault"), "none"),
        **dict.fromkeys(("cursor", "cursor-away", "bar", "bar-focused", "selection"), "none"),
        "chosen": "bold",
    }
)
"""The attributes of roles and backgrounds besides their colours. A theme variable `rise-<name>-style` changes one."""

CSS = """
TitleBar { text-style: $rise-bar-style; }
TitleBar.-focused { text-style: $rise-bar-focused-style; }
Input > .input--selection { text-style: $rise-selection-style; }
Input > .input--cursor {
    background: $input-cursor-background; color: $input-cursor-foreground; text-style: $input-cursor-text-style;
}
SettingsScreen Button.-chosen { text-style: $rise-chosen-style; }
"""
"""Styles on backgrounds that only some themes have a colour for. (Textual's own cursor, in themes on the terminal's
background, is white on black.)"""


def _style_variables(names: Mapping[str, str]) -> dict[str, str]:
    return {f"rise-{name}-style": style for name, style in names.items()}


def _colored_theme(
    name: str,
    *,
    dark: bool,
    text: str,
    muted: str,
    accent: str,
    wait: str,
    fault: str,
    on_alarm: str,
    grounds: tuple[str, str, str],
    cursor: str,
    cursor_away: str,
    bar: str,
    bar_focused: str,
    scrollbar: str,
    selection: str,
) -> Theme:
    """A theme of RGB colours. `grounds`: the backgrounds of the screen, of the panes on it, and of dialogs."""
    background, surface, panel = grounds
    return Theme(
        name=f"rise-{name}",
        dark=dark,
        primary=accent,
        secondary=accent,
        accent=accent,
        foreground=text,
        background=background,
        surface=surface,
        panel=panel,
        success=text,
        warning=wait,
        error=fault,
        variables={
            "rise-muted": muted,
            "rise-cursor": cursor,
            "rise-cursor-away": cursor_away,
            "rise-on-alarm": on_alarm,
            "rise-bar": bar,
            "rise-bar-focused": bar_focused,
            "input-cursor-background": accent,
            "input-selection-background": selection,
            "scrollbar": scrollbar,
            "scrollbar-background": background,
            "scrollbar-background-hover": background,
            **_style_variables(ATTRIBUTES),
        },
    )


DARK = _colored_theme(
    "dark",
    dark=True,
    text="#d7dce2",
    muted="#8b95a3",
    accent="#8ab4f8",
    wait="#e5b567",
    fault="#ff7d7d",
    on_alarm="#1a0505",
    grounds=("#12151a", "#181c22", "#222831"),
    cursor="#29374d",
    cursor_away="#20262f",
    bar="#1d232b",
    bar_focused="#223852",
    scrollbar="#39424e",
    selection="#8ab4f8 35%",
)

LIGHT = _colored_theme(
    "light",
    dark=False,
    text="#1f242b",
    muted="#5c6570",
    accent="#1b57b0",
    wait="#7a4900",
    fault="#b3161b",
    on_alarm="#ffffff",
    grounds=("#fbfbf9", "#f3f3ef", "#e8e8e2"),
    cursor="#cfe0f7",
    cursor_away="#e6e9ec",
    bar="#e9eaea",
    bar_focused="#bcd3f2",
    scrollbar="#b9bfc6",
    selection="#1b57b0 30%",
)

CONTRAST = _colored_theme(
    "contrast",
    dark=True,
    text="#ffffff",
    muted="#c8c8c8",
    accent="#6cd4ff",
    wait="#ffd24a",
    fault="#ff8c8c",
    on_alarm="#000000",
    grounds=("#000000", "#000000", "#1a1a1a"),
    cursor="#003d66",
    cursor_away="#2b2b2b",
    bar="#262626",
    bar_focused="#00436e",
    scrollbar="#8a8a8a",
    selection="#6cd4ff 45%",
)

COLORBLIND = _colored_theme(
    "colorblind",
    dark=True,
    text="#e4e6e8",
    muted="#98a0a8",
    accent="#6fbaf2",
    wait="#faf29a",
    fault="#ff8528",
    on_alarm="#140a00",
    grounds=("#101418", "#171c21", "#20272e"),
    cursor="#1f3a55",
    cursor_away="#1f262d",
    bar="#1c2229",
    bar_focused="#163650",
    scrollbar="#3a444e",
    selection="#6fbaf2 35%",
)
"""Blue, yellow and orange, which everybody can tell apart: no two of them differ only in red and green."""


def _uncolored_theme(name: str, wait: str, fault: str, on_alarm: str, styles: Mapping[str, str]) -> Theme:
    """A theme on the terminal's own background."""
    own = "ansi_default"
    grounds = ("cursor", "cursor-away", "bar", "bar-focused")
    widgets = (
        *("surface", "panel", "boost", "ansi-background", "ansi-foreground"),
        *("border", "border-blurred", "block-cursor-foreground", "block-cursor-background", "foreground-muted"),
        *("block-cursor-blurred-foreground", "block-cursor-blurred-background", "block-hover-background"),
        *("input-cursor-background", "input-cursor-foreground", "input-selection-background"),
        *("input-selection-foreground", "scrollbar", "scrollbar-hover", "scrollbar-active", "scrollbar-background"),
        *("scrollbar-background-hover", "scrollbar-background-active", "scrollbar-corner-color", "text-muted"),
        *("button-foreground", "button-color-foreground", "surface-active", "text-disabled", "text"),
    )
    return Theme(
        name=f"rise-{name}",
        dark=True,
        ansi=True,
        warning=wait,
        error=fault,
        primary=own,
        secondary=own,
        accent=own,
        foreground=own,
        background=own,
        success=own,
        variables={
            "rise-muted": own,
            "rise-on-alarm": on_alarm,
            **{f"rise-{ground}": own for ground in grounds},
            **dict.fromkeys(widgets, own),
            "block-cursor-text-style": "bold reverse",
            "block-cursor-blurred-text-style": "underline",
            "input-cursor-text-style": "reverse",
            "button-focus-text-style": "bold reverse",
            **_style_variables({**ATTRIBUTES, **styles}),
        },
    )


_PLAIN = {
    "muted": "dim",
    "key": "bold",
    "accent": "bold",
    "cursor": "reverse",
    "cursor-away": "underline",
    "bar": "underline",
    "bar-focused": "bold underline reverse",
    "selection": "reverse",
    "chosen": "bold reverse",
}

MONO = _uncolored_theme(
    "mono",
    "ansi_default",
    "ansi_default",
    "ansi_default",
    {**_PLAIN, "wait": "underline", "fault": "bold underline", "alarm": "bold reverse", "call": "bold reverse"},
)
"""No colours at all, on the terminal's own background."""

TERMINAL = _uncolored_theme(
    "terminal",
    "ansi_magenta",
    "ansi_red",
    "ansi_bright_white",
    {**_PLAIN, "wait": "bold", "fault": "bold"},
)
"""The terminal's own colours. Waiting is magenta: of the sixteen colours, only magenta and red are readable on white
and on black."""

THEMES = (DARK, LIGHT, CONTRAST, COLORBLIND, MONO, TERMINAL)
WHITE, BLACK = "#ffffff", "#000000"
"""The colours of a mark for cameras in every theme: the strongest contrast that a terminal can show."""
NAMES = tuple(theme.name.removeprefix("rise-") for theme in THEMES)
"""The names for the command line: dark, light, contrast, colorblind, mono, terminal."""
DEFAULT = "dark"


def full_name(name: str) -> str:
    """Textual's name for one of our themes."""
    return f"rise-{name}" if name in NAMES else name


def short_name(name: str) -> str:
    """The reverse of `full_name`."""
    return name.removeprefix("rise-")
