"""Tiers: what a session becomes for those who annotate, and the law that every program of theirs demands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.results.analysis.model import ActPart, Cue, SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.media_clock import MediaClock, TierSet, lay_out, one_line
from rise_engine.results.export.spans import spans_of
from tests.results.analysis.samples import play_session

from .made_sessions import act, phase, point, session, sessions


def tiers_of(data: SessionData, clock: MediaClock | None = None) -> TierSet:
    return lay_out(spans_of(data), clock or MediaClock(), data.facts.duration)


def rows(found: TierSet) -> dict[str, list[tuple[int, int, str]]]:
    return {tier.name: [(each.start, each.end, each.text) for each in tier.annotations] for tier in found.tiers}


def assert_lawful(found: TierSet) -> None:
    names = [tier.name for tier in found.tiers]
    assert len(set(names)) == len(names) > 0
    for tier in found.tiers:
        at = 0
        for each in tier.annotations:
            assert at <= each.start < each.end <= found.end, tier.name
            assert each.text and each.text == one_line(each.text)
            at = each.end


@given(sessions(), st.floats(-700, 700), st.sampled_from([1.0, 1.00005, 0.9999]))
def test_annotations_never_overlap_and_always_last_and_are_never_negative(
    data: SessionData, shift: float, rate: float
) -> None:
    spans = spans_of(data)
    found = lay_out(spans, MediaClock(rate=rate, shift=shift), data.facts.duration)
    assert_lawful(found)
    assert sum(len(tier.annotations) for tier in found.tiers) + found.lost == len(spans)


@given(sessions(media=False))
def test_nothing_is_lost_where_nothing_is_shifted(data: SessionData) -> None:
    found = tiers_of(data)
    assert found.lost == 0
    begun = sorted(each.start for tier in found.tiers for each in tier.annotations)
    assert begun == sorted(MediaClock().to_ms(span.start) for span in spans_of(data))


def test_a_real_session_as_a_coder_sees_it(tmp_path: Path) -> None:
    data = read_session(play_session(tmp_path))
    found = tiers_of(data)
    assert_lawful(found)
    told = rows(found)
    assert list(told) == [
        *("robot speech", "robot gaze", "robot face", "robot body", "robot arms", "robot wait"),
        *("wizard acts", "wizard acts 2", "program acts", "fillers", "queue", "rejected", "cue"),
        *("rule Visit", "rule Lamp", "stopped", "event", "note", "mistake", "sync"),
    ]
    answer = next(each for each in data.acts if each.task == 8)
    assert (12520, 17729, "Answer") in told["wizard acts"]  # from when the robot confirmed it
    assert answer.started_at == 12.5
    assert (13520, 17729, "That is a very good question, let us have a look at it.") in told["robot speech"]
    assert (71020, 72550, "That is a very good question, let us have a look at it. (canceled)") in told["robot speech"]
    assert told["fillers"] == [(11020, 11514, "Hm"), (46820, 48800, "Think")]
    assert told["robot wait"][0] == (32014, 32514, "Wait: 500 ms")
    assert told["queue"] == [(30400, 32514, "Thanks")]
    assert told["cue"][0] == (9970, 13520, "waits 3.55 s (asks something)")
    assert told["cue"][2] == (28000, 28900, "taken back")
    assert told["cue"][-1] == (90000, 90100, "no answer")
    assert told["rule Visit"][0] == (1000, 2586, "Start → Welcome")
    assert told["event"] == [(55000, 55100, "/tea → Visit"), (68000, 68100, "/nobody"), (86000, 86100, "/off")]
    assert told["note"] == [(54000, 54100, "Zelda looks away")]


def test_what_overlaps_goes_to_a_second_tier_whose_name_nobody_has() -> None:
    data = session(acts=(act(1, 5, "A"), act(2, 3, "B"), act(4, 6, "C"), act(7, 8, "D")))
    told = rows(tiers_of(data))
    assert told["wizard acts"] == [(1000, 5000, "A"), (7000, 8000, "D")]
    assert told["wizard acts 2"] == [(2000, 3000, "B"), (4000, 6000, "C")]
    taken = session(phases=(phase(1, 3, "S", "X"), phase(2, 4, "T", "X"), phase(1, 2, "U", "X 2")))
    assert list(rows(tiers_of(taken))) == ["rule X", "rule X 3", "rule X 2"]


def test_moments_are_short_and_shorter_before_the_next() -> None:
    data = session(points=(point(1.0), point(1.04, value="then"), point(1.04, value="too"), point(9.0, value="late")))
    told = rows(tiers_of(data))
    assert told["note"] == [(1000, 1040, "hm"), (1040, 1140, "then"), (9000, 9100, "late")]
    assert told["note 2"] == [(1040, 1140, "too")]


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ([(0, 0, "A"), (0, 0, "B"), (0, 2, "C")], [(0, 2000, "A → B → C")]),
        ([(0, 2, "A"), (2, 2, "End", "ended")], [(0, 2000, "A → End")]),
        ([(1, 1, "A"), (1, 1, "End", "ended")], [(1000, 1100, "A → End")]),
        ([(1, 1, "A", "ended"), (1, 3, "A"), (3, 3, "B", "ended")], [(1000, 1100, "A"), (1000, 3000, "A → B")]),
        ([(0, 1, "A"), (1, 1, "B"), (1, 4, "C", "stopped")], [(0, 1000, "A"), (1000, 4000, "B → C (stopped)")]),
    ],
    ids=["before", "after", "alone", "two runs", "between"],
)
def test_states_of_no_length_are_told_with_their_neighbour(
    states: list[tuple[float, float, str]], expected: list[tuple[int, int, str]]
) -> None:
    made = tuple(phase(start, end, name, ended_by="".join(by)) for start, end, name, *by in states)
    found = tiers_of(session(phases=made))
    assert sorted(each for told in rows(found).values() for each in told) == expected


def test_acts_that_went_wrong_or_never_had_their_turn_say_so() -> None:
    data = session(
        acts=(
            act(1, 2, "Fell", status="ABORTED"),
            act(3, 5, "Waited", status="CANCELED", started_at=None, robot_at=None),
            act(6, 6, "No", status="REJECTED", reason="there is no act 'No'", started_at=None, robot_at=None),
            act(7, 9, "Slow", started_at=7.5, robot_at=8.0),
            act(10, 0, "Open", status="ACTIVE", ended_at=None),
        )
    )
    told = rows(tiers_of(data))
    assert told["wizard acts"] == [
        (1000, 2000, "Fell (aborted)"),
        (8000, 9000, "Slow"),
        (10000, 60000, "Open (not ended)"),
    ]
    assert told["queue"] == [(3000, 5000, "Waited (canceled)"), (7000, 7500, "Slow")]
    assert told["rejected"] == [(6000, 6100, "No: there is no act 'No'")]


def test_an_action_stands_on_the_tier_of_each_channel_that_it_takes() -> None:
    def part(type: str, *channels: str, at: float | None = 1.0) -> ActPart:
        told: dict[str, Any] = {"action": type, "type": type, "channels": channels, "parameters": {}, "text": "big"}
        return ActPart(**told, accepted_at=at, ended_at=2.0, status="succeeded", started_at=0.5)

    parts = (part("Grin", "face", "eyes"), part("Wait", at=None), part("Beep"), part("Speech", "speech", at=None))
    told = rows(tiers_of(session(acts=(act(1, 2, parts=parts),))))
    assert {name: [text for *_, text in rows] for name, rows in told.items() if name.startswith("robot")} == {
        "robot face": ["Grin: big"],
        "robot eyes": ["Grin: big"],
        "robot other": ["Beep: big"],
        "robot wait": ["Wait: big"],
    }


def test_stops_and_a_lost_robot_last_until_they_are_over() -> None:
    data = session(
        points=(
            point(0.0, "robot", "connected", ""),
            point(5.0, "stop", "requested", ""),
            point(5.1, "stop", "latched", "not confirmed: arms"),
            point(8.0, "stop", "released", ""),
            point(20.0, "robot", "degraded", "no speech"),
            point(25.0, "robot", "lost", "gone"),
            point(30.0, "robot", "connected", ""),
            point(50.0, "stop", "latched", ""),
        )
    )
    assert rows(tiers_of(data)) == {
        "stopped": [(5000, 8000, "stopped"), (50000, 60000, "stopped")],
        "robot link": [(20000, 25000, "degraded: no speech"), (25000, 30000, "lost: gone")],
    }


def test_what_the_study_raises_itself_is_no_event_for_a_coder() -> None:
    def event(at: float, name: str, source: str) -> object:
        return point(at, "event", name, "Talk", source=source)

    sources = {
        "/yes": "wizard:anna",
        "/saw": "node:eyes",
        "/R_end": "engine",
        "/on": "rule:Talk",
        "/cue": "wizard:anna",
    }
    data = session(points=tuple(event(at, *each) for at, each in enumerate(sources.items())))  # type: ignore[arg-type]
    assert [text for *_, text in rows(tiers_of(data))["event"]] == ["/yes → Talk", "/saw → Talk"]


def test_a_cue_says_how_long_the_participant_waited() -> None:
    cue = Cue(at=2.0, source="wizard:anna", answered_at=2.684)
    assert rows(tiers_of(session(cues=(cue,))))["cue"] == [(2000, 2684, "waits 0.68 s")]


def test_a_session_without_anything_has_one_tier() -> None:
    found = tiers_of(session(facts={"duration": 0.0}))
    assert (rows(found), found.end) == ({"robot speech": []}, 1)


@given(st.text(st.characters()))
def test_one_line_is_one_line_that_xml_can_hold(text: str) -> None:
    from lxml import etree

    line = one_line(text)
    assert len(line.splitlines()) <= 1 and "\t" not in line and line == line.strip()
    etree.Element("x").text = line
    line.encode()
