"""The documentation as a site: it has every page, loads nothing from elsewhere, and its search works from a disk."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_docs import DOCS, ROOT

pytestmark = pytest.mark.slow

LOADED = re.compile(
    r"""<(?:script|img|iframe|source)[^>]*\ssrc="([^"]*)"|<link[^>]*\shref="([^"]*)"|@import|url\(["']?(http[^)]*)"""
)
FOUND = re.compile(r"found (\d+) pages? matching")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("a site") / "docs"
    options = ["--quiet", "--fail-on-warning", "--keep-going", "--conf-dir", "docs"]
    made = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, ".", str(target)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (made.returncode, made.stderr) == (0, "")
    return target


def test_it_has_every_page(site: Path) -> None:
    pages = {page.relative_to(ROOT).with_suffix(".html") for page in DOCS.rglob("*.md")}
    assert sorted(page for page in pages if not (site / page).is_file()) == []
    assert "docs/README.html" in (site / "index.html").read_text(encoding="utf-8")


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    for file in [*site.rglob("*.html"), *site.rglob("*.css")]:
        loaded = [next(filter(None, each.groups()), "") for each in LOADED.finditer(file.read_text(encoding="utf-8"))]
        assert [url for url in loaded if url.startswith(("http:", "https:", "//"))] == [], file


def test_its_index_has_the_words_of_the_pages(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8").removeprefix("Search.setIndex(").removesuffix(")")
    words = json.loads(index)["terms"]
    assert "debounc" in words


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to search with")
def test_it_can_be_searched_without_a_network(site: Path, tmp_path: Path) -> None:
    browser = ["chromium", "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}"]
    offline = ["--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=15000", "--dump-dom"]
    page = f"{(site / 'search.html').as_uri()}?q=debounce"
    shown = subprocess.run([*browser, *offline, page], capture_output=True, text=True, timeout=120, check=True).stdout
    found = FOUND.search(shown)
    assert found is not None, shown[-2000:]
    assert int(found[1]) >= 3
    assert "docs/reference/scenario.html" in shown
