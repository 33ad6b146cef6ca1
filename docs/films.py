"""Films of the tutorials: `.venv/bin/python docs/films.py [NAME]`.

A tutorial is played on a terminal of 80 by 24 as in the tests. The keys come from its own page or from its file in
`KEYS`. The screen after each step becomes a frame. Each film is written twice: as an animated SVG for any browser, and
as an asciicast (https://docs.asciinema.org/manual/asciicast/v2/) for players that can pause.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from pyte.screens import Char

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.tutorials.player import Step, play
from tests.tutorials.shell import shell

FOLDER = Path(__file__).parent
IMAGES = FOLDER / "images"
KEYS = {"greeting-from-nothing": FOLDER.parent / "tests" / "tutorials" / "greeting.md"}
"""Pages whose keys are in another file."""
SIZE = (80, 24)
SECONDS = {"key": 1.0, "typed": 1.4, "seen": 1.6, "gone": 0.4, "command": 1.6}
"""Seconds for which the screen is shown after a step."""
LAST = 4.0
NOT_FILMED, FILMED = "<!-- not filmed -->", "<!-- filmed -->"
"""Lines of a page between which a film would only repeat itself."""
WIDTH, HEIGHT = 8.4, 17.0
"""The size of a cell, in pixels."""
FOREGROUND, BACKGROUND = "#d8dee9", "#101418"
NAMED = {
    "black": "#101418", "red": "#bf616a", "green": "#a3be8c", "brown": "#ebcb8b", "blue": "#81a1c1",
    "magenta": "#b48ead", "cyan": "#88c0d0", "white": "#e5e9f0",
}  # fmt: skip


@dataclass(frozen=True)
class Frame:
    """The contents of a terminal, and its seconds."""

    cells: tuple[tuple[Char, ...], ...]
    seconds: float


def colour(name: str, otherwise: str) -> str:
    if name == "default":
        return otherwise
    return NAMED.get(name.removeprefix("bright"), f"#{name}" if len(name) == 6 else otherwise)


def look(char: Char) -> tuple[str, str, bool, bool, bool]:
    """Foreground, background, bold, italics, underscore."""
    front, back = colour(char.fg, FOREGROUND), colour(char.bg, BACKGROUND)
    if char.reverse:
        front, back = back, front
    return front, back, char.bold, char.italics, char.underscore


def runs(row: Sequence[Char]) -> list[tuple[int, str, tuple[str, str, bool, bool, bool]]]:
    """Cells with the same look: first column, text, look."""
    found: list[tuple[int, str, tuple[str, str, bool, bool, bool]]] = []
    for column, char in enumerate(row):
        if found and found[-1][2] == look(char) and found[-1][0] + len(found[-1][1]) == column:
            found[-1] = (found[-1][0], found[-1][1] + (char.data or " "), found[-1][2])
        else:
            found.append((column, char.data or " ", look(char)))
    return found


def row_svg(row: Sequence[Char], y: float) -> str:
    """One line of a terminal."""
    parts = []
    for column, text, (front, back, bold, italics, underscore) in runs(row):
        x, width = column * WIDTH, len(text) * WIDTH
        if back != BACKGROUND:
            parts.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{HEIGHT}" fill="{back}"/>')
        if text.strip():
            more = ' font-weight="bold"' if bold else ""
            more += ' font-style="italic"' if italics else ""
            more += ' text-decoration="underline"' if underscore else ""
            length = len(text.rstrip()) * WIDTH
            parts.append(
                f'<text x="{x:.1f}" y="{y + 13:.1f}" fill="{front}" textLength="{length:.1f}" '
                f'lengthAdjust="spacingAndGlyphs"{more}>{escape(text.rstrip())}</text>'
            )
    return "".join(parts)


def svg(frames: Sequence[Frame], title: str) -> str:
    """A film as one SVG, which shows its frames in an endless loop. Repeated rows are defined once."""
    total = sum(frame.seconds for frame in frames)
    columns, rows = SIZE
    width, height = columns * WIDTH + 16, rows * HEIGHT + 16
    known: dict[str, str] = {}
    shown, styles, at = [], [], 0.0
    for number, frame in enumerate(frames):
        uses = []
        for index, row in enumerate(frame.cells):
            drawn = row_svg(row, 0)
            if drawn:
                name = known.setdefault(drawn, f"r{len(known)}")
                uses.append(f'<use href="#{name}" y="{index * HEIGHT:.0f}"/>')
        shown.append(f'<g class="f" style="animation-name:f{number}">{"".join(uses)}</g>')
        begin, end = 100 * at / total, 100 * (at + frame.seconds) / total
        at += frame.seconds
        before = f"0%,{begin:.3f}%{{visibility:hidden}}" if number else ""
        styles.append(f"@keyframes f{number}{{{before}{begin:.3f}%,{end:.3f}%{{visibility:visible}}")
        styles.append(f"{min(end + 0.001, 100):.3f}%,100%{{visibility:hidden}}}}" if end < 99.999 else "}")
    definitions = "".join(f'<g id="{name}">{drawn}</g>' for drawn, name in known.items())
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        'xml:space="preserve">'
        f"<title>{escape(title)}</title>"
        f"<style>text{{font:14px 'DejaVu Sans Mono',Menlo,Consolas,monospace;white-space:pre}}"
        f".f{{visibility:hidden;animation:{total:.1f}s step-end infinite}}{''.join(styles)}</style>"
        f'<defs>{definitions}</defs><rect width="100%" height="100%" rx="6" fill="{BACKGROUND}"/>'
        f'<g transform="translate(8 8)">{"".join(shown)}</g></svg>\n'
    )


def ansi(row: Sequence[Char]) -> str:
    """One line of a terminal with its escape sequences."""
    pieces = []
    for _, text, (front, back, bold, italics, underscore) in runs(row):
        codes = ["0"] + ["1"] * bold + ["3"] * italics + ["4"] * underscore
        for kind, name in (("38", front), ("48", back)):
            red, green, blue = (int(name[at : at + 2], 16) for at in (1, 3, 5))
            codes.append(f"{kind};2;{red};{green};{blue}")
        pieces.append(f"\x1b[{';'.join(codes)}m{text}")
    return "".join(pieces)


def asciicast(frames: Sequence[Frame], title: str) -> str:
    """A film in asciinema's format: for each frame the rows that differ from the previous one."""
    columns, rows = SIZE
    lines = [json.dumps({"version": 2, "width": columns, "height": rows, "title": title})]
    at, before = 0.0, [""] * rows
    for frame in frames:
        now = [ansi(row) for row in frame.cells]
        painted = "".join(
            f"\x1b[{number};1H{row}" for number, (row, was) in enumerate(zip(now, before, strict=True), 1) if row != was
        )
        lines.append(json.dumps([round(at, 2), "o", f"\x1b[?25l{painted}"], ensure_ascii=False))
        at, before = at + frame.seconds, now
    lines.append(json.dumps([round(at, 2), "o", ""]))
    return "\n".join(lines) + "\n"


