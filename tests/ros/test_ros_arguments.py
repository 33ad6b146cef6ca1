"""What stands behind --ros-args, and names on the wire."""

from __future__ import annotations

import pytest
from rise_adapters.ros2.transport.dds.transport import RosArguments, parse_ros_arguments
from rise_adapters.ros2.transport.names import NameResolver
from rise_adapters.ros2.transport.port import PortError


def test_remappings_namespace_and_node() -> None:
    given = parse_ros_arguments(
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
        ],
        "rise",
    )
    assert given.namespace == "/lab"
    assert given.node == "rise2"
    assert given.remaps == (("a", "b"), ("c", "/d"))


def test_nothing_is_given() -> None:
    assert parse_ros_arguments([], "x") == parse_ros_arguments(["--ros-args", "--"], "x") == RosArguments("x")


def test_the_first_rule_for_a_name_counts() -> None:
    given = parse_ros_arguments(["-r", "a:=b", "-r", "a:=c", "-r", "__ns:=/one", "-r", "__ns:=/two"], "rise")
    assert NameResolver(given.node, given.namespace, given.remaps).resolve("/one/a") == "/one/b"
    assert given.namespace == "/one"


def test_a_rule_for_the_namespace_of_another_node_does_not_count() -> None:
    assert parse_ros_arguments(["-r", "other:__ns:=/lab"], "rise").namespace == "/"
    assert parse_ros_arguments(["-r", "rise:__ns:=/lab"], "rise").namespace == "/lab"
    assert parse_ros_arguments(["-r", "__name:=wizard"], "rise").node == "wizard"


def test_what_means_nothing_here_is_passed_over() -> None:
    given = parse_ros_arguments(
        ["-p", "use_sim_time:=true", "--log-level", "debug", "--disable-rosout-logs", "--params-file", "x.yaml"],
        "rise",
    )
    assert given == RosArguments("rise")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a:=b"], "'a:=b' is not understood; did you forget -r before it?"),
        (["--remaps", "a:=b"], "'--remaps' is not understood"),
        (["-r"], "something must follow -r"),
        (["-r", "a=b"], "'a=b' is not a remapping; one looks like from:=to"),
        (["-r", "a:="], "'a:=' is not a remapping"),
        (["-r", "__ns:=lab"], "the namespace 'lab' must begin with a slash"),
        (["-p", "x"], "'x' is not a parameter; one looks like name:=value"),
        (["-r", "rosservice://a:=b"], "are not supported"),
    ],
)
def test_mistakes_are_sentences(arguments: list[str], said: str) -> None:
    with pytest.raises(PortError) as refused:
        parse_ros_arguments(arguments, "rise")
    assert str(refused.value).startswith("--ros-args: ")
    assert said in str(refused.value)


def test_names_are_resolved_as_ros_does_it() -> None:
    names = NameResolver("rise", "/lab", [("rise/record", "/bag/record"), ("/lab/x", "y"), ("x", "z"), ("~/in", "in")])
    assert names.node == "/lab/rise"
    assert names.resolve("rise/record") == "/bag/record"
    assert names.resolve("/lab/rise/record") == "/bag/record"
    assert names.resolve("/rise/record") == "/rise/record"
    assert names.resolve("x") == "/lab/y"
    assert names.resolve("~/in") == "/lab/in"
    assert names.resolve("~") == "/lab/rise"
    assert NameResolver("rise", "/", []).resolve("diagnostics") == "/diagnostics"
    assert NameResolver("rise", "", []).node == "/rise"


@pytest.mark.parametrize("name", ["", "/", "a//b", "a/", "1a", "a b", "a-b", "ä", "~a", "{node}"])
def test_a_name_that_cannot_be_is_refused(name: str) -> None:
    with pytest.raises(PortError, match="cannot be a name in ROS"):
        NameResolver("rise", "/", []).resolve(name)


def test_nodes_and_namespaces_that_cannot_be_are_refused() -> None:
    with pytest.raises(PortError, match="'a/b' cannot be the name of a node"):
        NameResolver("a/b", "/", [])
    with pytest.raises(PortError, match="'/1' cannot be a namespace"):
        NameResolver("a", "/1", [])
    with pytest.raises(PortError, match="cannot be a name in ROS"):
        NameResolver("a", "/", [("b", "c d")])
