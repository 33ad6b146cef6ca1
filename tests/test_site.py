"""The documentation as a site: it has every page, loads nothing from elsewhere, and its search works from a disk."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import chance
from tests.test_docs import DOCS, ROOT

pytestmark = pytest.mark.slow

LOADED = re.compile(
    r"""<(?:script|img|iframe|source)[^>]*\ssrc="([^"]*)"|<link[^>]*\shref="([^"]*)"|@import|url\(["']?(http[^)]*)"""
)
FOUND = re.compile(r"found (\d+) pages? matching")


FEW = ("docs/README.md", "docs/how-to/wizard.md", "docs/reference/scenario.md")
"""Pages that are made a site of their own each time; their links to the others lead nowhere then."""
ALL = tuple(str(page.relative_to(ROOT)) for page in DOCS.rglob("*.md"))


def built(target: Path, pages: tuple[str, ...]) -> Path:
    options = ["--quiet", "--fail-on-warning", "--keep-going", "--conf-dir", "docs"]
    if pages != ALL:
        quiet = "suppress_warnings=myst.header,myst.xref_missing,toc"
        options += ["-D", f"include_patterns={','.join(pages)}", "-D", quiet]
    made = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, ".", str(target)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (made.returncode, made.stderr) == (0, "")
    return target


@pytest.mark.parametrize("pages", [pytest.param(FEW, id="few"), pytest.param(ALL, id="all", marks=chance.searched)])
def test_it_has_every_page_loads_nothing_from_elsewhere_and_can_be_searched(
    pages: tuple[str, ...], tmp_path: Path
) -> None:
    site = built(tmp_path / "a site", pages)
    assert [page for page in pages if not (site / page).with_suffix(".html").is_file()] == []
    assert "docs/README.html" in (site / "index.html").read_text(encoding="utf-8")
    for file in [*site.rglob("*.html"), *site.rglob("*.css")]:
        loaded = [next(filter(None, each.groups()), "") for each in LOADED.finditer(file.read_text(encoding="utf-8"))]
        assert [url for url in loaded if url.startswith(("http:", "https:", "//"))] == [], file
    index = (site / "searchindex.js").read_text(encoding="utf-8").removeprefix("Search.setIndex(").removesuffix(")")
    assert "debounc" in json.loads(index)["terms"]
    if pages == ALL and shutil.which("chromium") is not None:
        search_without_a_network(site, tmp_path)


def search_without_a_network(site: Path, tmp_path: Path) -> None:
    browser = ["chromium", "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}"]
    offline = ["--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=15000", "--dump-dom"]
    page = f"{(site / 'search.html').as_uri()}?q=debounce"
    shown = subprocess.run([*browser, *offline, page], capture_output=True, text=True, timeout=120, check=True).stdout
    found = FOUND.search(shown)
    assert found is not None, shown[-2000:]
    assert int(found[1]) >= 3
    assert "docs/reference/scenario.html" in shown
