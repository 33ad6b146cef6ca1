"""SVG drawings that are embedded in a page: no URL, no script, no separate file.

Colours and fonts come from the page's style sheet by class, so that drawings follow light, dark and print.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape as escape_html

from rise_engine.base.text import clean

_ADDRESSES = re.compile(r"http|url\(", re.IGNORECASE)


def escape(text: str) -> str:
    """Escape a text for an element or an attribute. Invisible characters are marked, all others read the same.

    >>> escape("<b>see http://x</b>")
    '&lt;b&gt;see &#104;ttp://x&lt;/b&gt;'
    """
    safe = escape_html(clean(text), quote=True)
    return _ADDRESSES.sub(lambda found: f"&#{ord(found[0][0])};{found[0][1:]}", safe)


def element(tag: str, inner: str = "", **attributes: str) -> str:
    """Write an element.

    :param tag: its name.
    :param inner: markup made by this module.
    :param attributes: texts by name; `class_` is `class`, `_` becomes `-`, empty ones are left out.
    """
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"' for name, value in attributes.items() if value
    )
    return f"<{tag}{given}>{inner}</{tag}>"


class Drawing:
    """A drawing. Later marks lie over earlier ones."""

    def __init__(self, width: float, height: float, title: str, description: str = "", *, name: str) -> None:
        """
        :param width: in units, which are pixels on a screen as wide as the drawing.
        :param height: in the same units.
        :param title: a title for people who cannot see it.
        :param description: its content in one or a few sentences.
        :param name: its kind, for the style sheet.
        """
        self.width, self.height, self.title, self.description, self.name = width, height, title, description, name
        self._marks: list[str] = []

    def box(self, x: float, y: float, width: float, height: float, kind: str, hover: str = "") -> None:
        """Draw a filled rectangle. Browsers show `hover` under the pointer."""
        self._add("rect", hover, x=x, y=y, width=max(0.0, width), height=max(0.0, height), class_=kind)

    def line(self, x1: float, y1: float, x2: float, y2: float, kind: str, hover: str = "") -> None:
        self._add("line", hover, x1=x1, y1=y1, x2=x2, y2=y2, class_=kind)

    def dot(self, x: float, y: float, radius: float, kind: str, hover: str = "") -> None:
        self._add("circle", hover, cx=x, cy=y, r=radius, class_=kind)

    def path(self, points: Iterable[tuple[float, float]], kind: str) -> None:
        """Draw a line through points."""
        steps = " ".join(f"{'L' if at else 'M'}{_number(x)} {_number(y)}" for at, (x, y) in enumerate(points))
        self._add("path", "", d=steps, class_=kind)

    def text(self, x: float, y: float, text: str, kind: str = "", anchor: str = "start") -> None:
        """Write a text whose base line begins (`start`), ends (`end`) or has its middle (`middle`) there."""
        self._marks.append(element("text", escape(text), x=_number(x), y=_number(y), class_=kind, text_anchor=anchor))

    def whole(self) -> str:
        """Return the `<svg>` element."""
        head = f"<title>{escape(self.title)}</title>"
        head += f"<desc>{escape(self.description)}</desc>" if self.description else ""
        return element(
            "svg",
            head + "\n" + "\n".join(self._marks) + "\n",
            viewBox=f"0 0 {_number(self.width)} {_number(self.height)}",
            role="img",
            aria_label=self.title,
            class_=self.name,
        )

    def _add(self, tag: str, hover: str, **attributes: str | float) -> None:
        inner = f"<title>{escape(hover)}</title>" if hover else ""
        given = {name: value if isinstance(value, str) else _number(value) for name, value in attributes.items()}
        self._marks.append(element(tag, inner, **given))


def _number(value: float) -> str:
    """Write a coordinate to a hundredth of a unit."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
