"""`[report]` of study.toml: what people say for the reporting sheet."""

from __future__ import annotations

import tomllib

import pytest

from rise_engine.study.model import Study
from rise_engine.study.new_study import NewStudy, study_toml_text
from rise_engine.study.publishing import ITEM_NAMES, REPORT_ITEMS
from rise_engine.study.study_toml import load_study

HEAD = 'title = "A"\nid = "a"\nseed = 1\nn = 2\n'


@pytest.fixture
def load(tmp_path):
    def from_text(text):
        (tmp_path / "study.toml").write_text(HEAD + text, "utf-8")
        return load_study(tmp_path, check_scenarios=False)

    return from_text


def test_what_is_said_is_read_and_what_is_empty_is_not_said(load):
    found = load('[report]\nplace = "  Bielefeld, a laboratory "\nlimits = ""\nstory = """\nTwo lines\nof it"""\n')
    assert found.study is not None and found.diagnostics == []
    assert found.study.report == {"place": "Bielefeld, a laboratory", "story": "Two lines\nof it"}
    assert load("").study.report == {}


def test_everything_that_is_wrong_is_told_with_its_place_and_the_nearest_name(load):
    found = load('[report]\nplaec = "x"\nlimits = 3\nnobody_asks = "y"\n')
    assert found.study is None
    told = [(each.location.line, each.code, each.message) for each in found.errors]
    assert [each[:2] for each in told] == [(6, "unknown-key"), (7, "wrong-type"), (8, "unknown-key")]
    assert "did you mean `place`?" in told[0][2]
    assert told[1][2] == '`limits` is a text: limits = "..."'


def test_a_table_that_is_none(load):
    (error,) = load('report = "later"\n').errors
    assert "`report` is a table: [report]" in error.message


def test_the_plan_does_not_depend_on_it(load):
    assert load('[report]\nplace = "x"\n').study.design_hash == load("").study.design_hash


def test_a_new_study_names_every_item_as_a_comment():
    text = study_toml_text(NewStudy(Study("", "A", "a", 1, 2, "scenario", "real"), {}))
    assert tomllib.loads(text)["report"] == {}
    start = text.index("[report]")
    lines = text[start:].split("\n")[1 : len(REPORT_ITEMS) + 1]
    asked = tomllib.loads("\n".join(["[report]", *(line.removeprefix("# ") for line in lines)]))
    assert tuple(asked["report"]) == ITEM_NAMES
