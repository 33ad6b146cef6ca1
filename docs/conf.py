"""The documentation as a site: `./dev docs`.

The pages are plain Markdown, which GitHub also shows; no part of them is for Sphinx alone. The order of the pages comes
from docs/README.md.

The site includes everything that a page loads, so that it can be read and searched from a disk without a network.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
INDEX = "docs/README"
_SECTION = re.compile(r"^\*\*(?P<title>[^*]+)\*\*")
_LINK = re.compile(r"\]\((?P<target>[^)#\s]+\.md)(?:#[^)]*)?\)")

project = "rise-tui"
author = "the rise-tui authors"
root_doc = INDEX
extensions = ["myst_parser"]
include_patterns = [
    "docs/*.md",
    "docs/**/*.md",
    "scenarios/*/README.md",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
]
exclude_patterns = [".*", "build", "dist", "**/__pycache__"]
suppress_warnings = ["myst.header", "toc.not_included", "misc.highlighting_failure"]
"""Pages that the index does not list (decisions) are linked from others; only GitHub draws `mermaid`."""
myst_heading_anchors = 4
myst_fence_as_directive: list[str] = []

html_theme = "furo"
html_title = "rise-tui"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
templates_path: list[str] = []
pygments_style = "default"
pygments_dark_style = "monokai"


def pages_by_section(index: str) -> list[tuple[str, list[str]]]:
    """The sections of the index with their pages, for the site's side bar.

    >>> pages_by_section("**How-to guides** get one thing done.\\n- [Be the wizard](how-to/wizard.md): before\\n")
    [('How-to guides', ['how-to/wizard'])]
    """
    sections: list[tuple[str, list[str]]] = []
    known: set[str] = set()
    for line in index.splitlines():
        if (section := _SECTION.match(line)) is not None:
            sections.append((section["title"].rstrip("?:"), []))
        if line.startswith("- ") and sections:
            for link in _LINK.finditer(line):
                page = link["target"].removesuffix(".md")
                if page not in known:
                    known.add(page)
                    sections[-1][1].append(page)
    return [(title, pages) for title, pages in sections if pages]


def add_navigation(app: Any, name: str, content: list[str]) -> None:
    """Append the side bar to the index: Sphinx requires every page in a tree."""
    if name != INDEX:
        return
    for title, pages in pages_by_section(content[0]):
        entries = "\n".join(os.path.normpath(f"/docs/{page}") for page in pages)
        content[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n"


def add_entrance(app: Any, error: Exception | None) -> None:
    """The page that a browser opens first for the site's folder."""
    if error is None and app.builder.format == "html":
        page = f'<!doctype html><meta http-equiv="refresh" content="0; url={INDEX}.html"><title>rise-tui</title>'
        Path(app.outdir, "index.html").write_text(f'{page}<a href="{INDEX}.html">rise-tui</a>\n', encoding="utf-8")


def setup(app: Any) -> None:
    app.connect("source-read", add_navigation)
    app.connect("build-finished", add_entrance)
