"""BORIS projects: their form by a schema of our own, and what BORIS checks beyond it by rules of our own.

BORIS itself is too large for a test (Qt, mpv). What it refuses (9.12: `check_project_integrity`) is what `rule_errors`
looks for.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session, read_sessions
from rise_engine.results.export.boris import write_boris
from rise_engine.results.export.format import ExportContext
from tests.chance import examples
from tests.results.analysis.samples import make_study, play_session, sessions_of

from .made_sessions import act, point, session, sessions, video

SCHEMA = Draft202012Validator(json.loads(Path(__file__).with_name("boris_project.schema.json").read_text("utf-8")))
Project = dict[str, Any]


def write(folder: Path, *data: SessionData, context: ExportContext | None = None) -> Project:
    out = folder / "study.boris"
    out.unlink(missing_ok=True)
    write_boris(out, data, context or ExportContext("full"))
    found: Project = json.loads(out.read_text("ascii"))
    return found


def errors(project: Project) -> list[str]:
    return [error.message for error in SCHEMA.iter_errors(project)] or rule_errors(project)


def rule_errors(project: Project) -> list[str]:
    """What no schema can say: rows in pairs, names that are known, one code for one behaviour."""
    behaviors = list(project["behaviors_conf"].values())
    by_code = {each["code"]: each for each in behaviors}
    subjects = {each["name"] for each in project["subjects_conf"].values()}
    labels = {each["label"] for each in project["independent_variables"].values()}
    found = [f"code twice: {code}" for code, count in Counter(each["code"] for each in behaviors).items() if count > 1]
    found += [f"pipe in {code}" for code in by_code if "|" in code]
    found += [
        f"category {each['category']}" for each in behaviors if each["category"] not in project["behavioral_categories"]
    ]
    for name, observation in project["observations"].items():
        events = observation["events"]
        found += [f"{name}: not in order"] if [e[:3] for e in events] != sorted(e[:3] for e in events) else []
        found += [f"{name}: variable {each}" for each in observation["independent_variables"].keys() - labels]
        found += _file_errors(observation)
        begun: dict[tuple[str, str, str], float] = {}
        for seconds, subject, code, modifiers, _ in events:
            if subject not in subjects or (behavior := by_code.get(code)) is None:
                found.append(f"{name}: unknown {subject} or {code}")
                continue
            sets = behavior["modifiers"].values()
            values = modifiers.split("|") if modifiers else []
            if len(values) != len(sets) or any(
                value not in each["values"] for value, each in zip(values, sets, strict=True)
            ):
                found.append(f"{name}: modifiers {modifiers} of {code}")
            key = (subject, code, modifiers)
            if behavior["type"] == "Point event":
                continue
            if key not in begun:
                begun[key] = seconds
            elif begun.pop(key) >= seconds:
                found.append(f"{name}: {code} has no length")
        found += [f"{name}: {key} does not end" for key in begun]
    return found


def _file_errors(observation: Project) -> list[str]:
    files = [path for paths in observation["file"].values() for path in paths]
    told = observation.get("media_info") or {}
    missing = [
        (info, path) for path in files for info in ("length", "fps", "hasVideo", "hasAudio") if path not in told[info]
    ]
    return [f"{path} has no {info}" for info, path in missing] + [
        f"player {each} has no offset" for each in observation["file"].keys() - told.get("offset", {}).keys()
    ]


def test_a_real_session(real: SessionData, tmp_path: Path) -> None:
    project = write(tmp_path, real)
    assert errors(project) == []
    (observation,) = project["observations"].values()
    events = observation["events"]
    assert (observation["type"], observation["date"]) == ("LIVE", "2024-11-23T09:30:00")
    assert [12.52, "robot", "Answer", "wizard|act", ""] in events and [
        17.729,
        "robot",
        "Answer",
        "wizard|act",
        "",
    ] in events
    assert [11.02, "robot", "Hm", "wizard|filler", ""] in events
    assert [13.52, "robot", "robot speech", "", "That is a very good question, let us have a look at it."] in events
    assert [9.97, "participant", "cue", "", "waits 3.55 s (asks something)"] in events
    assert [each[0] for each in events if each[2] == "waits for an answer"][:2] == [9.97, 13.52]
    assert [each[0] for each in events if each[2] == "cue taken back"] == [28.0]
    assert [54.0, "wizard", "note", "", "Zelda looks away"] in events
    assert len([each for each in events if each[2] == "Visit: Talk"]) == 6


def test_a_whole_study_is_one_project_with_its_conditions(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    data = list(read_sessions(sessions_of(study)))
    project = write(tmp_path, *data)
    assert errors(project) == []
    assert list(project["observations"]) == [each.facts.session for each in data]
    told = [each["independent_variables"] for each in project["observations"].values()]
    assert [(each["participant"], each["condition"]) for each in told] == [
        (each.facts.participant, each.facts.condition) for each in data
    ]
    assert (
        {each["label"] for each in project["independent_variables"].values()} >= data[-1].facts.factors.keys() > set()
    )


@settings(max_examples=examples(40))
@given(data=st.lists(sessions(), max_size=2))
def test_any_sessions_make_a_sound_project(data: list[SessionData], tmp_path_factory: pytest.TempPathFactory) -> None:
    project = write(tmp_path_factory.getbasetemp(), *data)
    assert errors(project) == []
    assert len(project["observations"]) == len(data)


def test_recordings_with_length_and_frames_make_a_media_observation(tmp_path: Path) -> None:
    media = (
        video(offset=2.5, duration=91.5),
        video("/data/face.mp4", offset=-1.25, fps=29.97),
        video("voice.wav", kind="audio", offset=2.5, fps=None),
    )
    data = session(tmp_path, media=media, acts=(act(10, 20),), points=(point(1.0),))
    project = write(tmp_path, data)
    assert errors(project) == []
    (observation,) = project["observations"].values()
    room, voice = str(tmp_path / "room.mp4"), str(tmp_path / "voice.wav")
    assert observation["file"] == {"1": [room], "2": ["/data/face.mp4"], "3": [voice]}
    assert observation["media_info"] == {
        "length": {room: 91.5, "/data/face.mp4": 90.0, voice: 90.0},
        "fps": {room: 25.0, "/data/face.mp4": 29.97, voice: 0.0},
        "hasVideo": {room: True, "/data/face.mp4": True, voice: False},
        "hasAudio": {room: True, "/data/face.mp4": True, voice: True},
        "offset": {"1": 0.0, "2": 3.75, "3": 0.0},  # the face begins 3.75 s later than the room
        "display": {room: "Nothing"},
    }
    assert observation["type"] == "MEDIA"
    assert [each[:3] for each in observation["events"]] == [
        [3.5, "wizard", "note"],
        [12.5, "robot", "R_Hello"],
        [22.5, "robot", "R_Hello"],
    ]


@pytest.mark.parametrize("unknown", [{"fps": None}, {"duration": None}, {"offset": None}])
def test_without_length_frames_or_place_the_observation_is_live(unknown: dict[str, None], tmp_path: Path) -> None:
    context = ExportContext("full")
    data = session(tmp_path, media=(video(**unknown),), points=(point(1.0),))
    (observation,) = write(tmp_path, data, context=context)["observations"].values()
    assert (observation["type"], observation["file"], observation["events"][0][0]) == ("LIVE", {}, 1.0)
    assert len([each for each in context.warnings if "room.mp4" in each and "not known" in each]) == 1


def test_what_overlaps_is_a_behaviour_of_its_own_and_no_code_stands_twice(tmp_path: Path) -> None:
    acts = (act(1, 5, "A"), act(2, 3, "A"), act(2, 4, "A", actor="rule"), act(8, 9, "note"))
    project = write(tmp_path, session(acts=acts, points=(point(7.0),)))
    assert errors(project) == []
    (observation,) = project["observations"].values()
    told = [(code, modifiers) for _, _, code, modifiers, _ in observation["events"]]
    assert Counter(told) == {
        ("A", "wizard|act"): 2,
        ("A 2", "wizard|act"): 2,
        ("A", "rule|act"): 2,
        ("note", "wizard|act"): 2,
        ("note (session)", ""): 1,
    }


def test_an_act_of_no_length_has_a_millisecond_in_time_budgets(tmp_path: Path) -> None:
    project = write(tmp_path, session(acts=(act(2, 2, "Blink"),)))
    (observation,) = project["observations"].values()
    assert [(each[0], each[2]) for each in observation["events"]] == [(2.0, "Blink"), (2.001, "Blink")]


@pytest.mark.parametrize("level", ["shared", "public"])
def test_other_levels_tell_no_date_and_nothing_private(level: ExportLevel, tmp_path: Path) -> None:
    project = write(tmp_path, read_session(play_session(tmp_path / "lab"), level=level))
    text = json.dumps(project)
    assert errors(project) == []
    assert "2024" not in text and "Zelda" not in text and "anna" not in text and str(tmp_path) not in text


BROKEN: dict[str, Callable[[Project, list[Any]], object]] = {
    "a state that does not end": lambda project, events: events.remove(
        next(each for each in events if each[2] == "Hm")
    ),
    "a code twice": lambda project, events: project["behaviors_conf"].update({"999": project["behaviors_conf"]["0"]}),
    "a short row": lambda project, events: events[0].pop(),
    "no subjects": lambda project, events: project.pop("subjects_conf"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_broken_copies_are_refused(what: str, real: SessionData, tmp_path: Path) -> None:
    """Two by the schema, two by the rules."""
    project = write(tmp_path, real)
    (observation,) = project["observations"].values()
    BROKEN[what](project, observation["events"])
    assert errors(project) != []
