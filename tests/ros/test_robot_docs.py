"""The pages about robots and actions work as written: their files are loaded, checked and made into messages."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket
from types import ModuleType
from typing import Any

import pytest
from msgspec.structs import replace
from rise_adapters.ros2.actions.server import RESULT_TIMEOUT
from rise_adapters.ros2.mapping import ActionMapping, RosOptions, mapping_findings, read_mappings, read_options
from rise_adapters.ros2.mapping.action_mapping import ResultRule
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.ports.robot import Driver, RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.parameters import convert_parameter, fill_parameters
from rise_engine.scenario.reading.robot_profiles import read_profile
from tests.patience import PATIENCE
from tests.ros.layouts import LAYOUTS, looked_up
from tests.ros.zora import FOLDER as ZORA
from tests.scenario.folders import folder
from tests.scenarios.played import Played, process

DOCS = Path(__file__).parents[2] / "docs"
ROBOTS = (DOCS / "reference" / "robots.md").read_text(encoding="utf-8")
FILES = re.compile(
    r"^\*\*`my-study/(?P<path>[\w./-]+)`(?:, continued)?\*\*\n\n```\w*\n(?P<content>.*?)^```$", re.M | re.S
)
FOREIGN = re.compile("^(nav2|control)_msgs")
"""Whose definitions the tests do not have; Zora's are of the same form."""
BLOCKS = re.compile(r"^```(?P<language>\w+)\n(?P<content>.*?)^```$", re.M | re.S)


# --- how-to guides --------------------------------------------------------------------------------------------------


def write_files(page: str, to: Path) -> str:
    """What somebody who follows the page has in the end. Returns the page."""
    text = (DOCS / "how-to" / page).read_text(encoding="utf-8")
    for match in FILES.finditer(text):
        file = to / "my-study" / match["path"]
        file.parent.mkdir(parents=True, exist_ok=True)
        before = file.read_text(encoding="utf-8") if file.exists() else ""
        file.write_text(before + match["content"], encoding="utf-8")
    return text


def robot_of(loaded: LoadResult) -> RobotProfile:
    assert [finding for finding in loaded.diagnostics if finding.severity == "error"] == []
    assert loaded.scenario is not None
    return loaded.scenario.robot


def goals(loaded: LoadResult, act: str, types: InterfaceCatalog) -> dict[str, Any]:
    """The messages that an act makes, by the name that they are sent to."""
    robot = robot_of(loaded)
    mappings = read_mappings(robot, types.fields)
    assert loaded.scenario is not None
    made = {}
    for action in loaded.scenario.acts[act].actions:
        call = action.calls[0]
        spec = robot.actions[call.type]
        parameters = fill_parameters(call, spec, {})
        if spec.substitute is not None:
            spec = robot.actions[spec.substitute]
            parameters = {name: value for name, value in parameters.items() if name in spec.parameters}
        carrier = mappings[spec.name]
        frame = read_options(robot).frame
        made[carrier.name] = carrier.make_message(parameters, node="/rise", goal="4/1", frame=frame)
        type = f"{carrier.type}_Goal" if carrier.kind == "action" else carrier.type
        types.codec(type).pack(made[carrier.name])  # raises when it does not fit
    return made


def test_add_a_robot(tmp_path: Path) -> None:
    page = write_files("add-a-robot.md", tmp_path)
    study = tmp_path / "my-study"
    types = InterfaceCatalog(environment={})

    bob = load(study)
    assert goals(bob, "R_Hello", types) == {
        "bob/speech": {"message": "Hello!", "rate": 1.0, "volume": 1.0},
        "bob/animation": {"name": "wave", "repetitions": 1, "scale": 1.0},
        "bob/look_at": {
            "target": {"header": {"frame_id": "torso"}, "point": {"x": 1.0, "y": 0.5, "z": 1.2}},
            "roll": 0.0,
        },
    }

    (study / "none").mkdir()
    bella = read_mappings(robot_of(load(study, robot="bella", paths={"acts": "none"})), types.fields)
    assert sorted(bella) == ["Emotion", "LookAt", "Speech"]
    face = bella["Emotion"]
    assert (face.kind, face.name) == ("topic", "bella/face")
    shown = face.make_message({"value": "fear", "duration": 2000}, node="/rise", goal="4/1", frame="f")
    assert shown == {"data": "scared"} and face.make_reset() == {"data": "neutral"}
    said = bella["Speech"].make_message({"message": "Hi"}, node="/rise", goal="4/1", frame="f")
    assert said == {"meta": {"caller": "/rise", "priority": 150}, "input": "Hi"}
    assert "publishes `scared` on `bella/face`, and `neutral`" in page

    zora = robot_of(load(study, robot="zora", paths={"acts": "none"}))
    actions = {
        name: replace(spec, carrier={**spec.carrier, "type": FOREIGN.sub("zora_interfaces", spec.carrier["type"])})
        for name, spec in zora.actions.items()
        if spec.carrier
    }
    zora = replace(zora, actions=actions)
    own = InterfaceCatalog([ZORA / "share"], environment={})
    assert mapping_findings(zora, own.fields) == []
    mapped = read_mappings(zora, own.fields)
    drives = mapped["Go"].make_message({"place": "table"}, node="/rise", goal="4/1", frame="f")
    assert (drives["pose"]["header"]["frame_id"], drives["pose"]["pose"]["position"]["y"]) == ("map", 2.0)
    assert [name for name, each in mapped.items() if not each.stoppable] == ["Speech"]

    refused = load(study, robot="bella")
    assert [finding.code for finding in refused.diagnostics] == ["robot-cannot", "robot-cannot"]


