"""The page *Two computers*, as it stands there: a session on one computer and a robot on the other, which are network
namespaces here. No multicast passes between them, and their firewalls open what the page opens and nothing else.

Whatever is made is removed, also after a failure. Without the rights for it the tests are skipped, and say so.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from time import monotonic
from typing import Any

import pytest

from tests.ros.contract.peers import has_rmw, missing
from tests.ros.programs import PATIENCE, Program

pytestmark = [pytest.mark.dds, pytest.mark.slow]

PAGE = (Path(__file__).parents[2] / "docs/how-to/two-computers.md").read_text("utf-8")
SETTINGS = dict(re.findall(r"^export (\w+)=(\S+)$", PAGE, re.MULTILINE))
CYCLONE, FAST = re.findall(r"^```xml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
SESSION, ROBOT = re.findall(r'<Peer address="([\d.]+)"/>', CYCLONE)
OPENED = re.findall(r"^sudo ufw allow from (\S+) to any port (\d+):(\d+) proto udp$", PAGE, re.MULTILINE)
FIREWALL = """table inet lab {{ chain input {{ type filter hook input priority 0; policy drop;
    iifname "lo" accept
    ip saddr {} udp dport {}-{} accept
}}
}}"""
SCENARIO = {
    "scenario.toml": 'title = "Two computers"\nrobot = "patient"\nmode = "real"\n',
    # A type that every ROS has, and the patience of a machine that is busy.
    "robots/patient.toml": 'title = "Robot"\ndriver = "ros2"\n'
    "options = { deadlines = { server = 100, acceptance = 20 } }\n[actions.Speech.carrier]\n"
    'action = "speech"\ntype = "example_interfaces/action/Fibonacci"\ngoal = { order = 3 }\n',
    "acts/acts.xml": "<Dialogs><Dialog name='Hello'><Speech><actionID>1</actionID><message>Hi</message></Speech>"
    "</Dialog></Dialogs>",
}


def way(ros: str, rmw: str, **settings: str) -> Any:
    absent = missing(ros) or ("" if ros == "dds" or has_rmw(rmw) else f"{rmw} is not installed")
    return pytest.param(ros, rmw, settings, id=f"{ros}-{rmw}", marks=pytest.mark.skipif(bool(absent), reason=absent))


WAYS = (
    way("dds", "rmw_cyclonedds_cpp", CYCLONEDDS_URI=CYCLONE),
    way("rclpy", "rmw_cyclonedds_cpp", CYCLONEDDS_URI=CYCLONE),
    way("rclpy", "rmw_fastrtps_cpp", CYCLONEDDS_URI="", FASTRTPS_DEFAULT_PROFILES_FILE=FAST),
)


def ip(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)


def in_namespace(name: str, *command: str) -> list[str]:
    return ["ip", "netns", "exec", name, *command]


@pytest.fixture
def computers() -> Iterator[tuple[str, str]]:
    """The names of two namespaces, joined by a cable."""
    if os.geteuid() != 0 or which("ip") is None:
        pytest.skip("only root makes network namespaces, with iproute2")
    names = (f"rise-{os.getpid()}-1", f"rise-{os.getpid()}-2")
    try:
        for name in names:
            if (made := ip("netns", "add", name)).returncode:
                pytest.skip(f"no network namespace can be made here: {made.stderr.strip()}")
        cable = ["link", "add", "lab", "netns", names[0], "type", "veth", "peer", "name", "lab", "netns", names[1]]
        if (made := ip(*cable)).returncode:
            pytest.skip(f"two network namespaces cannot be joined here: {made.stderr.strip()}")
        for name, address in zip(names, (SESSION, ROBOT), strict=True):
            for step in (
                ("link", "set", "lo", "up"),
                ("address", "add", f"{address}/24", "dev", "lab"),
                ("link", "set", "lab", "multicast", "off", "up"),
            ):
                assert ip("-n", name, *step).returncode == 0
        for name in names:  # Fast DDS uses only networks that were up when the program started
            end = monotonic() + PATIENCE
            while "state UP" not in ip("-n", name, "link", "show", "lab").stdout:
                assert monotonic() < end, "the cable was never plugged in"
            if which("nft") is not None:
                rules = FIREWALL.format(*OPENED[0])
                subprocess.run(in_namespace(name, "nft", "-f", "-"), input=rules, text=True, check=True)
        yield names
    finally:
        for name in names:
            ip("netns", "del", name)  # its end of the cable and its firewall go with it


@pytest.mark.parametrize(("ros", "rmw", "settings"), WAYS)
def test_a_session_and_its_robot_on_two_computers(
    ros: str, rmw: str, settings: dict[str, str], computers: tuple[str, str], tmp_path: Path
) -> None:
    for name, text in SCENARIO.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    environment = SETTINGS | {"RMW_IMPLEMENTATION": rmw, "ROS_AUTOMATIC_DISCOVERY_RANGE": ""}
    for name, text in settings.items():
        (tmp_path / f"{name}.xml").write_text(text, "utf-8")
        environment[name] = str(tmp_path / f"{name}.xml") if text else ""
    node = (sys.executable, "-m", "rise_ros.examples.simulated_robot", "--config", str(tmp_path))
    robot = Program(tmp_path / "robot.log", *in_namespace(computers[1], *node, "--ros", ros), **environment)
    run = (sys.executable, "-m", "rise_engine", "run", str(tmp_path), "--act", "Hello", "--json", "--ros", ros)
    session = Program(tmp_path / "session.log", *in_namespace(computers[0], *run), **environment)
    try:  # whoever is there first waits for the other
        assert session.process.wait(3 * PATIENCE) == 0, session.said()
    finally:
        for program in (session, robot):
            program.process.kill()
            program.process.wait()
    records = [json.loads(line) for line in session.said().splitlines() if line.startswith("{")]
    assert [each["status"] for each in records if each["kind"] == "robot"] == ["connected"]
    endings = [each["status"] for each in records if each["kind"] == "action"]
    assert endings[-1] == "succeeded", session.said() + robot.said()


def test_the_page_opens_the_ports_that_its_programs_have() -> None:
    """By the rule of DDS (https://www.omg.org/spec/DDSI-RTPS/2.2, 9.6.1): two ports each, behind two for multicast."""
    domain, most = int(SETTINGS["ROS_DOMAIN_ID"]), int(re.findall(r"<MaxAuto\w+>(\d+)<", CYCLONE)[0])
    begin = 7400 + 250 * domain
    ((network, first, last),) = OPENED
    assert (int(first), int(last)) == (begin, begin + 11 + 2 * most)
    assert f"domain {domain} and {most + 1} programs" in PAGE and f">{most}</maxInitialPeersRange>" in FAST
    parts = network.partition(".0/24")[0]
    assert SESSION.startswith(parts) and ROBOT.startswith(parts) and f'address="{parts}.0"' in CYCLONE
    assert re.findall(r"<address>([\d.]+)</address>", FAST) == [SESSION, ROBOT]
