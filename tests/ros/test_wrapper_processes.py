"""The reference wrapper as a lab runs it: its dead man's switch, with a session that dies or hangs, on ROS 2."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from rise_engine.base import exit_status
from tests.ros.contract.peers import missing
from tests.ros.programs import PATIENCE, Lab, Program
from tests.ros.session_node_bench import until

pytestmark = [
    pytest.mark.dds,
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing("rclpy")), reason=missing("rclpy") or "there is no reason"),
]
TRANSPORTS = [kind for kind in ("dds", "rclpy") if not missing(kind)]
SILENT = "the session has given no sign of life for 1 s"
STUDY = {
    "scenario.toml": 'title = "talk"\nrobot = "rise"\nmode = "real"\n',
    "acts/a.xml": f"""<Dialog name="R_Talk">
        <Speech><actionID>1</actionID><message>{"and so on " * 200}</message></Speech></Dialog>""",
}


@pytest.fixture(params=TRANSPORTS)
def lab(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Lab]:
    made = Lab(tmp_path, request.param)
    made.write(STUDY)
    yield made
    made.close()


async def started_wrapper(lab: Lab) -> Program:
    wrapper = lab.start("wrapper", "rise_ros.robot_wrapper", "--ros-args", "-p", "session_timeout:=1.0")
    await wrapper.says("ready: speech")
    return wrapper


async def test_the_robot_stops_when_its_session_dies_and_obeys_the_next_engine(lab: Lab) -> None:
    wrapper = await started_wrapper(lab)
    session = await lab.serve("session", "--act", "R_Talk", "--new")
    await wrapper.says('says "and so on')
    session.process.kill()
    session.process.wait()
    await wrapper.says(f"{SILENT}: the robot stops, and takes no goals")
    again = await lab.serve("again", "--recover")
    await wrapper.says("the robot takes goals again")
    await until(lambda: lab.records("robot")[-1]["open"] == [], PATIENCE)
    assert again.end(signal.SIGTERM) == exit_status.OK
    assert wrapper.said().count('says "') == 1 and "Traceback" not in wrapper.said()
    assert wrapper.end() == 0


async def test_the_robot_stops_while_its_session_hangs(lab: Lab) -> None:
    wrapper = await started_wrapper(lab)
    session = await lab.serve("session", "--act", "R_Talk", "--new")
    await wrapper.says('says "and so on')
    session.process.send_signal(signal.SIGSTOP)
    await wrapper.says(f"{SILENT}: the robot stops, and takes no goals")
    session.process.send_signal(signal.SIGCONT)
    await wrapper.says("the robot takes goals again")
    await until(lambda: lab.records("action")[-1]["status"] == "failed", PATIENCE)
    assert SILENT in lab.records("action")[-1]["reason"]
    assert session.end(signal.SIGTERM) == exit_status.OK
    assert wrapper.end() == 0 and "Traceback" not in wrapper.said()
