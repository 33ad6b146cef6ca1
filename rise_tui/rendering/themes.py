"""The themes and their own settings: colours, and attributes for roles and backgrounds without a colour.

There is one accent. Red (orange or violet where red and green look alike) is only for stop and faults, amber for
waiting. Words repeat the meaning of each colour, so `mono` loses nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from textual.color import Color
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


_COLORED = ("dark", "light", "contrast", "colorblind", "colorblind-light")
_COLORS = {
    "text": ("#d7dce2", "#1f242b", "#ffffff", "#e4e6e8", "#1f242b"),
    "muted": ("#99a2af", "#505862", "#c8c8c8", "#a0a7af", "#505862"),
    "accent": ("#7fb2f5", "#1b4fb0", "#6cd4ff", "#6fbaf2", "#053cc6"),
    "wait": ("#e8c456", "#6b5600", "#ffd24a", "#f2c70f", "#665021"),
    "fault": ("#fa7b80", "#7d0514", "#ff8c8c", "#f98046", "#810a7d"),
    "on-alarm": ("#1a0505", "#ffffff", "#000000", "#140a00", "#ffffff"),
    "background": ("#12151a", "#fbfbf9", "#000000", "#101418", "#fbfbf9"),
    "surface": ("#181c22", "#f3f3ef", "#000000", "#171c21", "#f3f3ef"),
    "panel": ("#222831", "#e8e8e2", "#1a1a1a", "#20272e", "#e8e8e2"),
    "cursor": ("#29374d", "#cfe0f7", "#003d66", "#1f3a55", "#cfe0f7"),
    "cursor-away": ("#20262f", "#e6e9ec", "#2b2b2b", "#1f262d", "#e6e9ec"),
    "bar": ("#1d232b", "#e9eaea", "#262626", "#1c2229", "#e9eaea"),
    "bar-focused": ("#223852", "#bcd3f2", "#00436e", "#163650", "#bcd3f2"),
    "scrollbar": ("#39424e", "#b9bfc6", "#8a8a8a", "#3a444e", "#b9bfc6"),
    "selection": ("#7fb2f5 35%", "#1b4fb0 30%", "#6cd4ff 45%", "#6fbaf2 35%", "#053cc6 30%"),
}
"""The colours of these themes. `background`, `surface`, `panel`: behind the screen, the panes on it, and dialogs.

No two of accent, waiting and fault differ only in red and green. `light` is the weakest for eyes that see few colours:
on a light ground, red must be dark. `colorblind-light` has violet instead.
"""


def _colored_theme(name: str) -> Theme:
    """A theme of RGB colours."""
    colors = {role: each[_COLORED.index(name)] for role, each in _COLORS.items()}
    text, accent, background = colors["text"], colors["accent"], colors["background"]
    return Theme(
        name=f"rise-{name}",
        dark=not name.endswith("light"),
        primary=accent,
        secondary=accent,
        accent=accent,
        foreground=text,
        background=background,
        surface=colors["surface"],
        panel=colors["panel"],
        success=text,
        warning=colors["wait"],
        error=colors["fault"],
        variables={
            **{f"rise-{role}": colors[role] for role in _OWN},
            "rise-wait-ground": _tinted(background, colors["wait"]),
            "rise-fault-ground": _tinted(background, colors["fault"]),
            "input-cursor-background": accent,
            "input-selection-background": colors["selection"],
            "scrollbar": colors["scrollbar"],
            "scrollbar-background": background,
            "scrollbar-background-hover": background,
            **_style_variables(ATTRIBUTES),
        },
    )


_OWN = ("muted", "cursor", "cursor-away", "on-alarm", "bar", "bar-focused")
"""The colours that only our own widgets use."""


def _tinted(background: str, color: str) -> str:
    """The ground of a bar that reports something: a little of its colour."""
    return Color.parse(background).blend(Color.parse(color), 0.18).hex


DARK, LIGHT, CONTRAST, COLORBLIND, COLORBLIND_LIGHT = map(_colored_theme, _COLORED)


def _uncolored_theme(name: str, wait: str, fault: str, on_alarm: str, styles: Mapping[str, str]) -> Theme:
    """A theme on the terminal's own background."""
    own = "ansi_default"
    grounds = ("cursor", "cursor-away", "bar", "bar-focused", "wait-ground", "fault-ground")
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

THEMES = (DARK, LIGHT, CONTRAST, COLORBLIND, COLORBLIND_LIGHT, MONO, TERMINAL)
WHITE, BLACK = "#ffffff", "#000000"
"""The colours of a mark for cameras in every theme: the strongest contrast of a terminal."""
NAMES = tuple(theme.name.removeprefix("rise-") for theme in THEMES)
"""The names for the command line."""
DEFAULT = "dark"


def full_name(name: str) -> str:
    """Textual's name for one of our themes."""
    return f"rise-{name}" if name in NAMES else name


def short_name(name: str) -> str:
    """The reverse of `full_name`."""
    return name.removeprefix("rise-")
