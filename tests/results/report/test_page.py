"""The page: nothing is fetched, nothing runs, nothing that somebody wrote becomes markup, and it can be read by all."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.base.text import UNSEEN
from rise_engine.results.report.document import Document, Facts, Figure, Paragraph, ReportTable, Section
from rise_engine.results.report.page import Drawing, cells_wide, element, escape, page_text, text_lines
from tests.results.report.pages import PageReader

HOSTILE = [
    "<script>alert(1)</script>",
    "</style><img src=x onerror=alert(1)>",
    "http://evil.example/?q=1&r=2",
    "HTTPS://EVIL.EXAMPLE",
    "background: url(https://evil.example)",
    '"><a href="javascript:alert(1)">',
    "' onload='alert(1)",
    "</td></table><h1>gone",
    "]]></svg><script>",
    "\x1b[31mred\x00\u202etxt.exe",
    "\ud83d half",
    "&lt;script&gt;",
]
ALLOWED = '<meta HTTP-EQUIV="Content-Security-Policy"'


def assert_harmless(page: str) -> PageReader:
    """What holds for every report, whatever stands in its texts."""
    assert page.count(ALLOWED) == 1
    rest = page.replace(ALLOWED, "").casefold()
    for forbidden in ("http", "<script", "url(", "@import"):
        assert forbidden not in rest, forbidden
    reader = PageReader(page)
    assert not {"script", "img", "link", "iframe", "object", "embed", "form", "base", "image", "use"} & set(reader.tags)
    for tag, name, value in reader.attributes:
        assert not name.startswith("on") and name not in ("src", "style", "action", "srcdoc"), (tag, name)
        if name == "href":
            assert value.startswith("#"), value
    return reader


def document(*texts: str) -> Document:
    """Texts wherever a report has some."""
    text = " ".join(texts)
    drawing = Drawing(10, 10, text, text, name="course")
    drawing.box(0, 0, 1, 1, "act", text)
    drawing.text(0, 0, text)
    table = ReportTable(caption=text, head=(text, "b"), rows=((text, text),), note=text)
    blocks = (
        Paragraph(text, "warning"),
        Facts(((text, text),)),
        table,
        ReportTable(caption=f"{text} folded", head=(text,), rows=((text,),), folded=True),
        Figure(caption=text, svg=(drawing.whole(),), text=lambda width: []),
    )
    sections = (Section(text, blocks), Section("Two", ()))
    return Document(
        title=text, kind=text, summary=text, banner=text, facts=((text, text),), sections=sections, colophon=text
    )


@pytest.mark.parametrize("text", HOSTILE)
def test_what_somebody_wrote_stays_a_text(text):
    reader = assert_harmless(page_text(document(text)))
    shown = text.replace("\x1b", "·").replace("\x00", "·").replace("\u202e", "·").replace("\ud83d", "\\ud83d")
    assert shown in reader.text


@given(st.text(max_size=60), st.sampled_from(HOSTILE))
def test_any_text_at_all(text, hostile):
    assert_harmless(page_text(document(text, hostile, text)))
    lines = text_lines(document(text, hostile))
    assert not any(UNSEEN.search(line) for line in lines)


def test_the_policy_lets_nothing_in():
    page = page_text(document("plain"))
    assert f'{ALLOWED} content="default-src &#x27;none&#x27;; style-src &#x27;unsafe-inline&#x27;">' in page
    policy = next(value for tag, name, value in PageReader(page).attributes if name == "content" and "src" in value)
    assert policy == "default-src 'none'; style-src 'unsafe-inline'"
    style = re.search(r"<style>(.*?)</style>", page, re.DOTALL)
    assert style is not None and "<" not in style[1]


def test_the_same_document_gives_the_same_bytes():
    assert page_text(document("a", "b")) == page_text(document("a", "b"))


def test_who_cannot_see_a_drawing_reads_its_title():
    page = page_text(document("What it shows"))
    reader = PageReader(page)
    svg = [(name, value) for tag, name, value in reader.attributes if tag == "svg"]
    assert ("role", "img") in svg and ("aria-label", "What it shows") in svg
    assert "<title>What it shows</title>" in page and "<desc>What it shows</desc>" in page
    assert ("th", "scope", "col") in reader.attributes and ("th", "scope", "row") in reader.attributes
    assert ("html", "lang", "en") in reader.attributes


def test_attributes_are_quoted_and_empty_ones_left_out():
    assert element("p", "x", class_="", aria_label='a"b') == '<p aria-label="a&quot;b">x</p>'
    assert escape("a < b & c") == "a &lt; b &amp; c"


# --- in a terminal ---


@given(
    st.lists(st.tuples(st.text(max_size=30), st.text(max_size=200), st.sampled_from(["", "1", "23.45"])), max_size=6),
    st.integers(40, 120),
)
def test_no_line_is_wider_than_the_terminal(rows, width):
    table = ReportTable(caption="c " * 60, head=("first", "second", "n"), rows=tuple(rows), numbers=frozenset({2}))
    facts = tuple((name[:12], value) for name, value, _ in rows)
    made = Document(title="t" * 200, kind="k", banner="b " * 80, facts=facts, sections=(Section("S", (table,)),))
    for line in text_lines(made, width):
        assert cells_wide(line) <= width, line


def test_numbers_stand_to_the_right_and_empty_columns_go():
    rows = (("a", "1.5", "", "x"), ("bb", "10.25", "", ""))
    table = ReportTable(caption="Numbers", head=("name", "n", "gone", "told"), rows=rows, numbers=frozenset({1}))
    lines = text_lines(Document(title="T", kind="K", sections=(Section("S", (table,)),)))
    assert lines[-4:] == ["name      n  told", "─────────────────", "a       1.5  x", "bb    10.25"]


def test_words_stay_whole_as_long_as_there_is_room():
    rows = (("participant", "a sentence that is much longer than a line of a terminal " * 3),)
    table = ReportTable(caption="", head=("who", "told"), rows=rows)
    lines = text_lines(Document(title="T", kind="K", sections=(Section("S", (table,)),)), 60)
    assert any(line.startswith("participant  a sentence that") for line in lines)
