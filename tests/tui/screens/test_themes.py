"""Themes: readable, told apart by everybody, and without a colour nothing is lost."""

from __future__ import annotations

import re
from itertools import combinations, product
from pathlib import Path

import pytest
from textual.color import Color
from textual.theme import Theme

import rise_tui
from rise_tui.cli.command_line import THEMES
from rise_tui.config.display import DetectedColors, DisplayOptions, choose_theme, detect_colors, prepare_textual
from rise_tui.rendering import themes
from rise_tui.widgets.lines import STYLE_SPECS
from tests.chance import searched
from tests.tui.conftest import Console, console
from tests.tui.fake import DEMO
from tests.tui.terminals import terminal

RGB = [each for each in themes.THEMES if not each.ansi]
GROUNDS = ("background", "surface", "panel", "rise-cursor", "rise-cursor-away", "rise-bar", "rise-bar-focused")
GROUNDS += ("rise-wait-ground", "rise-fault-ground")
TEXT, SIGN = 4.5, 3.0
"""Contrast that WCAG 2.2 asks of text, and of what is only to be made out."""


def color(look: Theme, name: str) -> Color:
    return Color.parse(look.variables.get(name) or getattr(look, name))


def luminance(shade: tuple[float, float, float]) -> float:
    red, green, blue = shade
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def linear(shade: Color) -> tuple[float, float, float]:
    parts = [part / 255 for part in shade.rgb]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return red, green, blue


