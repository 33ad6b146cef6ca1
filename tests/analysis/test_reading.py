"""What a session becomes when it is read for exports and reports."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.analysis.model import PlayedAct, SessionData
from rise_engine.analysis.reading import read_session, read_sessions
from rise_engine.session.levels import ExportLevel

from .samples import make_study, play_session, recovered_session, sessions_of, torn_session


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> SessionData:
    return read_session(play_session(tmp_path_factory.mktemp("lab") / "sessions"))


def of(data: SessionData, task: int) -> PlayedAct:
    return next(act for act in data.acts if act.task == task)


def test_the_parts_of_a_latency_add_up_to_it(data: SessionData) -> None:
    answer = of(data, 8)
    assert (answer.act, answer.cue_at, answer.filler) == ("Answer", 10.0, False)
    assert (answer.wizard_s, answer.way_s, answer.queue_s, answer.robot_s, answer.voice_s) == (2.48, 0.02, 0, 0.02, 1.0)
    assert answer.response_s == 3.52  # to the voice: it looks first
    answered = [act for act in data.acts if act.cue_at is not None]
    assert len(answered) == 5
    for act in answered:
        parts = (act.wizard_s, act.way_s, act.queue_s, act.robot_s, act.voice_s if act.speaks else 0.0)
        assert act.response_s == pytest.approx(sum(each or 0.0 for each in parts), abs=1e-6)


def test_every_cue_has_its_answer_or_none(data: SessionData) -> None:
    told = [(cue.at, cue.filled_at, cue.answered_at, cue.task, cue.undone_at) for cue in data.cues]
    assert told == [
        (10.0, 11.02, 13.52, 8, None),
        (24.0, None, 24.82, 10, None),
        (28.0, None, None, None, 28.9),
        (46.0, 46.82, 49.02, 21, None),
        (90.0, None, None, None, None),
    ]


def test_a_study_is_read_one_session_after_the_other(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    found = list(read_sessions(sessions_of(study)))
    assert [(each.facts.participant, each.facts.run, each.facts.outcome) for each in found] == [
        ("P01", 1, None),
        ("P01", 1, "complete"),
        ("P01", 2, "complete"),
        ("P02", 1, "aborted"),
        ("P02", 1, "complete"),
        ("P02", 2, "complete"),
        ("P03", 1, "complete"),
        ("P03", 2, "complete"),
    ]
    assert not any(each.problems for each in found)


@pytest.mark.parametrize("level", ["shared", "public"])
def test_nothing_private_is_in_what_is_read(tmp_path: Path, level: ExportLevel) -> None:
    study = make_study(tmp_path / "study")
    for data in read_sessions(sessions_of(study), level=level):
        text = repr(data).replace(repr(data.folder), "").casefold()
        for word in ("zelda", "quux", "anna", "2026", "mkv", "hurry", "sick"):
            assert word not in text, word


def test_recovered_and_torn_sessions(tmp_path: Path) -> None:
    recovered = read_session(recovered_session(tmp_path / "sessions"))
    assert (recovered.facts.recoveries, recovered.facts.downtime, recovered.facts.ended) == (1, 95.0, True)
    torn = read_session(torn_session(tmp_path / "sessions"))
    assert not torn.facts.ended and len(torn.problems) == 1
