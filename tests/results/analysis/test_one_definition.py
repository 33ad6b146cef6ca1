"""What an answer is, and how long a participant waited for it: the report, sessions.csv, acts.csv, `agree` and the
script of the how-to say the same of a LabLinking session with hesitations and noise."""

from __future__ import annotations

import csv
import re
import statistics
from itertools import pairwise
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Note, SessionStarted
from rise_engine.results.analysis.course import records_by_wall_clock
from rise_engine.results.analysis.judged_cues import judge_session
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.format import load_format
from rise_engine.results.export.spans import spans_of
from rise_engine.results.export.writing import export_context
from rise_engine.results.report.page import text_lines
from rise_engine.results.report.session_report import session_report
from rise_engine.results.report.study_facts import session_row
from tests.sources import ROOT

from .samples import WIZARD, Script, act, play_session, recovered_session, task, write_scenario
from .test_causes import compare

LABLINKING = ROOT / "scenarios" / "lablinking"
HOW_TO = ROOT / "docs" / "how-to" / "export-and-replay.md"
YES_LOUD = {"hesitation": True, "distraction": True}


def instructions() -> Script:
    """A wizard who answers twelve cues by the key of the main rule, and once presses it before the cue: the robot
    hesitates, and the instruction after that begins behind the cue."""
    script: list = [(1.0, task("startInteractionRule", "Table setting"))]
    script.append((55.0, task("repeatAct", "16")))  # the robot of the samples points in vain the first time
    for number in range(12):
        cue = 20.0 + 25.0 * number
        pressed = cue + 0.9 + 0.1 * number
        script += [
            (cue, task("markCue", pressed=cue)),
            (pressed, task("startInteractionRule", "Next", pressed=pressed)),
        ]
    early = 20.0 + 25.0 * 12
    script += [
        (early, task("startInteractionRule", "Next", pressed=early)),
        (early + 2.0, task("markCue", pressed=early + 2.0)),
    ]
    return script


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("lab") / "sessions"
    started = SessionStarted(participant="P01", condition="yes+loud", memory=YES_LOUD)
    return play_session(root, instructions(), scenario=LABLINKING, started=started, until=360.0)


@pytest.fixture(scope="module")
def data(folder: Path) -> SessionData:
    return read_session(folder)


def test_a_hesitation_answers_no_cue(data: SessionData) -> None:
    named = {each.task: each.act for each in data.acts}
    played = [each.act for each in data.acts]
    assert played.count("R_Hesitation") >= 4
    answered = [named[cue.task] for cue in data.cues if cue.task is not None]
    assert len(answered) >= 12
    assert "R_Hesitation" not in answered
    after = [other for before, other in pairwise(played) if before == "R_Hesitation"]
    assert set(after) <= set(answered), "the instruction after it is the answer"
    assert all(each.cue_at is None for each in data.acts if each.act == "R_Hesitation")


def test_the_medians_are_of_the_same_answers(data: SessionData, folder: Path, tmp_path: Path) -> None:
    early = [each for each in data.acts if each.before_cue]
    assert [each.act for each in early] == ["R_Task3_Step2"] and early[0].response_s is not None
    told = [each.answer_s for each in data.acts if each.answer_s is not None]
    median = statistics.median(told)
    assert len(told) == len([each for each in data.acts if each.response_s is not None and not each.filler]) - 1

    row = session_row(data)
    assert row.figures.latency.response.summary is not None
    assert row.figures.latency.response.summary.median == pytest.approx(median, abs=1e-6)

    load_format("tables").write(tmp_path / "out", [data], export_context([folder], "full"))
    with (tmp_path / "out" / "sessions.csv").open(encoding="utf-8") as file:
        (session,) = csv.DictReader(file)
    assert float(session["response_median_s"]) == pytest.approx(median, abs=1e-6)
    assert (int(session["responses"]), int(session["before_cue"])) == (len(told), 1)

    judged = [cue.decisions["anna"] for cue in judge_session(data).cues]
    reactions = [each.latency for each in judged if each.latency is not None]
    assert reactions == pytest.approx([each.wizard_s for each in data.acts if each.answer_s is not None], abs=1e-6)
    assert [each.why for each in judged if each.latency is None] == ["before the cue"]
    assert [each for part in row.wizards for each in part.reactions] == pytest.approx(reactions, abs=1e-6)


