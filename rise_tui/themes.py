"""The themes. One accent; red only for stop and faults; amber for waiting. Colours stand nowhere else."""

from __future__ import annotations

from textual.theme import Theme

DARK = Theme(
    name="rise-dark",
    dark=True,
    primary="#8ab4f8",
    secondary="#8ab4f8",
    accent="#8ab4f8",
    foreground="#d7dce2",
    background="#12151a",
    surface="#181c22",
    panel="#222831",
    success="#d7dce2",
    warning="#e5b567",
    error="#ff6b6b",
    variables={
        "rise-muted": "#8b95a3",
        "rise-cursor": "#2c3b52",
        "rise-cursor-away": "#20262f",
        "rise-on-alarm": "#1a0505",
        "rise-bar": "#1d232b",
        "rise-bar-focused": "#27405f",
        "input-cursor-background": "#8ab4f8",
        "input-selection-background": "#8ab4f8 35%",
        "scrollbar": "#39424e",
        "scrollbar-background": "#12151a",
        "scrollbar-background-hover": "#12151a",
    },
)

LIGHT = Theme(
    name="rise-light",
    dark=False,
    primary="#1b57b0",
    secondary="#1b57b0",
    accent="#1b57b0",
    foreground="#1f242b",
    background="#fbfbf9",
    surface="#f3f3ef",
    panel="#e8e8e2",
    success="#1f242b",
    warning="#8a5200",
    error="#b3161b",
    variables={
        "rise-muted": "#5c6570",
        "rise-cursor": "#cfe0f7",
        "rise-cursor-away": "#e6e9ec",
        "rise-on-alarm": "#ffffff",
        "rise-bar": "#e9eaea",
        "rise-bar-focused": "#bcd3f2",
        "input-cursor-background": "#1b57b0",
        "input-selection-background": "#1b57b0 30%",
        "scrollbar": "#b9bfc6",
        "scrollbar-background": "#fbfbf9",
        "scrollbar-background-hover": "#fbfbf9",
    },
)

CONTRAST = Theme(
    name="rise-contrast",
    dark=True,
    primary="#6cd4ff",
    secondary="#6cd4ff",
    accent="#6cd4ff",
    foreground="#ffffff",
    background="#000000",
    surface="#000000",
    panel="#1a1a1a",
    success="#ffffff",
    warning="#ffd24a",
    error="#ff7d7d",
    variables={
        "rise-muted": "#c8c8c8",
        "rise-cursor": "#003d66",
        "rise-cursor-away": "#2b2b2b",
        "rise-on-alarm": "#000000",
        "rise-bar": "#262626",
        "rise-bar-focused": "#005a94",
        "input-cursor-background": "#ffffff",
        "input-selection-background": "#6cd4ff 45%",
        "scrollbar": "#8a8a8a",
        "scrollbar-background": "#000000",
        "scrollbar-background-hover": "#000000",
    },
)

THEMES = (DARK, LIGHT, CONTRAST)
NAMES = tuple(theme.name.removeprefix("rise-") for theme in THEMES)
"""As the command line has them: dark, light, contrast."""
DEFAULT = "dark"


def full_name(name: str) -> str:
    """The name under which Textual knows a theme of ours."""
    return f"rise-{name}" if name in NAMES else name
