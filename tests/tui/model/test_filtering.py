from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_tui.model.filtering import MAX_CHARACTERS, Filter, InvalidFilter, RowSearch

ROW = "00:14:32.1 wizard:anna act Blocking R_Instruction_2 done"


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("", True),
        ("   ", True),
        ("!", True),
        ("instruction", True),
        ("Instruction", True),
        ("INSTRUCTION", False),  # a capital minds capitals
        ("anna act", True),
        ("act anna", True),
        ("anna rule", False),
        ("rin2", True),
        ("instr2", True),
        ("ruct", True),
        ("nstrct", False),  # letters are left out only from where a part of a name begins
        ("R_I2", True),
        ("rx", False),
        ("wd", False),  # two letters are looked for as they are
        ("annact", False),  # not across words
        ("!rule", True),
        ("!act", False),
        ("!rin2", True),  # what must not be there is meant as it is typed
        ("done !failed", True),
        ("done !anna", False),
        ("14:32", True),
        ("/R_\\w+_2", True),
        ("/r_instr.*done$", True),
        ("/^R_", False),
        ("re:anna|bob", True),
        ("/instruction/", True),
        ("!/instruction", False),
        ("!re:bob", True),
        ("/", True),
        ("/DONE", False),
        ("/\\D\\S+_2", True),  # the capital of a class is none of the text
        ("/[[]", False),
        ("/(?:foo|anna) act", True),
        ("/n{2}", True),
        ("/{", False),
    ],
)
def test_what_a_filter_lets_through(typed: str, found: bool) -> None:
    assert Filter(typed).matches(ROW) is found


def test_digits_of_a_word_stand_together() -> None:
    assert Filter("topic2").matches("event /topic2") and Filter("topic2").matches("event /topic20")
    assert not Filter("topic2").matches("event /topic12")


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("/a(", "at 3: the ( is not closed"),
        ("/[a", "at 2: the [ is not closed"),
        ("re:*x", "at 4: there is nothing before this to repeat"),
        ("!/a)", "at 4: this ) closes nothing"),
        ("  /a)", "at 5: this ) closes nothing"),
    ],
)
def test_what_is_no_filter_says_where_and_why(typed: str, said: str) -> None:
    with pytest.raises(InvalidFilter, match="^" + re.escape(said)):
        Filter(typed)


@pytest.mark.parametrize("typed", ["/(ab)+", "/(a|b)*c?", "/(a+)?", "/(a?){20}", "/[(+]*", r"/\(*", "/a*a*a*a*b*"])
def test_repetitions_that_end_soon_are_taken(typed: str) -> None:
    assert Filter(typed).matches("aab")


@pytest.mark.parametrize("typed", ["/(a+)+b", "/((a|aa)+)+$b", "/(.*a){20}=", "/^(([a-z])+.)+[A-Z]([a-z])+$"])
def test_an_expression_that_explodes_is_given_up_and_both_ways_say_so(typed: str) -> None:
    filter = Filter(typed)
    with pytest.raises(InvalidFilter, match="takes too long"):
        filter.matches("a" * 5000)
    with pytest.raises(InvalidFilter, match="takes too long"):
        filter.match_spans("a" * 5000)


def test_an_expression_sees_a_row_up_to_a_limit_and_words_see_all() -> None:
    row = "x" * MAX_CHARACTERS + " needle"
    assert Filter("needle").matches(row) and not Filter("/needle").matches(row)


@pytest.mark.parametrize(
    ("typed", "text", "places"),
    [
        ("an", "anna an", [(0, 2), (5, 7)]),
        ("rin2", "R_Instruction_2", [(0, 1), (2, 4), (14, 15)]),
        ("anna nn", "anna", [(0, 4)]),
        ("!bob anna", "anna", [(0, 4)]),
        ("/n+", "anna", [(1, 3)]),
        ("/x*", "anna", []),
        ("/a|n", "anna", [(0, 4)]),
        ("!/n+", "anna", []),
    ],
)
def test_where_it_matches(typed: str, text: str, places: list[tuple[int, int]]) -> None:
    assert Filter(typed).match_spans(text) == places


