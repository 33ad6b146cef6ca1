"""Settings as ROS parameters: how they are given, what is refused, and what `ros2 param` sees."""

from __future__ import annotations

import asyncio
import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.ros2.bridge import read_parameters
from rise_adapters.ros2.parameters import ParameterOption, ParameterServices, ReadableParameter, parameters_as_options
from rise_adapters.ros2.transport.port import Message, PortError
from rise_ros.examples.run_node import list_parameter_options, list_parameters, node_parser

from rise_engine.base.errors import AdapterError
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.session_node_bench import until

OPTIONS = {
    "dwell": ParameterOption("--dwell"),
    "topic": ParameterOption("--topic"),
    "live_speech": ParameterOption("--live-speech", switch=True),
    "keyword": ParameterOption("--keyword", repeatable=True),
}


def options(*arguments: str, written: tuple[str, ...] = ()) -> list[str]:
    return parameters_as_options(arguments, "gaze_trigger", OPTIONS, written)[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "dwell:=0.5"], ["--dwell=0.5"]),
        (["--param", "dwell:=0.5", "-p", "dwell:=2"], ["--dwell=2"]),
        (["-p", "topic:=/eyes/gaze"], ["--topic=/eyes/gaze"]),
        (["-p", "topic:='yes: no'"], ["--topic=yes: no"]),
        (["-p", "topic:=007"], ["--topic=007"]),
        (["-p", "topic:=1e3"], ["--topic=1e3"]),
        (["-p", "topic:="], ["--topic="]),
        (["-p", "topic:=~"], ["--topic=~"]),
        (["-p", "live_speech:=true"], ["--live-speech"]),
        (["-p", "live-speech:=true"], ["--live-speech"]),
        (["-p", "live_speech:=false"], []),
        (["-p", "keyword:=[a=/x, 'b,c=/y']"], ["--keyword=a=/x", "--keyword=b,c=/y"]),
        (["-p", "gaze_trigger:dwell:=1"], ["--dwell=1"]),
        (["-p", "/gaze_trigger:dwell:=1"], ["--dwell=1"]),
        (["-r", "__ns:=/lab", "-p", "/lab/gaze_trigger:dwell:=1"], ["--dwell=1"]),
        (["-r", "__node:=eyes", "-p", "eyes:dwell:=1"], ["--dwell=1"]),
        (["-p", "another:dwell:=1", "-p", "another:nonsense:=1"], []),
        (["-p", "use_sim_time:=false"], []),
    ],
)
def test_parameters_become_options(arguments: list[str], words: list[str]) -> None:
    assert options(*arguments) == words


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["-p", "dwel:=1"], "the parameter dwel is unknown; did you mean `dwell`?"),
        (["-p", "x:=1"], "parameter x is unknown; known: `dwell`, `topic`, `live_speech`, `keyword`, `use_sim_time`"),
        (["-p", "use_sim_time:=true"], "this program does not follow /clock: people take part"),
        (["-p", "use_sim_time:=maybe"], "the parameter use_sim_time is maybe, and"),
        (["-p", "qos_overrides./rise/record.publisher.depth:=5"], "the quality of service of this program's topics is"),
        (["-p", "live_speech:=2"], "the parameter live_speech is true or false, not '2'"),
        (["-p", "dwell:=[1, 2]"], r"the parameter dwell is one value, not the list \['1', '2'\]"),
        (["-p", "dwell:={a: 1}"], "the parameter dwell cannot be"),
        (["-p", "dwell=1"], "'dwell=1' is not a parameter; one looks like name:=value"),
        (["-p", "dwell:=[1"], "is not YAML"),
        (["-p"], "something must follow -p"),
        (["--params-file", "/nowhere.yaml"], "--params-file /nowhere.yaml cannot be read"),
    ],
)  # fmt: skip
def test_what_is_no_parameter_is_refused_with_a_sentence(arguments: list[str], why: str) -> None:
    with pytest.raises(PortError, match=why):
        options(*arguments)


def test_other_arguments_are_left_to_the_transport() -> None:
    arguments = ("-r", "a:=b", "-p", "dwell:=1", "--log-level", "debug")
    assert parameters_as_options(arguments, "gaze_trigger", OPTIONS)[1] == ("-r", "a:=b", "--log-level", "debug")


