"""Robots and actions are files."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.reading.robot_profiles import package_folders, robot_names
from tests.scenario.folders import act, folder, loaded

ROBOT = """
title = "Bob"
driver = "simulated"
[options]
port = 9
[actions.Speech]
limit = 60
[actions.Animation]
names = ["wave"]
channels = ["arms"]
[actions.LookAt]
[actions.PointAt]
substitute = "LookAt"
[actions.Drive]
channels = ["base"]
seconds = 4
carrier = { action = "/drive" }
parameters.place = { type = "name", required = true, names = ["door", "table"] }
"""
ACT = act(
    "<Drive><actionID>1</actionID><place>door</place></Drive>"
    "<Animation><actionID>2</actionID><value>wave</value></Animation>"
    "<PointAt><actionID>3</actionID><pointx>1</pointx><pointy>0</pointy><pointz>1</pointz></PointAt>"
)


def test_a_new_robot_with_a_new_action_is_a_file(tmp_path: Path) -> None:
    scenario, diagnostics = loaded(
        tmp_path, {"scenario.toml": 'robot = "bob"', "robots/bob.toml": ROBOT, "acts/a.xml": ACT}
    )
    assert diagnostics == []
    robot = scenario.robot
    assert (robot.name, robot.title, robot.driver, robot.options) == ("bob", "Bob", "simulated", {"port": 9})
    assert robot.actions["Drive"].carrier == {"action": "/drive"}
    assert robot.actions["PointAt"].substitute == "LookAt"
    assert not robot.actions["Emotion"].supported
    assert robot.actions["Wait"].supported and robot.actions["Wait"].engine
    assert scenario.acts["A"].channels == {"base", "arms", "gaze"}


def test_a_scenario_declares_actions_of_its_own(tmp_path: Path) -> None:
    toml = '[actions.Drive]\nparameters.place = { type = "text", required = true }\n[actions.Speech]\nlimit = 5\n'
    body = "<Drive><actionID>1</actionID><place>x</place></Drive>"
    scenario, diagnostics = loaded(tmp_path, {"scenario.toml": toml, "acts/a.xml": act(body)})
    assert diagnostics == []
    assert scenario.robot.actions["Drive"].supported
    assert scenario.robot.actions["Speech"].limit == 5
    assert core_actions()["Speech"].limit is None


def test_the_user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder(tmp_path / "config", {"rise-tui/robots/mine.toml": ROBOT})
    folder(tmp_path / "s", {"scenario.toml": ""})
    assert "mine" in robot_names(tmp_path / "s")
    scenario, _ = load(tmp_path / "s", robot="mine")
    assert scenario.robot.title == "Bob"


def test_profiles_of_installed_packages_are_found_without_importing_them() -> None:
    folders = list(package_folders())
    assert any((each / "generic.toml").is_file() for each in folders)


@pytest.mark.parametrize(
    ("profile", "code"),
    [
        ("[actions.PointAt]\nsubstitute = 'Emotion'", "unknown-action"),
        ("[actions.Emotion]\n[actions.LookAt]\nsubstitute = 'Emotion'", "missing-parameter"),
        ("[actions.Speech]\nseconds = 0", "out-of-range"),
        ("[actions.Speech]\nchannels = 'speech'", "wrong-type"),
        ("[actions.Speech]\nnames = ['x']", "wrong-type"),
        ("[actions.Wait]", "wrong-type"),
        ("[actions.Dialog]", "bad-name"),
        ("[actions.X]\nparameters.p = { unit = 'm' }", "wrong-type"),
        ("[actions.X]\nparameters.actionID = { type = 'text' }", "bad-name"),
        ("actions = 3", "wrong-type"),
        ("driver = 3", "wrong-type"),
        ("options = 3", "wrong-type"),
        ("drivr = 'x'", "unknown-key"),
        ("[actions", "toml-syntax"),
    ],
)
def test_broken_profiles(tmp_path: Path, profile: str, code: str) -> None:
    result = loaded(tmp_path, {"scenario.toml": 'robot = "bob"', "robots/bob.toml": profile})
    assert [diagnostic.code for diagnostic in result.diagnostics] == [code]
    assert result.diagnostics[0].location.file == "robots/bob.toml"


def test_names_that_lead_out_of_the_folders_are_no_robots(tmp_path: Path) -> None:
    for name in ("../x", "/etc/x", ".x", "a\\b"):
        assert [f.code for f in load(tmp_path, robot=name).diagnostics] == ["unknown-robot"]


def test_an_action_takes_as_long_as_its_defaults_say() -> None:
    timed = [Parameter("duration", "number", unit="ms", default=1000), Parameter("repetitions", "integer", default=3)]
    turn = ActionSpec("Turn", {each.name: each for each in timed}, seconds=7.0)
    assert [expected_seconds(turn, given) for given in ({}, {"duration": 500}, {"repetitions": 1})] == [3.0, 1.5, 1.0]