texts = st.text(st.sampled_from("abAB_12 :/ß(İ"), max_size=30)


@given(texts, texts)
def test_a_word_that_is_there_is_found(word: str, text: str) -> None:
    word = "".join(word.split()).lstrip("!/")
    if word and word in text and not word.startswith("re:"):
        assert Filter(word).matches(text)
        assert not Filter("!" + word).matches(text)


@given(texts, texts)
def test_places_are_in_order_apart_and_inside(typed: str, text: str) -> None:
    try:
        filter = Filter(typed)
    except InvalidFilter:
        return
    end = -1
    for start, stop in filter.match_spans(text):
        assert end < start < stop <= len(text)
        end = stop


@given(st.text(st.sampled_from("ab()[]*+?{}2,|\\^$."), max_size=14))
def test_any_expression_ends_soon_or_is_refused(pattern: str) -> None:
    try:
        Filter("re:" + pattern).matches("ab" * 40 + "a" * 60 + "!")
    except InvalidFilter as broken:
        assert str(broken)


# --- in slices -------------------------------------------------------------------------------------------------------


class Rows:
    def __init__(self, count: int) -> None:
        self.ids = list(range(1, count + 1))
        self.texts = {id: f"row {id}" for id in self.ids}
        self.living: set[int] = set()
        self.looked: list[int] = []

    def text_of(self, id: int) -> str | None:
        self.looked.append(id)
        return self.texts.get(id)

    def search(self, typed: str) -> RowSearch:
        return RowSearch(Filter(typed), self.ids, self.text_of, self.living.__contains__)


def to_the_end(search: RowSearch) -> None:
    search.recheck_live()
    while search.step():
        assert search.matching == sorted(search.matching)
    assert search.is_complete


def test_a_search_goes_backwards_from_the_newest_in_slices() -> None:
    rows = Rows(1000)
    search = rows.search("7")
    assert search.step() < 100 and not search.is_complete
    assert search.matching and search.matching[-1] == 997 and min(rows.looked) > 900
    to_the_end(search)
    assert search.matching == [id for id in rows.ids if "7" in str(id)]
    assert len(rows.looked) == 1000


def test_new_rows_are_looked_at_first_and_the_list_grows_in_place() -> None:
    rows = Rows(1000)
    search = rows.search("7")
    to_the_end(search)
    found = search.matching
    rows.ids += [1001, 1007]
    rows.texts |= {1001: "row", 1007: "row 7"}
    to_the_end(search)
    assert search.matching is found and found[-1] == 1007


def test_what_has_not_ended_is_looked_at_again() -> None:
    rows = Rows(100)
    rows.living |= {40, 50}
    search = rows.search("failed")
    to_the_end(search)
    assert search.matching == []
    rows.texts[40] = rows.texts[50] = "failed"
    to_the_end(search)
    assert search.matching == [40, 50]
    rows.living.discard(40)
    rows.texts[50] = "done"
    to_the_end(search)
    assert search.matching == [40]
    rows.texts[40] = "done"  # it had ended: nothing looks again
    to_the_end(search)
    assert search.matching == [40]
    search.expect_change(40)
    to_the_end(search)
    assert search.matching == []


def test_rows_that_are_in_the_journal_only_match_nothing() -> None:
    rows = Rows(3)
    del rows.texts[1]
    search = rows.search("row")
    to_the_end(search)
    assert search.matching == [2, 3]


@given(st.lists(st.booleans(), max_size=200), st.lists(st.integers(1, 60), max_size=8))
def test_slices_find_what_one_look_finds(hits: list[bool], grow: list[int]) -> None:
    rows = Rows(0)
    rows.ids = list(range(1, len(hits) + 1))
    rows.texts = {id: "hit" if hit else "miss" for id, hit in zip(rows.ids, hits, strict=True)}
    search = rows.search("hit")
    for more in grow:
        search.step()
        start = len(rows.ids) + 1
        rows.ids += range(start, start + more)
        rows.texts |= {id: "hit" if id % 3 == 0 else "miss" for id in range(start, start + more)}
    to_the_end(search)
    assert search.matching == [id for id in rows.ids if rows.texts[id] == "hit"]
