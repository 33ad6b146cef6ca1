"""`rise_interfaces`: the package that colcon builds and that travels in the wheel."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, InterfaceCatalog
from rise_adapters.ros2.transport.interfaces.definitions import PRIMITIVES

PACKAGE = Path(__file__).parents[2] / "adapters" / "rise_interfaces"
INTERFACES = sorted(path for kind in ("action", "msg", "srv") for path in (PACKAGE / kind).glob(f"*.{kind}"))


def test_the_program_reads_what_colcon_builds() -> None:
    assert INTERFACES and PACKAGE == RISE_INTERFACES


def test_the_goal_of_a_domain_task_is_that_of_rise() -> None:
    fields = InterfaceCatalog(environment={}).fields("rise_interfaces/action/DomainTask_Goal")
    assert fields == {"domain_task_behavior": "string", "function_type": "string", "calling_type": "string"}


def test_everything_is_built() -> None:
    text = (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")
    assert sorted(re.findall(r'"((?:action|msg|srv)/\w+\.\w+)"', text)) == [
        str(path.relative_to(PACKAGE)) for path in INTERFACES
    ]


def test_everything_that_is_needed_is_declared() -> None:
    types = InterfaceCatalog(environment={})
    needed = set()
    for path in INTERFACES:
        for suffix in {"action": ("_Goal", "_Result", "_Feedback"), "srv": ("_Request", "_Response"), "msg": ("",)}[
            path.parent.name
        ]:
            definition = types.message_definition(f"rise_interfaces/{path.parent.name}/{path.stem}{suffix}")
            needed |= {field.type.base.split("/")[0] for field in definition.fields} - PRIMITIVES
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert needed | {"action_msgs"} == {depend.text for depend in package.findall("depend")}
    cmake = (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")
    listed = re.search(r"DEPENDENCIES ([\w ]+)", cmake)
    assert listed is not None
    assert set(listed[1].split()) == needed
    for name in needed:
        assert f"find_package({name} REQUIRED)" in cmake


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_every_field_is_explained_and_plain(path: Path) -> None:
    """Comments stand above what they are about; nothing is used that some tools of ROS do not take."""
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# ") and text.endswith("\n") and text.isascii()
    assert all(len(line) <= 120 for line in text.splitlines())
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words and words != ["---"]:
            assert len(words) == 2, f"{line!r} has a default value, or something behind it"
            assert not words[0].startswith(("wstring", "char", "byte", "string<"))


def test_what_catkin_says() -> None:
    package = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    warnings: list[str] = []
    parsed = package.parse_package(str(PACKAGE), warnings=warnings)
    parsed.validate(warnings=warnings)
    assert warnings == []
    assert parsed.name == "rise_interfaces"
    assert parsed.package_format == 3
    assert [group.name for group in parsed.member_of_groups] == ["rosidl_interface_packages"]
    assert parsed.licenses == ["MIT"]
    assert parsed.get_build_type() == "ament_cmake"


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_what_rosidl_says(path: Path) -> None:
    parser = pytest.importorskip("rosidl_adapter.parser", reason="rosidl_adapter comes with ROS 2")
    read = {
        "action": parser.parse_action_file,
        "msg": parser.parse_message_file,
        "srv": parser.parse_service_file,
    }[path.parent.name]
    ours, kind = InterfaceCatalog(environment={}), path.parent.name
    theirs = read("rise_interfaces", str(path))
    parts = {
        "action": {"_Goal": "goal", "_Result": "result", "_Feedback": "feedback"},
        "srv": {"_Request": "request", "_Response": "response"},
        "msg": {"": ""},
    }[kind]
    for suffix, attribute in parts.items():
        message = getattr(theirs, attribute) if attribute else theirs
        fields = ours.fields(f"rise_interfaces/{kind}/{path.stem}{suffix}")
        assert list(fields) == [field.name for field in message.fields]