def test_what_is_written_on_the_command_line_counts_more() -> None:
    given = ("-p", "dwell:=1", "-p", "keyword:=[a=/x]")
    assert options(*given, written=("--dwell", "2")) == ["--dwell=1", "--keyword=a=/x"], "the last one counts"
    assert options(*given, written=("--keyword=b=/y",)) == ["--dwell=1"], "of several, all would"


FILE = """
/**:
  ros__parameters:
    dwell: 1.0
    of_somebody_else: 3
    use_sim_time: false
gaze_trigger:
  ros__parameters:
    dwell: 2.0
/lab:
  gaze_trigger:
    ros__parameters: {topic: eyes, live_speech: true}
/lab/other:
  ros__parameters: {topic: nothing}
"""


def test_a_file_of_parameters(tmp_path: Path) -> None:
    file = tmp_path / "params.yaml"
    file.write_text(FILE)
    assert options("--params-file", str(file)) == ["--dwell=2.0"]
    in_lab = options("--params-file", str(file), "-r", "__ns:=/lab")
    assert in_lab == ["--dwell=1.0", "--topic=eyes", "--live-speech"]
    assert options("--params-file", str(file), "-p", "dwell:=9") == ["--dwell=9"]
    file.write_text("gaze_trigger:\n  ros__parameters: {of_somebody_else: 3}\n")
    with pytest.raises(PortError, match="the parameter of_somebody_else is unknown"):
        options("--params-file", str(file))
    for wrong in ("- a\n", "gaze_trigger: 3\n", "gaze_trigger:\n  ros__parameters: 3\n", "a: [\n"):
        file.write_text(wrong)
        with pytest.raises(PortError, match=r"params"):
            options("--params-file", str(file))
    file.write_text("")
    assert options("--params-file", str(file)) == []


