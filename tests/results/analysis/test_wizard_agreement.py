"""Wizards compared: what each decided about the same cues, over sessions, conditions and more than two of them."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.results.analysis.agreement import cohen_kappa, compare_wizards
from rise_engine.results.analysis.judged_cues import NOTHING, Decision, JudgedSession, decision_label, judge_session
from rise_engine.results.analysis.reading import read_session
from rise_engine.session.shadow import (
    ShadowCue,
    ShadowEnd,
    ShadowKey,
    ShadowPause,
    ShadowPlay,
    ShadowWriter,
    read_shadows,
)
from tests.commands import typed
from tests.results.analysis.cues import ACT, add_shadow, cue_numbers, make_session
from tests.results.analysis.samples import make_study, sessions_of

BEN = [(1.4, "act", "Praise"), (1.2, "act", "Hint"), (1.5, "event", "next"), None, (1.1, "say", "Yours")]
CARL = [(1.0, "act", "Praise"), (1.9, "act", "Repeat"), None]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_session(tmp_path)


def judged(folder: Path) -> JudgedSession:
    return judge_session(read_session(folder))


def decisions(session: JudgedSession, wizard: str) -> list[tuple[str, float | None] | None]:
    found = [cue.decisions.get(wizard) for cue in session.cues]
    return [None if each is None else (each.label, each.latency) for each in found]


def agree(*arguments: object) -> Any:
    return typed("agree", *arguments)


# --- who decided what -------------------------------------------------------------------------------------------------


def test_what_each_decided(folder: Path) -> None:
    """Anna's filler is no decision; the event is hers, the act that a rule then starts is not. Times are from the key
    of the cue, 0.02 s before it arrived, for both."""
    add_shadow(folder, "ben", BEN)
    session = judged(folder)
    assert session.live == "anna"
    assert decisions(session, "anna") == [
        ("Praise", 1.2),
        ("Repeat", 1.5),
        ("event /next", 1.0),
        (NOTHING, None),
        ("say", 0.9),
    ]
    assert decisions(session, "ben") == [
        *(("Praise", 1.42), ("Hint", 1.22), ("event /next", 1.52), (NOTHING, None), ("say", 1.12))
    ]
    assert not session.remarks


def test_what_was_not_shown_is_missing_and_not_unanswered(folder: Path) -> None:
    add_shadow(folder, "carl", CARL, complete=False)
    session = judged(folder)
    assert decisions(session, "carl") == [("Praise", 1.02), ("Repeat", 1.92), None, None, None]
    assert session.remarks == [f"carl did not see {folder.name} to its end; later cues are missing, not unanswered"]


def test_a_cue_that_was_taken_back_counts_for_nobody(tmp_path: Path) -> None:
    folder = make_session(tmp_path, [(1.0, "cue", ""), (2.0, "undo", ""), (5.0, "cue", ""), (6.0, "act", "Praise")])
    add_shadow(folder, "ben", [(0.5, "act", "Repeat"), (1.0, "act", "Praise")], times=(1.0, 5.0))
    session = judged(folder)
    assert session.undone == 1
    assert [(cue.number, cue.decisions["ben"].label) for cue in session.cues] == [(2, "Praise")]


def write_lines(folder: Path, *lines: Any) -> None:
    writer = ShadowWriter.begin(folder, "ben")
    for line in lines:
        writer.append(line)
    writer.close()


def test_the_last_time_that_a_cue_was_shown_counts(folder: Path) -> None:
    one, two, *_ = cue_numbers(folder)
    write_lines(
        folder,
        *(ShadowPlay(0.0), ShadowCue(1.0, one), ShadowKey(t=2.0, function="nextFiller", cue=one, filler=True)),
        *(ShadowPause(3.0), ShadowPlay(1.0), ShadowCue(1.0, one)),
        ShadowKey(t=2.5, function=ACT, behavior="Hint", cue=one),
        ShadowKey(t=2.7, function=ACT, behavior="Praise", cue=None),
        *(ShadowCue(10.0, two), ShadowPause(11.0), ShadowPlay(11.0)),
        ShadowKey(t=12.0, function=ACT, behavior="Repeat", cue=two),
    )
    found = [cue.decisions.get("ben") for cue in judged(folder).cues[:3]]
    assert found == [Decision("Hint", 1.52), Decision("Repeat", None, "paused"), None]


def test_a_session_at_another_speed_has_no_latencies_of_its_wizard(folder: Path) -> None:
    add_shadow(folder, "ben", BEN)
    data = read_session(folder)
    session = judge_session(replace(data, facts=replace(data.facts, speed=4.0)))
    live = [cue.decisions["anna"] for cue in session.cues]
    assert {(each.latency, each.why) for each in live if each.label != NOTHING} == {(None, "another speed")}
    assert any(cue.decisions["ben"].latency is not None for cue in session.cues)
    assert session.remarks == [f"anna ran {folder.name} at 4 times real time: no latencies of that wizard"]


def test_the_shadow_of_another_session_is_left_out(folder: Path) -> None:
    one, two, *_ = cue_numbers(folder)
    write_lines(folder, ShadowPlay(0.0), ShadowCue(1.0, one), ShadowCue(12.5, two), ShadowEnd(50.0))
    session = judged(folder)
    assert all("ben" not in cue.decisions for cue in session.cues)
    assert session.remarks == [
        f"{folder.name}: shadow/1.jsonl shows cue {two} at 12.500 s, and the journal has it at 10.000 s: it is of "
        "another session, and left out"
    ]


def test_at_another_speed_there_are_no_latencies(folder: Path) -> None:
    add_shadow(folder, "ben", BEN, speed=2.0)
    session = judged(folder)
    assert decisions(session, "ben")[0] == ("Praise", None)
    assert session.remarks == [f"ben judged {folder.name} at 2 times its speed: no latencies"]


def test_of_several_times_the_last_one_to_the_end_counts(folder: Path) -> None:
    add_shadow(folder, "ben", [(1.0, "act", "Hint")], complete=False)
    add_shadow(folder, "ben", BEN)
    add_shadow(folder, "ben", [(1.0, "act", "Repeat")], complete=False)
    session = judged(folder)
    assert decisions(session, "ben")[0] == ("Praise", 1.42)
    assert any("judged" in each and "more than once" in each for each in session.remarks)


def test_who_judges_their_own_session_is_told_apart(folder: Path) -> None:
    add_shadow(folder, "anna", BEN)
    assert list(judged(folder).cues[0].decisions) == ["anna", "anna (again)"]


def test_labels_tell_no_value_that_somebody_typed(folder: Path) -> None:
    from rise_engine.results.analysis.judged_cues import _scenario_of

    scenario = _scenario_of(folder)
    labels = [
        decision_label(scenario, function, behavior)
        for function, behavior in (
            ("assignValue", "mood = 'good'"),
            ("assignValue", "mood = 'like Maria'"),
            ("assignValue", "= nonsense"),
            ("say", "Hello Maria"),
            ("raiseEventTopic", '{"event": "/go", "keep": "2s"}'),
            ("startInteractionRule", '{"rule": "Task", "state": "Busy"}'),
            ("stepBack", '{"rule": "Task", "take_back": ["mood"]}'),
            ("stepBack", '{"x": 1}'),
            ("cancelTask", "17"),
            ("stopCommunicationRobotAct", "Praise"),
            ("stopAll", ""),
        )
    ]
    assert labels == [
        *("set mood = 'good'", "set mood", "set ?", "say", "event /go", "rule Task", "step back Task", "step back"),
        *("cancel a task", "stop Praise", "stop all"),
    ]


# --- statistics -------------------------------------------------------------------------------------------------------


def test_statistics_are_of_what_both_have_judged(folder: Path) -> None:
    add_shadow(folder, "ben", BEN, marks=[(2, "wrong")])
    add_shadow(folder, "carl", CARL, complete=False)
    report = compare_wizards([judged(folder)])
    assert report.wizards == ["anna", "ben", "carl"]
    (group,) = report.groups
    assert [(pair.first, pair.second, pair.percent.n) for pair in group.pairs] == [
        *(("anna", "ben", 5), ("anna", "carl", 2), ("ben", "carl", 2))
    ]
    kappa = cohen_kappa([("p", "p"), ("r", "h"), ("n", "n"), ("-", "-"), ("s", "s")])
    assert group.pairs[0].kappa.value == pytest.approx(kappa.value)
    assert group.pairs[0].latency.mean == pytest.approx((0.22 - 0.28 + 0.52 + 0.22) / 4)
    assert group.pairs[1].icc.value is None and "needs 3 cues" in group.pairs[1].icc.why
    assert group.units == 5 and group.alpha.value is not None


def test_by_condition_and_over_sessions(tmp_path: Path) -> None:
    report = compare_wizards(
        judged(_with_shadow(tmp_path / name, name, condition)) for name, condition in (("P01", "a"), ("P02", "b"))
    )
    assert [(group.group, group.units) for group in report.groups] == [("", 10), ("a", 5), ("b", 5)]
    assert report.sessions == 2


def _with_shadow(root: Path, participant: str, condition: str) -> Path:
    folder = make_session(root, participant=participant, condition=condition)
    add_shadow(folder, "ben", BEN)
    return folder


def test_marks_for_mistakes_are_compared_where_two_have_marked(folder: Path) -> None:
    speech = judged_task(folder, "say")
    add_shadow(folder, "ben", BEN, marks=[(speech, "wrong"), (judged_task(folder, "Praise"), "none")])
    report = compare_wizards([judged(folder)])
    assert report.marked is not None
    (pair,) = report.marked.pairs
    assert (pair.percent.n, pair.percent.value) == (5, 0.8)  # Praise, Hm, Repeat, /next: none by both; say: late, wrong
    assert [act.marks for act in report.marks if act.task == speech] == [{"anna": "late", "ben": "wrong"}]
    first = folder / "shadow" / "1.jsonl"
    first.write_bytes(b"".join(line for line in first.read_bytes().splitlines(True) if b'"mark"' not in line))
    assert compare_wizards([judged(folder)]).marked is None


def judged_task(folder: Path, act: str) -> int:
    return next(each.task for each in read_session(folder).acts if each.act == act)


# --- the command ------------------------------------------------------------------------------------------------------


def test_as_text(folder: Path) -> None:
    add_shadow(folder, "ben", BEN)
    result = agree(folder)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[0] == "5 cues of 1 session; wizards: anna, ben"
    assert "P01          2    0:10.0  Repeat  1.50 s       Hint  1.22 s         differ" in lines
    assert "    the same decision                       80.0 %  [38, 96] %   (of 5 cues)" in lines
    assert "      1 x  anna: Repeat   ben: Hint" in lines
    assert any(line.startswith("  Percent agreement does not know") for line in lines)
    assert "  Fewer than 30 cues: intervals are wide, and that of kappa is too narrow." in lines
    assert all(len(line) <= 100 for line in lines)


def test_as_a_table(folder: Path) -> None:
    add_shadow(folder, "ben", BEN)
    rows = list(csv.DictReader(io.StringIO(agree(folder, "--format", "csv").stdout)))
    assert len(rows) == 10
    assert rows[0] == {
        "session": folder.name,
        "participant": "P01",
        "condition": "",
        "cue": "1",
        "cue_at_s": "0.98",
        "wizard": "anna",
        "decision": "Praise",
        "latency_s": "1.2",
        "why_no_latency": "",
    }


def test_as_json_for_others_nobody_is_named(folder: Path) -> None:
    add_shadow(folder, "ben", BEN, marks=[(1, "wrong")])
    result = agree(folder, "--format", "json", "--level", "shared")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["wizards"] == ["W1", "W2"]
    assert found["cues"][0]["decisions"]["W2"] == {"label": "Praise", "latency": 1.42, "why": ""}
    assert found["statistics"][0]["pairs"][0]["percent"]["value"] == 0.8
    for word in ("anna", "ben", "Maria", "Yours", "2024-", "2026-"):
        assert word not in result.stdout


def test_nothing_to_compare_is_said(folder: Path) -> None:
    result = agree(folder)
    assert result.exit_code == 2
    assert "rise-tui --shadow SESSION plays its cues to a second wizard" in result.stderr
    (folder / "shadow").mkdir()
    (folder / "shadow" / "1.jsonl").write_text("broken\n")
    broken = agree(folder)
    assert broken.exit_code == 0  # the first wizard alone: nobody to compare with, and why
    assert "does not say who judges" in broken.stdout


def test_one_wizard_whose_categories_are_one_gets_a_sentence(tmp_path: Path) -> None:
    folder = make_session(
        tmp_path, [(1.0, "cue", ""), (2.0, "act", "Praise"), (9.0, "cue", ""), (9.9, "act", "Praise")]
    )
    add_shadow(folder, "ben", [(1.0, "act", "Praise")] * 2, times=(1.0, 9.0))
    text = " ".join(agree(folder).stdout.split())
    assert "Cohen's kappa no number: all of them always chose the same (Praise)" in text


def test_a_new_file_and_never_over_another(folder: Path, tmp_path: Path) -> None:
    add_shadow(folder, "ben", BEN)
    out = tmp_path / "agreement.csv"
    assert agree(folder, "--format", "csv", "-o", out).exit_code == 0
    before = out.read_bytes()
    assert out.stat().st_mode & 0o777 == 0o600
    again = agree(folder, "--format", "json", "-o", out)
    assert again.exit_code == 2 and "is there already" in again.stderr
    assert out.read_bytes() == before


def test_of_a_study_the_log_knows_what_was_written(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    folders = sessions_of(study)
    for each in folders[1:3]:
        add_shadow(each, "ben", [(1.0, "act", "Answer")] * 3, times=(5.0, 20.0, 30.0))
    result = agree(study, "-o", study / "agreement.txt")
    assert result.exit_code == 0, result.stderr
    assert "without a second wizard" in result.stderr
    noted, written = map(json.loads, (study / "study.jsonl").read_text().splitlines()[-2:])
    assert written["kind"] == "written"
    assert noted["kind"] == "exported" and noted["path"] == "agreement.txt" and noted["format"] == "agree text"
    assert set(noted["sessions"]) == {each.name for each in folders[1:3]}


def test_a_shadow_stays_what_it_is(folder: Path) -> None:
    """Comparing changes nothing."""
    add_shadow(folder, "ben", BEN)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    agree(folder)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert len(read_shadows(folder)[0]) == 1