def test_the_driver_of_add_a_robot(tmp_path: Path) -> None:
    """The whole example, against a lamp that is a socket: what it is sent, and what it reports."""
    write_files("add-a-robot.md", tmp_path)
    packaging = (DOCS / "examples/lamp/pyproject.toml").read_text("utf-8")
    assert tomllib.loads(packaging)["project"]["entry-points"]["rise.drivers"] == {"lamp": "lamp:Lamp"}
    lamp = ModuleType("lamp")
    exec(compile((DOCS / "examples/lamp/lamp.py").read_text("utf-8"), "lamp.py", "exec"), lamp.__dict__)
    findings = Diagnostics()
    profile = read_profile(tmp_path / "my-study/robots/lamp.toml", "lamp", FileReader(tmp_path, findings))
    assert profile.driver == "lamp" and not findings.errors
    with pytest.raises(ValueError, match="number of the lamp's UDP port"):
        lamp.Lamp(replace(profile, options={}), VirtualClock(), 1)

    with socket(AF_INET, SOCK_DGRAM) as bulb:
        bulb.bind(("127.0.0.1", 0))
        bulb.settimeout(PATIENCE)
        clock = VirtualClock()
        driver: Driver = lamp.Lamp
        robot = driver(replace(profile, options={"port": bulb.getsockname()[1]}), clock, 1)
        reports: list[RobotReport] = []
        robot.connect(reports.append)
        assert reports == [RobotChanged(status="connected", detail=f"Lamp at 127.0.0.1:{bulb.getsockname()[1]}")]
        del reports[:]

        robot.start(StartAction("1/1", "Emotion", {"value": "happy"}, 2.0))
        assert bulb.recv(100) == b"yellow"
        while clock.next_at is not None:
            clock.advance()
        assert clock.now() == 2.0 and bulb.recv(100) == b"off"
        robot.start(StartAction("2/1", "Emotion", {"value": "bored"}, 2.0))
        robot.start(StartAction("3/1", "Emotion", {"value": "sad"}, 2.0))
        robot.cancel("3/1")
        robot.cancel("3/1")
        robot.start(StartAction("4/1", "Emotion", {"value": "angry"}, 2.0))
        robot.stop_all()
        assert [bulb.recv(100) for _ in range(4)] == [b"blue", b"off", b"red", b"off"]
        told = [(each.action, each.status, each.reason) for each in reports if isinstance(each, ActionReport)]
        assert told == [
            ("1/1", "accepted", ""),
            ("1/1", "succeeded", ""),
            ("2/1", "failed", "no colour stands for bored"),
            ("3/1", "accepted", ""),
            ("3/1", "canceled", ""),
            ("4/1", "accepted", ""),
            ("4/1", "canceled", ""),
        ]
        assert reports[-1] == StopReport(unconfirmed=("lamp (it gives no answer)",))
        before = len(reports)
        robot.start(StartAction("5/1", "Emotion", {"value": "sad"}, 2.0))
        robot.close()
        assert [each.status for each in reports[before:] if isinstance(each, ActionReport)] == ["accepted"]


def test_the_commands_of_add_a_robot(tmp_path: Path) -> None:
    page = write_files("add-a-robot.md", tmp_path)
    for line in re.findall(r"^    rise-engine (.*)$", page, re.M):
        arguments = [str(tmp_path / word) if word == "my-study" else word for word in line.split()]
        if "real" in arguments or "doctor" in arguments:
            continue  # needs Bob, or Zora
        result = process([*arguments, *(["--speed", "max", "--json", "--strict"] if arguments[0] == "run" else [])])
        assert result.returncode == ("bella" in arguments), (line, result.stderr.decode())
        if arguments[0] == "run":
            assert Played(result.stdout).said() == ["Hello!"]