def test_what_a_file_gives_to_all_nodes_is_passed_over_with_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bring-up with simulated time is for its other nodes; for this one, somebody has to mean it."""
    file = tmp_path / "params.yaml"
    given = "ros__parameters: {use_sim_time: true, dwell: 1, qos_overrides: {/scan: {subscription: {depth: 5}}}}\n"
    file.write_text(f"/**:\n  {given}")
    assert options("--params-file", str(file)) == ["--dwell=1"]
    notes = capsys.readouterr().err.splitlines()
    assert [note.partition(":")[0] for note in notes] == ["note", "note"]
    assert "the parameter use_sim_time is true" in notes[0] and "is ignored here" in notes[0]
    assert "qos_overrides./scan.subscription.depth" in notes[1]
    file.write_text(f"gaze_trigger:\n  {given}")
    with pytest.raises(PortError, match=r"does not follow /clock: .*; omit it"):
        options("--params-file", str(file))


def test_both_readers_of_yaml_say_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """ROS comes with one, the extra `dds` with the other."""
    pytest.importorskip("yaml")
    pytest.importorskip("ruamel.yaml")
    file = tmp_path / "params.yaml"
    file.write_text(FILE + "/**/gaze_trigger:\n  ros__parameters: {keyword: [007, 'a: b', yes]}\n")
    lines = (["--params-file", str(file), "-r", "__ns:=/lab"], ["-p", "topic:=0o7"], ["-p", "keyword:=[a, 1.0]"])
    first = [options(*line) for line in lines]
    assert first[0][1:4] == ["--keyword=007", "--keyword=a: b", "--keyword=yes"]
    monkeypatch.setitem(sys.modules, "yaml", None)
    assert [options(*line) for line in lines] == first
    with pytest.raises(PortError, match="is not YAML"):
        options("-p", "dwell:=[1")


def test_the_session_takes_its_command_line_as_parameters() -> None:
    def read(*arguments: str) -> tuple[list[str], tuple[str, ...]]:
        return read_parameters(
            arguments,
            switches={"--new": "", "--record": "--no-record"},
            single=["--robot", "--seed"],
            many=["--rule"],
            written=["serve"],
        )

    given, others = read("-p", "robot:=pepper", "-r", "a:=b", "-p", "rule:=[A, B]", "-p", "new:=true", "-p", "seed:=5")
    assert given == ["--robot=pepper", "--rule=A", "--rule=B", "--new", "--seed=5"] and others == ("-r", "a:=b")
    assert read("-p", "new:=false", "-p", "record:=false")[0] == ["--no-record"]
    with pytest.raises(AdapterError, match="the parameter robto is unknown; did you mean `robot`"):
        read("-p", "robto:=pepper")


# --- what others see --------------------------------------------------------------------------------------------------


def parser() -> ArgumentParser:
    made = node_parser("gaze_trigger", "...")
    made.add_argument("--dwell", type=float, default=0.8, help="seconds that a look lasts (default: %(default)s)")
    made.add_argument("--otherwise", help="an event")
    made.add_argument("--live-speech", action="store_true")
    made.add_argument("--file", type=Path, default=Path("/x"))
    made.add_argument("--number", type=int, default=3)
    made.add_argument("--region", action="append", default=["a", "b"])
    return made


class Asking:
    """A node that asks another one for its parameters, as `ros2 param` does."""

    def __init__(self, wire: MemoryWire, settings: dict[str, ReadableParameter]) -> None:
        loop = asyncio.get_running_loop()
        ParameterServices(MemoryTransport(wire, loop, "/lab/gaze_trigger"), lambda: settings)
        self.transport = MemoryTransport(wire, loop, "/cli")

    async def ask(self, service: str, type: str, request: Message) -> Any:
        got: list[Message] = []
        self.transport.client(f"/lab/gaze_trigger/{service}", f"rcl_interfaces/srv/{type}").call(request, got.append)
        return (await until(lambda: got))[0]


async def test_every_option_of_a_node_is_a_parameter() -> None:
    made = parser()
    assert list_parameter_options(made)["live_speech"] == ParameterOption("--live-speech", switch=True)
    assert list_parameter_options(made)["region"] == ParameterOption("--region", repeatable=True)
    asking = Asking(MemoryWire(), list_parameters(made, made.parse_args(["--dwell", "0.5"])))
    names = (await asking.ask("list_parameters", "ListParameters", {}))["result"]["names"]
    assert names == [
        "dwell", "file", "live_speech", "number", "otherwise", "region", "ros", "share", "use_sim_time"
    ]  # fmt: skip
    values = (await asking.ask("get_parameters", "GetParameters", {"names": [*names, "nonsense"]}))["values"]
    assert [each["type"] for each in values] == [3, 4, 1, 2, 0, 9, 4, 9, 1, 0]
    assert (values[0]["double_value"], values[1]["string_value"], values[2]["bool_value"]) == (0.5, "/x", False)
    assert (values[3]["integer_value"], values[5]["string_array_value"]) == (3, ["a", "b"])
    types = (await asking.ask("get_parameter_types", "GetParameterTypes", {"names": ["dwell", "nonsense"]}))["types"]
    assert bytes(types) == bytes([3, 0])
    described = await asking.ask("describe_parameters", "DescribeParameters", {"names": ["dwell", "nonsense"]})
    first, unknown = described["descriptors"]
    assert (first["name"], first["type"], first["read_only"]) == ("dwell", 3, True)
    assert first["description"] == "seconds that a look lasts"
    assert (unknown["name"], unknown["type"]) == ("nonsense", 0)
    some = await asking.ask("list_parameters", "ListParameters", {"prefixes": ["dwell", "re"]})
    assert some["result"]["names"] == ["dwell"]


async def test_a_parameter_is_not_set_while_the_program_runs_and_it_says_so() -> None:
    asking = Asking(MemoryWire(), {"dwell": ReadableParameter(0.5)})
    names = ["dwell", "dwel", "use_sim_time"]
    request = {"parameters": [{"name": name, "value": {"type": 3, "double_value": 1.0}} for name in names]}
    results = (await asking.ask("set_parameters", "SetParameters", request))["results"]
    assert [each["successful"] for each in results] == [False] * 3
    assert results[0]["reason"] == "dwell is read when the program starts: --ros-args -p dwell:=..."
    assert results[1]["reason"] == "there is no parameter dwel; did you mean `dwell`?"
    atomic = await asking.ask("set_parameters_atomically", "SetParametersAtomically", request)
    assert atomic["result"] == {"successful": False, "reason": results[0]["reason"]}
