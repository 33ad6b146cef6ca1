"""Markers: what is told of a session in a few words, live and afterwards."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest

from rise_engine.kernel.records import AnyRecord, EventRecord, TaskRecord
from rise_engine.kernel.view import SessionView
from rise_engine.results.analysis.markers import MarkerWords, describe_session, live_words, recorded_markers, source_id
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.analysis.reading import read_session
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import load_scenario_copy, read_info

from .samples import play_session

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "markers.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("markers") / "sessions")


@pytest.fixture(scope="module")
def data(folder: Path) -> SessionData:
    return read_session(folder)


@pytest.fixture(scope="module")
def scenario(folder: Path) -> Scenario:
    return load_scenario_copy(folder, read_info(folder))


def live(scenario: Scenario, told: Iterable[AnyRecord], begin: int = 0) -> list[tuple[float, str]]:
    """The markers that a stream sends that attaches after `begin` records."""
    view, records = SessionView(), list(told)
    for record in records[:begin]:
        view.apply(record)
    words = live_words(scenario, str)
    words.skip_to(view)
    return [(record.t, each) for record in records[begin:] for each in words.words(record)]


def test_a_stream_and_a_file_tell_the_same(data: SessionData, scenario: Scenario) -> None:
    """But for the one name that the wizard mistyped: on the wire, nobody knows what that is."""
    recorded = recorded_markers(data)
    assert live(scenario, data.records) == [(t, each.replace("act/Nodd/", "act/other/")) for t, each in recorded]
    assert any(each == "act/Nodd/rejected" for _, each in recorded)


def test_who_attaches_late_tells_nothing_twice(data: SessionData, scenario: Scenario) -> None:
    whole = live(scenario, data.records)
    records = list(data.records)
    for begin in range(len(records)):
        late = live(scenario, data.records, begin)
        assert late == whole[len(whole) - len(late) :], begin
        expected = [each for each in whole if each[0] > records[begin].t]
        assert late[len(late) - len(expected) :] == expected


def test_nothing_that_was_said_or_typed_is_in_a_marker(data: SessionData, scenario: Scenario) -> None:
    told = " ".join(each for _, each in live(scenario, data.records))
    assert not re.search("Zelda|Quux|looks away|question|anna|Nodd", told)


def test_markers_name_the_same_causes_as_the_tables(data: SessionData) -> None:
    told = [each.split("/")[1:] for _, each in recorded_markers(data) if re.match(r"act/[^/]+/by-", each)]
    acts = sorted((act for act in data.acts if act.status != "REJECTED"), key=lambda act: act.task)
    assert told == [[act.act, f"by-{act.actor}"] for act in acts]
    assert len({act.actor for act in acts}) > 1


def test_names_that_a_person_gave_are_not_told_and_those_of_programs_are_cleaned(scenario: Scenario) -> None:
    words = live_words(scenario, lambda name: name.replace("Zelda", "{person_name}"))

    def event(topic: str, source: str) -> tuple[str, ...]:
        return words.words(EventRecord(1, 0.0, "", topic, source, None))

    assert event("/tea", "wizard:anna") == ("event/tea",)
    assert event("/Zelda_is_here", "wizard:anna") == ("event/other",)
    assert event("/seen/Zelda", "ros:/camera") == ("event/seen/{person_name}",)


def test_a_new_place_in_the_queue_is_no_moment() -> None:
    words = MarkerWords({})

    def task(status: str, position: int | None) -> tuple[str, ...]:
        return words.words(
            TaskRecord(
                1, 0.0, "", 5, "startCommunicationRobotAct", "Nod", "", "rule:R", status, position=position  # type: ignore[arg-type]
            )
        )  # fmt: skip

    assert [task("PENDING", 1), task("PENDING", 0), task("ACTIVE", None), task("SUCCEEDED", None)] == [
        ("act/Nod/accepted", "act/Nod/by-rule"),
        (),
        ("act/Nod/started",),
        ("act/Nod/succeeded",),
    ]


def test_every_marker_is_in_the_documentation(data: SessionData) -> None:
    section = PAGE.read_text("utf-8").partition("## Markers")[2].partition("\n## ")[0]
    patterns = re.findall(r"^- `([^`]+)`", section, re.MULTILINE)
    assert len(patterns) > 10
    known = [re.compile(re.sub(r"\\?[A-Z]{2,}", ".+", pattern)) for pattern in patterns]
    unknown = {each for _, each in recorded_markers(data) if not any(form.fullmatch(each) for form in known)}
    assert not unknown


def test_what_is_not_known_is_left_out() -> None:
    facts = SessionFacts(session="s1", participant="P01", factors={"noise": "loud"})
    assert describe_session(facts) == {"session": "s1", "participant": "P01", "factors": '{"noise":"loud"}'}
    assert source_id("", "s1") == "rise/s1" and source_id("hesitation", "s1") == "rise/hesitation/s1"