def test_add_an_action(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = write_files("add-an-action.md", tmp_path)
    study = tmp_path / "my-study"
    loaded = load(study)
    types = InterfaceCatalog([study / "share"], environment={})
    sent = goals(loaded, "R_Tour", types)
    examples = [json.loads(block["content"]) for block in BLOCKS.finditer(page) if block["language"] == "json"]
    assert [sent["pepper/drive"]] == examples
    assert sent["pepper/speech"]["message"] == "Please follow me."

    drive = read_mappings(robot_of(loaded), types.fields)["Drive"]
    assert drive.deadlines.acceptance == 5
    assert drive.result_rule.failure({"arrived": False, "reason": "a chair is in the way"}) == "a chair is in the way"
    assert drive.result_rule.failure({"arrived": True, "reason": ""}) == ""

    act = study / "acts" / "tour.xml"
    act.write_text(act.read_text(encoding="utf-8").replace(">door<", ">window<"), encoding="utf-8")
    (mistake,) = [finding for finding in load(study).diagnostics if finding.severity == "error"]
    assert mistake.code == "unknown-name" and mistake.location.line == 3 and "`door`, `table`" in mistake.message

    monkeypatch.setenv("HOME", str(tmp_path))
    (option,) = re.findall(r"`(share = .*?)` in `\[options\]`", page)
    robot = RobotProfile("pepper", "Pepper", "ros2", {}, tomllib.loads(option))
    assert read_options(robot).share == (str(study / "share"),)


def test_the_steps_of_add_an_action(tmp_path: Path) -> None:
    """Without its carrier the action can be rehearsed; on a topic, it goes without a type of its own."""
    page = write_files("add-an-action.md", tmp_path)
    study = tmp_path / "my-study"
    settings = study / "scenario.toml"
    declared = next(FILES.finditer(page))["content"]
    settings.write_text(declared, encoding="utf-8")
    assert process(["check", str(study)]).returncode == 0
    result = process(["run", str(study), "--act", "R_Tour", "--speed", "max", "--json", "--strict"])
    assert result.returncode == 0 and Played(result.stdout).said() == ["Please follow me."]

    last = [block["content"] for block in BLOCKS.finditer(page) if block["language"] == "toml"][-1]
    settings.write_text(declared + last, encoding="utf-8")
    shown = goals(load(study), "R_Tour", InterfaceCatalog(environment={}))["pepper/drive"]
    (told,) = re.findall(r"gets `(\{.*\})`", page)
    assert json.loads(shown["data"]) == json.loads(told)


# --- the reference --------------------------------------------------------------------------------------------------

WAVE = next(block["content"] for block in BLOCKS.finditer(ROBOTS) if block["content"].startswith("[actions.Wave]"))
DECLARED = WAVE.split("[actions.Wave.carrier]")[0]
WAVE_TYPES = {
    "bob_interfaces/action/Wave_Goal": {"arm": "string", "settings": "bob_interfaces/msg/Settings", "caller": "string"},
    "bob_interfaces/action/Wave_Result": {"result": "bob_interfaces/msg/Result"},
    "bob_interfaces/action/Wave_Feedback": {},
    "bob_interfaces/msg/Settings": {"times": "int32", "height": "float64"},
    "bob_interfaces/msg/Result": {"code": "uint8", "message": "string"},
}


def read(
    at: Path, profile: str, layouts: Mapping[str, Mapping[str, str]]
) -> tuple[RobotProfile, dict[str, ActionMapping]]:
    folder(at, {"scenario.toml": 'robot = "bob"', "robots/bob.toml": f'driver = "ros2"\n{profile}'})
    robot = robot_of(load(at))
    return robot, read_mappings(robot, lambda type: looked_up({**LAYOUTS, **layouts}, type))


def test_the_example_of_the_reference(tmp_path: Path) -> None:
    robot, mappings = read(tmp_path, WAVE, WAVE_TYPES)
    (act,) = re.findall(r"^`(<Wave>.*</Wave>)` is sent", ROBOTS, re.M)
    folder(tmp_path, {"acts/a.xml": f'<Dialog name="A">{act}</Dialog>'})
    loaded = load(tmp_path)
    assert loaded.scenario is not None
    call = loaded.scenario.acts["A"].actions[0].calls[0]
    goal = mappings["Wave"].make_message(
        fill_parameters(call, robot.actions["Wave"], {}), node="/rise", goal="4/1", frame="base_link"
    )
    (shown,) = [json.loads(block["content"]) for block in BLOCKS.finditer(ROBOTS) if block["language"] == "json"]
    assert goal == shown
    assert mappings["Wave"].deadlines.acceptance == 1


def rule_lines() -> list[str]:
    """The rows of the table "What fills a field"."""
    return ROBOTS[ROBOTS.index("| written | type of the field |") :].split("\n\n")[0].splitlines()[2:]


def rules() -> list[tuple[str, ...]]:
    row = re.compile(r"\| `(?P<written>.*?)` \| `(?P<type>\S+)` \| (?P<given>.*?) ?\| (?P<gets>.*) \|$")
    found = [row.match(line) for line in rule_lines()]
    return [tuple(cell.replace("\\|", "|") for cell in each.groups()) for each in found if each is not None]


def test_every_row_is_read() -> None:
    assert len(rules()) == len(rule_lines()) > 20


@pytest.mark.parametrize(("written", "type", "given", "gets"), rules())
def test_what_fills_a_field(tmp_path: Path, written: str, type: str, given: str, gets: str) -> None:
    goal = f"goal = {{ field = {written} }}"
    carrier = f'carrier = {{ action = "bob/wave", type = "bob_interfaces/action/Wave", {goal} }}'
    layouts = {**WAVE_TYPES, "bob_interfaces/action/Wave_Goal": {"field": type}}
    robot, mappings = read(tmp_path, f"{DECLARED}\n{carrier}", layouts)
    parameters = {}
    for name, value in re.findall(r"`(\w+)` = `(.*?)`", given):
        parameters[name] = convert_parameter(robot.actions["Wave"].parameters[name], value)
    message = mappings["Wave"].make_message(parameters, node="/rise", goal="4/1", frame="base_link")
    if gets == "left at zero":
        assert message == {}
    else:
        value = json.loads(gets.strip("`"))
        assert message == {"field": value}
        assert isinstance(message["field"], value.__class__)


def test_what_a_result_says(tmp_path: Path) -> None:
    _, mappings = read(tmp_path, WAVE, WAVE_TYPES)
    rows = re.findall(r"^\| `(\{\"result\".*\})` \| (.*) \|$", ROBOTS, re.M)
    assert len(rows) == 3
    for result, outcome in rows:
        failure = mappings["Wave"].result_rule.failure(json.loads(result))
        assert outcome == (f"failed: {failure}" if failure else "succeeded")
    rated = ResultRule(("success_rate",), ok=(), minimum=0.5)
    rows = re.findall(r"^\| `(\{\"success_rate\".*\})` \| (.*) \|$", ROBOTS, re.M)
    told = [f"failed: {failure}" if (failure := rated.failure(json.loads(row[0]))) else "succeeded" for row in rows]
    assert told == [row[1] for row in rows] and len(rows) == 2


def test_the_defaults_of_the_options_and_deadlines() -> None:
    defaults = RosOptions()
    for name in ("server", "acceptance", "feedback", "result", "cancel"):
        (told,) = re.findall(rf"^- `{name}` \((\d+)\): ", ROBOTS, re.M)
        assert float(told) == getattr(defaults.deadlines, name)
    names = "wrapper|frame|deadlines|error|estop|leftovers|share|unattended"
    told = re.findall(rf"^- `({names})` \((.*?)\): ", ROBOTS, re.M)
    assert {name for name, _ in told} >= set(RosOptions.__struct_fields__)
    assert dict(told)["frame"] == f"`{defaults.frame}`"


def test_the_reference_wrapper_keeps_results_as_long_as_its_page_says() -> None:
    """E9: rclpy's own 15 minutes make an act four to ten times as slow after some thousand goals; with 0, results are
    gone before anybody can ask for them."""
    root = Path(__file__).parents[2]
    wrapper = (root / "adapters" / "rise_ros" / "rise_ros" / "robot_wrapper.py").read_text("utf-8")
    page = (root / "docs" / "how-to" / "wrap-a-robot.md").read_text("utf-8")
    servers = re.findall(r"ActionServer\((?:[^()]|\([^()]*\))*\)", wrapper)
    assert len(servers) == 1
    (seconds,) = re.findall(r"result_timeout=(\d+)", servers[0])
    assert set(re.findall(r"result_timeout=(\d+)", page)) == {seconds}
    assert 5 <= int(seconds) <= 30 and float(seconds) == RESULT_TIMEOUT
