"""How this terminal shows the console: colours, mouse, frames. Pure except for `prepare_textual`; without Textual.

Textual reads these decisions from the environment when it is imported.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, MutableMapping
from typing import Literal, NamedTuple, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

ColorSystem: TypeAlias = Literal["truecolor", "256", "16", "mono"]

MAX_FRAMES = 60
DEFAULT_FRAMES = 15
"""Frames a second, enough for a screen that is not filmed. A key still shows immediately."""

_RICH_NAMES: dict[ColorSystem, str] = {"truecolor": "truecolor", "256": "256", "16": "standard", "mono": "standard"}
_COLORLESS_TERMINALS = ("dumb", "vt52", "vt100", "vt102", "vt220", "vt320", "unknown")


class DisplayOptions(Struct, frozen=True):
    """The options of the command line for the display."""

    theme: str = ""
    """Empty: the last used one."""
    colors: str = "auto"
    mouse: bool = True
    fps: int = DEFAULT_FRAMES


class DetectedColors(NamedTuple):
    """The colours in use, and the reason."""

    system: ColorSystem
    why: str


def detect_colors(display: DisplayOptions, environment: Mapping[str, str]) -> DetectedColors:
    """Detect the colours of this terminal: from the command line, then NO_COLOR, then the terminal's report.

    A terminal that reports nothing gets sixteen colours, because they work on every colour terminal.
    """
    if display.colors in _RICH_NAMES:
        return DetectedColors(display.colors, f"--colors {display.colors}")
    if display.theme == "mono":
        return DetectedColors("mono", "--theme mono")
    if environment.get("NO_COLOR") and not display.theme:
        return DetectedColors("mono", "NO_COLOR is set")
    terminal = environment.get("TERM", "").strip().lower()
    direct = environment.get("COLORTERM", "").strip().lower()
    if terminal in _COLORLESS_TERMINALS:
        return DetectedColors("mono", f"TERM={terminal}")
    if direct in ("truecolor", "24bit"):
        return DetectedColors("truecolor", f"COLORTERM={direct}")
    if terminal.endswith("-direct"):
        return DetectedColors("truecolor", f"TERM={terminal}")
    if "256color" in terminal or terminal in ("xterm-kitty", "alacritty", "foot", "xterm-ghostty", "wezterm"):
        return DetectedColors("256", f"TERM={terminal}, and COLORTERM does not say truecolor")
    return DetectedColors("16", f"TERM={terminal or '(not set)'} does not say that there are more")


def with_detected_colors(display: DisplayOptions, environment: Mapping[str, str]) -> DisplayOptions:
    """Replace `auto` by the detected colours. Only once: `prepare_textual` removes part of the detection's input."""
    return replace(display, colors=detect_colors(display, environment).system)


def choose_theme(display: DisplayOptions, detected: DetectedColors, remembered: str) -> str:
    """Return the theme's name: from the command line, or as the colours allow, or the last used one."""
    if detected.system == "mono":
        return "mono"
    if display.theme:
        return display.theme
    if detected.system == "16" and remembered not in ("terminal", "mono"):
        return "terminal"  # all others need more colours
    return remembered or "dark"


def prepare_textual(display: DisplayOptions, environment: MutableMapping[str, str] = os.environ) -> DetectedColors:
    """Set the environment that Textual reads on import. Animations are off, because they load the link too much."""
    detected = detect_colors(display, environment)
    environment.setdefault("TEXTUAL_ANIMATIONS", "none")
    environment["TEXTUAL_FPS"] = str(display.fps)
    environment["TEXTUAL_COLOR_SYSTEM"] = _RICH_NAMES[detected.system]
    environment.pop("NO_COLOR", None)  # the theme handles it; Textual would make the terminal's colours grey
    return detected