def test_an_answer_across_an_outage_is_in_no_median(tmp_path: Path) -> None:
    """A cue at 9 s, no engine for 20 s, the key at 14 s: nobody waited for 5 s."""
    script = [
        act("Greet", 1.0),
        (8.0, task("markCue")),
        act("Thanks", 8.5),
        (20.0, task("markCue")),
        act("Greet", 25.0),
    ]
    folder = recovered_session(tmp_path / "sessions", script=script, at=22.0, away=20.0, noted=22.0)
    data = read_session(folder)
    thanks, late = data.acts[1:]
    assert late.response_s == pytest.approx(5.05, abs=0.3) and late.response_outage_s == 20.0
    assert (late.answer_s, thanks.answer_s) == (None, thanks.response_s)
    assert [each.text for each in spans_of(data) if each.tier == "cue"][1].endswith(" s, and 20.00 s without an engine")
    latency = session_row(data).figures.latency
    assert (latency.response.values, latency.before_cue, latency.interrupted) == (
        (thanks.response_s,),
        0,
        {"outage": 1},
    )
    report = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "1 answer across an outage of the engine" in report
    assert "half of the 1 with a time that counts within" in report
    assert [each.why for cue in judge_session(data).cues for each in cue.decisions.values()] == ["", "no engine"]
    load_format("tables").write(tmp_path / "out", [data], export_context([folder], "full"))
    with (tmp_path / "out" / "acts.csv").open(encoding="utf-8") as file:
        row = list(csv.DictReader(file))[2]
    assert float(row["response_wall_s"]) == pytest.approx(float(row["response_s"]) + 20.0)


def test_an_answer_across_a_stop_is_in_no_median_and_no_picture(tmp_path: Path) -> None:
    """A cue at 20 s, everything stopped from 21 s to 26 s, the key at 27 s: the wizard could start nothing."""
    script = [
        (1.0, task("startInteractionRule", "Visit")),
        (8.0, task("markCue")),
        act("Thanks", 8.5),
        (20.0, task("markCue")),
        (21.0, task("stopAll")),
        (26.0, task("releaseStop", '{"Visit": "wait"}')),
        act("Greet", 27.0),
    ]
    folder = play_session(tmp_path / "sessions", script=script, until=40.0)
    data = read_session(folder)
    thanks, late = data.acts[1:]
    assert (late.answer_s, late.response_interrupted) == (None, "stop") and late.response_s is not None
    assert [each.text for each in spans_of(data) if each.tier == "cue"][1].endswith(", partly with everything stopped")
    row = session_row(data)
    assert (row.figures.latency.response.values, row.figures.latency.interrupted) == ((thanks.response_s,), {"stop": 1})
    assert row.wizards[0].reactions == (thanks.wizard_s,)
    report = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "Left out of all times: 1 answer while everything was stopped." in report
    assert "half of the 1 with a time that counts within" in report
    whys = [each.why for cue in judge_session(data).cues for each in cue.decisions.values()]
    assert whys == ["", ""], "the stop itself is a decision, and was taken before"
    load_format("tables").write(tmp_path / "out", [data], export_context([folder], "full"))
    with (tmp_path / "out" / "acts.csv").open(encoding="utf-8") as file:
        assert [each["response_interrupted"] for each in csv.DictReader(file)] == ["", "", "stop"]
    with (tmp_path / "out" / "sessions.csv").open(encoding="utf-8") as file:
        (session,) = csv.DictReader(file)
    assert (session["responses"], session["responses_over_2s"]) == ("1", "0")


def test_an_answer_across_a_standstill_is_in_no_median(tmp_path: Path) -> None:
    """A cue at 20 s; from 21 s to 27 s the engine stands still, and the key of 24 s comes late."""
    script = [
        act("Greet", 1.0),
        (8.0, task("markCue", pressed=8.0)),
        act("Thanks", 8.5),
        (20.0, task("markCue", pressed=20.0)),
        (27.0, Note(text="it stood still", stood=6.0)),
        (27.1, Note(text="so did I", source=WIZARD, stood=7.0)),
        act("Greet", 27.0, reaction=3.0),
    ]
    data = read_session(play_session(tmp_path / "sessions", script=script, until=40.0))
    thanks, late = data.acts[1:]
    assert (late.answer_s, late.response_interrupted, late.wizard_s) == (None, "standstill", 4.0)
    assert [(each.kind, each.at, each.until) for each in data.interruptions] == [("standstill", 21.0, 27.0)]
    latency = session_row(data).figures.latency
    assert (latency.response.values, latency.interrupted) == ((thanks.response_s,), {"standstill": 1})
    report = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "1 answer across a standstill of the engine" in report
    assert "Standstills of the engine 1 standstill, 6 s in all" in report


def test_an_answer_across_a_suspend_of_the_computer_is_in_no_median(tmp_path: Path) -> None:
    """A cue at 20 s; at 21 s the lid is closed for ten minutes. Session time stands still, so only the note tells."""
    script = [
        act("Greet", 1.0),
        (20.0, task("markCue", pressed=20.0)),
        (21.0, Note(text="the computer was suspended for 600 s", stood=600.0, suspended=True)),
        act("Thanks", 22.0),
    ]
    data = read_session(play_session(tmp_path / "sessions", script=script, until=40.0))
    late = data.acts[-1]
    assert (late.response_interrupted, late.response_outage_s) == ("outage", 600.0)
    assert [(each.kind, each.at, each.until) for each in data.interruptions] == [("outage", 21.0, 21.0)]
    assert data.facts.downtime == 600.0 and session_row(data).figures.latency.response.values == ()
    assert {at - record.t for at, record in records_by_wall_clock(data)} == {0.0, 600.0}
    (note,) = (point for point in data.points if point.kind == "note")
    assert (note.value, note.outage_s) == ("the computer was suspended for 600 s", 600.0)
    report = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "Outages of the engine 1 outage, 10 min 00 s in all by the wall clock" in report


