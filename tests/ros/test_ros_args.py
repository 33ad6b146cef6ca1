"""What stands behind --ros-args, and names on the wire."""

from __future__ import annotations

import pytest
from rise_adapters.ros2.names import Names
from rise_adapters.ros2.port import PortError
from rise_adapters.ros2.ros_args import RosArgs, parse


def test_remappings_namespace_and_node() -> None:
    given = parse(
        [
            "--ros-args",
            "-r",
            "a:=b",
            "--remap",
            "__ns:=/lab",
            "-r",
            "__node:=rise2",
            "-r",
            "rise2:c:=/d",
            "-r",
            "x:e:=f",
        ]
    )
    assert given.namespace == "/lab"
    assert given.node == "rise2"
    assert given.names("rise2") == {"a": "b", "c": "/d"}
    assert given.names("x") == {"a": "b", "e": "f"}


def test_nothing_is_given() -> None:
    assert parse([]) == parse(["--ros-args", "--"]) == RosArgs()


def test_the_first_rule_for_a_name_counts() -> None:
    given = parse(["-r", "a:=b", "-r", "a:=c", "-r", "__ns:=/one", "-r", "__ns:=/two"])
    assert given.names("rise") == {"a": "b"}
    assert given.namespace == "/one"


def test_a_rule_for_the_namespace_of_another_node_does_not_count() -> None:
    assert parse(["-r", "other:__ns:=/lab"], "rise").namespace == ""
    assert parse(["-r", "rise:__ns:=/lab"], "rise").namespace == "/lab"
    assert parse(["-r", "__name:=wizard"]).node == "wizard"


def test_what_means_nothing_here_is_passed_over() -> None:
    given = parse(
        ["-p", "use_sim_time:=true", "--log-level", "debug", "--disable-rosout-logs", "--params-file", "x.yaml"]
    )
    assert given == RosArgs()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a:=b"], "'a:=b' is not understood; did you forget -r before it?"),
        (["--remaps", "a:=b"], "'--remaps' is not understood"),
        (["-r"], "something must follow -r"),
        (["-r", "a=b"], "'a=b' is no remapping; one looks like from:=to"),
        (["-r", "a:="], "'a:=' is no remapping"),
        (["-r", "__ns:=lab"], "the namespace 'lab' must begin with a slash"),
        (["-p", "x"], "'x' is no parameter; one looks like name:=value"),
        (["-r", "rosservice://a:=b"], "are not supported"),
    ],
)
def test_mistakes_are_sentences(arguments: list[str], said: str) -> None:
    with pytest.raises(PortError) as refused:
        parse(arguments)
    assert str(refused.value).startswith("--ros-args: ")
    assert said in str(refused.value)


def test_names_are_resolved_as_ros_does_it() -> None:
    names = Names("rise", "/lab", [("rise/record", "/bag/record"), ("/lab/x", "y"), ("x", "z"), ("~/in", "in")])
    assert names.node == "/lab/rise"
    assert names.resolve("rise/record") == "/bag/record"
    assert names.resolve("/lab/rise/record") == "/bag/record"
    assert names.resolve("/rise/record") == "/rise/record"
    assert names.resolve("x") == "/lab/y"
    assert names.resolve("~/in") == "/lab/in"
    assert names.resolve("~") == "/lab/rise"
    assert Names("rise", "/", []).resolve("diagnostics") == "/diagnostics"
    assert Names("rise", "", []).node == "/rise"


@pytest.mark.parametrize("name", ["", "/", "a//b", "a/", "1a", "a b", "a-b", "ä", "~a", "{node}"])
def test_a_name_that_cannot_be_is_refused(name: str) -> None:
    with pytest.raises(PortError, match="cannot be a name in ROS"):
        Names("rise", "/", []).resolve(name)


def test_nodes_and_namespaces_that_cannot_be_are_refused() -> None:
    with pytest.raises(PortError, match="'a/b' cannot be the name of a node"):
        Names("a/b", "/", [])
    with pytest.raises(PortError, match="'/1' cannot be a namespace"):
        Names("a", "/1", [])
    with pytest.raises(PortError, match="cannot be a name in ROS"):
        Names("a", "/", [("b", "c d")])