def contrast(one: Color, other: Color) -> float:
    bright, dark = sorted((luminance(linear(one)), luminance(linear(other))), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("look", RGB, ids=lambda look: look.name)
def test_text_can_be_read_on_every_ground(look: Theme) -> None:
    for role, ground in product(STYLE_SPECS, GROUNDS):
        names = STYLE_SPECS[role]
        on = color(look, names.background or ground)
        found = contrast(color(look, names.color), on)
        assert found >= TEXT, f"{role} on {names.background or ground}: {found:.2f}"


@pytest.mark.parametrize("look", [each for each in themes.THEMES if each.ansi], ids=lambda look: look.name)
def test_nothing_has_the_colour_of_its_ground(look: Theme) -> None:
    """In 16 colours, NOT CONFIRMED was red on red: the stop panel seemed to say that all parts had confirmed."""
    for role, ground in product(STYLE_SPECS, GROUNDS):
        names = STYLE_SPECS[role]
        on, text = color(look, names.background or ground), color(look, names.color)
        assert on != text or on == Color.parse("ansi_default"), f"{role} on {names.background or ground}"


@pytest.mark.parametrize("name", themes.NAMES)
async def test_what_the_bars_paint_can_be_read(name: str) -> None:
    """What reaches the terminal: in 16 colours, a share of a colour is the whole colour."""
    async with console(theme=name) as it:
        it.client.act("Praise", "ABORTED", reason="the robot cannot")
        it.client.stop("latched", ("pepper/speech",), ("pepper/base",))
        bars = (it.bars.alarm_bar, it.bars.failure_bar)
        await it.until(lambda: "NOT CONFIRMED" in bars[0].text and bars[1].text)
        await it.pilot.pause(0.2)
        for bar in bars:
            for segment in (segment for y in range(bar.size.height) for segment in bar.render_line(y)):
                style = segment.style
                assert style is not None and style.color is not None and style.bgcolor is not None
                text, ground = style.color, style.bgcolor
                if text.triplet is not None and ground.triplet is not None:
                    assert contrast(Color(*text.triplet), Color(*ground.triplet)) >= TEXT, segment.text
                else:
                    assert text != ground or text.is_default, segment.text


# --- how others see ---------------------------------------------------------------------------------------------------

DICHROMAT = {
    "deuteranopia": ((0.29275, 0.70725, 0.0), (0.29275, 0.70725, 0.0), (-0.02234, 0.02234, 1.0)),
    "protanopia": ((0.11238, 0.88762, 0.0), (0.11238, 0.88762, 0.0), (0.00401, -0.00401, 1.0)),
    "tritanopia": ((1.25553, -0.07675, -0.17878), (-0.07841, 0.93081, 0.1476), (0.00473, 0.69137, 0.3039)),
}
"""Linear RGB as somebody without green or red cones (Viénot, Brettel and Mollon, 1999) or without blue ones (Machado,
Oliveira and Fernandes, 2009) sees it."""


def seen(shade: Color, eyes: str) -> tuple[float, float, float]:
    rgb = linear(shade)
    if eyes == "all cones":
        return rgb
    red, green, blue = (
        min(1.0, max(0.0, sum(factor * part for factor, part in zip(row, rgb, strict=True)))) for row in DICHROMAT[eyes]
    )
    return red, green, blue


def lab(shade: tuple[float, float, float]) -> tuple[float, float, float]:
    red, green, blue = shade
    x = (0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.9505
    y = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    z = (0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.089
    fx, fy, fz = (part ** (1 / 3) if part > 0.008856 else 7.787 * part + 16 / 116 for part in (x, y, z))
    return 116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)


def apart(one: Color, other: Color, eyes: str) -> float:
    """The distance of two colours (CIE76); 2.3 can just be told, 30 is plainly another colour."""
    return sum((a - b) ** 2 for a, b in zip(lab(seen(one, eyes)), lab(seen(other, eyes)), strict=True)) ** 0.5


@pytest.mark.parametrize("eyes", ["all cones", *DICHROMAT])
@pytest.mark.parametrize("look", RGB, ids=lambda look: look.name)
def test_states_keep_their_colours_apart_for_all_eyes(look: Theme, eyes: str) -> None:
    for one, other in combinations(("primary", "warning", "error", "foreground"), 2):
        found = apart(color(look, one), color(look, other), eyes)
        assert found >= (14 if look is themes.LIGHT else 29), f"{one} and {other}: {found:.0f}"


@pytest.mark.parametrize("look", RGB, ids=lambda look: look.name)
def test_the_focus_can_be_made_out(look: Theme) -> None:
    for ground in ("rise-cursor", "rise-bar-focused", "surface"):
        assert contrast(color(look, "primary"), color(look, ground)) >= SIGN


def test_the_simulation_would_see_red_and_green_alike() -> None:
    red, green = Color.parse("#d05050"), Color.parse("#709a20")
    assert apart(red, green, "all cones") > 60 > 25 > apart(red, green, "deuteranopia")


# --- without colour ---------------------------------------------------------------------------------------------------


async def main_screens(it: Console) -> str:
    """What can be read on the console in its main states, without any colour."""
    found = [it.text("acts"), it.text("rules")]
    running = it.client.act("Greet")
    it.client.act("Praise", "ABORTED", reason="the robot cannot")
    await it.until(lambda: "running" in it.row("acts", "Greet"))
    found += [it.text("acts"), it.text("log"), it.bars.status_line.text]
    it.client.end_task(running, "Greet")
    it.client.stop("latched", ("speech",), ("robot",))
    await it.until(lambda: it.screen.session.store.key_state == "STOPPED")
    await it.pilot.pause(0.2)
    found += [it.text("acts"), it.bars.alarm_bar.text]
    return "\n".join(found)


@pytest.mark.slow
async def test_every_state_is_a_word_and_a_glyph_in_every_theme() -> None:
    async with console(theme="mono") as it:
        assert it.app.theme == "rise-mono"
        read = await main_screens(it)
        for word in ("· ready", "running", "✗ failed", "✓ done", "STOPPED", "NOT CONFIRMED"):
            assert word in read, f"{word!r} is not in:\n{read}"
        for name in themes.NAMES:
            it.app.theme = f"rise-{name}"
            await it.pilot.pause()  # painted with it
            assert "STOPPED" in it.bars.alarm_bar.text


COLORED = re.compile(rb"\x1b\[(?:[0-9;]*;)?(?:3[0-8]|4[0-8]|9[0-7]|10[0-7])(?:;[0-9;]*)?m")
"""An escape sequence that sets a colour; 39 and 49 are the terminal's own."""


@pytest.mark.pty
@pytest.mark.parametrize(
    ("arguments", "environment", "colored"),
    [
        (("--theme", "mono"), {}, False),
        (("--colors", "mono"), {}, False),
        ((), {"NO_COLOR": "1"}, False),
        pytest.param((), {"NO_COLOR": ""}, True, marks=searched),
        (("--theme", "light"), {"NO_COLOR": "1"}, True),
        pytest.param((), {}, True, marks=searched),
    ],
)
def test_no_colour_reaches_a_terminal_that_shall_have_none(
    arguments: tuple[str, ...], environment: dict[str, str], colored: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    for variable, value in environment.items():
        monkeypatch.setenv(variable, value)
    with terminal("--config", DEMO, "--seed", "1", *arguments) as it:
        it.until("LIVE")
        sent = b""
        for key, shows in ((b"g", "running"), (b"?", "type to search"), (b"\x1b[20~", "STOP")):
            it.press(key)
            while shows.encode() not in it.shown:
                assert it.read(5.0)
            sent += it.shown
        assert bool(COLORED.search(sent)) is colored
        assert re.search(rb"\x1b\[(?:[0-9;]*;)?[147](?:;[0-9;]*)?m", sent), "there is no attribute either"


# --- what a terminal can show -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("display", "environment", "system", "looks"),
    [
        (DisplayOptions(), {"TERM": "xterm-256color", "COLORTERM": "truecolor"}, "truecolor", "dark"),
        (DisplayOptions(), {"TERM": "tmux-256color"}, "256", "dark"),
        (DisplayOptions(), {"TERM": "xterm-kitty"}, "256", "dark"),
        (DisplayOptions(), {"TERM": "linux"}, "16", "terminal"),
        (DisplayOptions(), {}, "16", "terminal"),
        (DisplayOptions(theme="light"), {"TERM": "linux"}, "16", "light"),
        (DisplayOptions(), {"TERM": "dumb"}, "mono", "mono"),
        (DisplayOptions(), {"TERM": "vt220", "COLORTERM": "truecolor"}, "mono", "mono"),
        (DisplayOptions(), {"TERM": "xterm-256color", "NO_COLOR": "1"}, "mono", "mono"),
        (DisplayOptions(theme="light"), {"TERM": "xterm-256color", "NO_COLOR": "1"}, "256", "light"),
        (
            DisplayOptions(colors="256"),
            {"TERM": "xterm-256color", "NO_COLOR": "1", "COLORTERM": "truecolor"},
            "256",
            "dark",
        ),
        (DisplayOptions(colors="truecolor"), {"TERM": "dumb"}, "truecolor", "dark"),
        (DisplayOptions(colors="mono"), {"COLORTERM": "truecolor"}, "mono", "mono"),
    ],
)
def test_what_the_terminal_shows(display: DisplayOptions, environment: dict[str, str], system: str, looks: str) -> None:
    found = detect_colors(display, environment)
    assert (found.system, choose_theme(display, found, "")) == (system, looks) and found.why


def test_the_theme_that_was_used_last_gives_way_to_the_command_line_and_to_few_colours() -> None:
    many, few, none = (DetectedColors(system, "") for system in ("truecolor", "16", "mono"))  # type: ignore[arg-type]
    assert choose_theme(DisplayOptions(), many, "light") == "light"
    assert choose_theme(DisplayOptions(theme="contrast"), many, "light") == "contrast"
    assert (
        choose_theme(DisplayOptions(), few, "light") == "terminal"
        and choose_theme(DisplayOptions(), few, "mono") == "mono"
    )
    assert choose_theme(DisplayOptions(), none, "light") == "mono"


def test_textual_is_told_by_its_environment() -> None:
    environment = {"TERM": "xterm-256color", "NO_COLOR": "1"}
    assert prepare_textual(DisplayOptions(fps=5), environment).system == "mono"
    assert environment == {
        "TERM": "xterm-256color",
        "TEXTUAL_ANIMATIONS": "none",
        "TEXTUAL_FPS": "5",
        "TEXTUAL_COLOR_SYSTEM": "standard",
    }


def test_the_command_line_has_every_theme() -> None:
    assert THEMES == themes.NAMES


def test_no_colour_stands_anywhere_else() -> None:
    folder = Path(rise_tui.__file__).parent
    literal = re.compile(r"#[0-9a-fA-F]{6}\b|(?:color|background): *(?:ansi_|red|green|blue|white|black|yellow)")
    found = [
        f"{file.relative_to(folder)}: {line.strip()}"
        for file in sorted(folder.rglob("*.py"))
        if file.name not in ("themes.py", "keycard.py") and file.parent.name != "web"
        for line in file.read_text(encoding="utf-8").splitlines()
        if literal.search(line)
    ]
    assert found == []