@pytest.mark.parametrize(
    ("script", "keys"),
    [
        ([(2.0, task("nextFiller"))], ["nextFiller"]),
        (
            [
                (1.0, task("startInteractionRule", "Visit")),
                (2.0, task("stopAll")),
                (6.0, task("releaseStop", '{"Visit": "enter"}')),
            ],
            ["startInteractionRule", "stopAll", "releaseStop"],
        ),
    ],
)
def test_what_a_key_brings_along_is_no_further_key(script: Script, keys: list[str], tmp_path: Path) -> None:
    data = read_session(play_session(tmp_path / "sessions", script, until=30.0))
    assert [each.function for each in data.keys] == keys
    assert all(each.by == "wizard:anna" for each in data.acts)


def test_the_events_say_whose_doing_an_act_is_as_the_acts_do(data: SessionData, folder: Path, tmp_path: Path) -> None:
    load_format("tables").write(tmp_path / "out", [data], export_context([folder], "full"))
    with (tmp_path / "out" / "events.csv").open(encoding="utf-8") as file:
        told = {row["task"]: (row["by"], row["actor"]) for row in csv.DictReader(file) if row["kind"] == "act"}
    assert told == {str(each.task): (each.by, each.actor) for each in data.acts}


@pytest.mark.slow
def test_the_script_of_the_how_to_says_the_same(
    data: SessionData, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two sessions in one table, whose tasks have the same numbers."""
    second = play_session(folder.parent, instructions()[:10], scenario=LABLINKING, until=200.0)
    told = [each.answer_s for each in (*data.acts, *read_session(second).acts) if each.answer_s is not None]
    load_format("csv").write(tmp_path / "p07.csv", [data, read_session(second)], export_context([folder], "full"))
    blocks = re.findall(r"```python\n(.*?)```", HOW_TO.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec("\n".join(blocks), names)  # as somebody pastes it
    assert sorted(names["waited"].dropna()) == pytest.approx(sorted(told), abs=1e-6)
    assert (names["ended"] - names["began"]).min() >= 0


@pytest.mark.parametrize(
    ("on_failure", "more", "answered"),
    [("repeat:1", [], 11.0), ("ask", [(12.0, task("repeatAct", "Thanks", pressed=11.9))], 12.0)],
)
def test_the_repetition_of_an_answer_answers_the_same_cue(
    tmp_path: Path, on_failure: str, more: Script, answered: float
) -> None:
    """The robot refuses the answer and says it later: the participant has waited until then."""
    scenario = write_scenario(tmp_path / "tea")
    with (scenario / "scenario.toml").open("a", encoding="utf-8") as file:
        file.write(f'[act.Thanks]\non_failure = "{on_failure}"\n')
    script = [(8.0, task("markCue", pressed=8.0)), act("Thanks", 9.0), *more]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=30.0, faults=("Speech=reject@1",))
    data = read_session(folder)
    failed, heard = data.acts
    (cue,) = data.cues
    assert (failed.status, failed.cue, failed.response_s) == ("ABORTED", None, None)
    assert (cue.state, cue.task, cue.answered_at, heard.cue) == ("answered", heard.task, heard.voice_at, 1)
    assert heard.response_s == heard.answer_s == cue.answer_s == pytest.approx(answered - 8.0, abs=0.1)
    assert (heard.wizard_s, heard.way_s, heard.rules_s) == (0.98, 0.02, pytest.approx(answered - 9.0, abs=0.05))
    parts = (heard.wizard_s, heard.way_s, heard.rules_s, heard.queue_s, heard.robot_s, heard.voice_s)
    assert heard.response_s == pytest.approx(sum(part or 0.0 for part in parts), abs=1e-6)
    compare(list(data.records))

    (judged,) = judge_session(data).cues
    assert judged.decisions["anna"].latency == heard.wizard_s
    report = " ".join(" ".join(text_lines(session_report(data))).split())
    assert f"The robot answered 1 of 1 cue, half of them within {heard.response_s:.2f} s" in report
    assert [each.text for each in spans_of(data) if each.tier == "cue"] == [f"waits {heard.response_s:.2f} s"]
    load_format("tables").write(tmp_path / "out", [data], export_context([folder], "full"))
    with (tmp_path / "out" / "acts.csv").open(encoding="utf-8") as file:
        assert [(row["cue"], row["response_s"]) for row in csv.DictReader(file)] == [
            ("", ""),
            ("1", str(heard.response_s)),
        ]


def test_a_repetition_that_answers_a_later_cue_is_none_of_the_first(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path / "tea")
    with (scenario / "scenario.toml").open("a", encoding="utf-8") as file:
        file.write('[act.Thanks]\non_failure = "repeat:1"\n')
    script = [(8.0, task("markCue")), act("Thanks", 9.0), (10.0, task("markCue"))]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=30.0, faults=("Speech=reject@1",))
    data = read_session(folder)
    assert [(cue.state, cue.task) for cue in data.cues] == [("unheard", 2), ("answered", data.acts[1].task)]
    compare(list(data.records))