def left_out(page: str) -> set[int]:
    """The lines of a page that are played but not filmed: from `<!-- not filmed -->` to `<!-- filmed -->`."""
    found, is_out = set(), False
    for number, line in enumerate(page.splitlines(), 1):
        is_out = (is_out or line.strip() == NOT_FILMED) and line.strip() != FILMED
        if is_out:
            found.add(number)
    return found


def film(page: Path) -> list[Frame]:
    """Play a tutorial, and take a picture after each step."""
    frames: list[Frame] = []
    out = left_out(page.read_text(encoding="utf-8"))

    with TemporaryDirectory() as folder, shell(Path(folder), SIZE) as terminal:

        def take(step: Step) -> None:
            if step.line in out:
                return
            cells = tuple(tuple(row) for row in terminal.cells)
            if frames and frames[-1].cells == cells:
                frames[-1] = Frame(cells, frames[-1].seconds + SECONDS[step.kind] / 2)
            else:
                frames.append(Frame(cells, SECONDS[step.kind]))

        play(page.read_text(encoding="utf-8"), terminal, take)
    frames[-1] = Frame(frames[-1].cells, LAST)
    return frames


def main(names: Sequence[str]) -> None:
    for page in sorted((FOLDER / "tutorials").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if f"{page.stem}.svg" not in text or (names and page.stem not in names):
            continue
        title = text.partition("\n")[0].removeprefix("# ")
        frames = film(KEYS.get(page.stem, page))
        (IMAGES / f"{page.stem}.svg").write_text(svg(frames, title), encoding="utf-8")
        (IMAGES / f"{page.stem}.cast").write_text(asciicast(frames, title), encoding="utf-8")
        print(f"{page.stem}: {len(frames)} frames, {sum(frame.seconds for frame in frames):.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
