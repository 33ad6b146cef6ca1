"""What a session leaves behind on a robot, with processes and the wire: its end says so, the next engine finds it."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from rise_engine.base import exit_status
from rise_engine.run.client.socket import SocketClient
from tests.ros.badrobot import Plan
from tests.ros.bench import SPEECH, TYPES
from tests.ros.contract.peers import missing
from tests.ros.programs import PATIENCE, Lab, Program
from tests.ros.session_node_bench import until

pytestmark = [
    pytest.mark.dds,
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing("dds")), reason=missing("dds") or "there is no reason"),
]

PROFILE = """
title = "Mini"
driver = "ros2"
{options}
[actions.Speech.carrier]
action = "/pepper/rise/speech"
type = "rise_interfaces/action/Speech"
goal = {{ message = "{{message}}" }}
"""
STUDY = {
    "scenario.toml": 'title = "leftovers"\nrobot = "mini"\nmode = "real"\n',
    "acts/a.xml": """<Dialog name="R_Talk">
        <Speech><actionID>1</actionID><message>It goes on and on.</message></Speech></Dialog>""",
    "rules/r.xml": """<InteractionRule name="Go" initial="a"><State id="a">
        <onEntry><function startCommunicationRobotAct="R_Talk"/></onEntry>
        <transition eventTopic="/never" target="a"/></State></InteractionRule>""",
}


class Mini(Lab):
    """With a robot of one action."""

    def write_study(self, options: str = "") -> None:
        self.write({**STUDY, "robots/mini.toml": PROFILE.format(options=options)})

    async def robot(self, plan: Plan) -> Program:
        order = {"names": {SPEECH: TYPES[SPEECH]}, "plans": [msgspec.to_builtins(plan)]}
        robot = self.start("robot", "tests.ros.badrobot", json.dumps(order))
        await robot.says('"ready"')
        return robot


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Mini]:
    made = Mini(tmp_path)
    yield made
    made.close()


async def test_the_end_of_a_session_names_what_the_robot_goes_on_with(lab: Mini) -> None:
    """Where it runs, in its record, and to whom ends it from elsewhere."""
    lab.write_study()
    robot = await lab.robot(Plan(seconds=60, cancel="refuse"))
    session = await lab.serve("session", "--rule", "Go", "--new")
    await robot.says('"begin"')
    stop = lab.start("stop", "rise_engine", "stop", "study")
    await until(lambda: stop.process.poll() is not None, PATIENCE)
    assert stop.process.returncode == session.process.wait(PATIENCE) == exit_status.STILL_RUNNING
    sentence = "mini/speech may still be doing Speech (it refused to stop)"
    assert sentence in session.said() and f"LOOK AT THE ROBOT: {sentence}" in stop.said()
    last = lab.records()[-1]
    assert last["status"] == "ended"
    assert [(goal["part"], goal["reason"]) for goal in last["open"]] == [("mini/speech", "it refused to stop")]


@pytest.mark.parametrize("unattended", ["wait", "go on"])
async def test_what_a_killed_engine_left_is_named_and_stopped_and_nothing_begins_before_a_wizard_has_control(
    lab: Mini, unattended: str
) -> None:
    lab.write_study(f'[options]\nunattended = "{unattended}"')
    robot = await lab.robot(Plan(seconds=60))
    session = await lab.serve("session", "--act", "R_Talk", "--act", "R_Talk", "--new")
    await robot.says('"begin"')
    await until(lambda: any(each.get("status") == "accepted" for each in lab.records()), PATIENCE)
    session.process.kill()
    session.process.wait()
    (folder,) = (lab.folder / "sessions").iterdir()
    folder.rename(folder.with_name("renamed"))
    again = await lab.serve("again", "--recover")
    await robot.says('"end"')  # no wizard is there, so the session stops it by itself; the second act waited for that
    await until(lambda: any(each["open"] == [] for each in lab.records("robot")[-1:]), PATIENCE)
    told = lab.records("robot")
    first = next(each for each in told if each["open"])
    assert first["open"][0]["reason"] == "an engine that has gone began it" and first["status"] == "degraded"
    named = {goal["action"] for each in told for goal in each["open"]}
    assert named == {"1/1"}, "by its id, although the folder has another name now"
    tasks = lab.records("task")
    assert [each["source"] for each in tasks if each["function"] == "cancelOpenGoals"] == ["engine"]
    if unattended == "wait":
        wizard = SocketClient("study", "anna")
        attached = await wizard.attach()
        assert attached.view.waits_for_wizard and attached.view.control is None and len(attached.view.waiting) == 1
        assert robot.said().count('"begin"') == 1
        assert (await wizard.change_control("take")).accepted
    await until(lambda: robot.said().count('"begin"') == 2, PATIENCE)
    if unattended == "wait":
        await wizard.close()
    assert again.end(signal.SIGTERM) == exit_status.OK


async def test_a_profile_can_keep_what_a_killed_engine_left_running(lab: Mini) -> None:
    lab.write_study('[options]\nleftovers = "keep"')
    robot = await lab.robot(Plan(seconds=8))
    session = await lab.serve("session", "--rule", "Go", "--new")
    await robot.says('"begin"')
    await until(lambda: any(each.get("status") == "accepted" for each in lab.records()), PATIENCE)
    session.process.kill()
    session.process.wait()
    await lab.serve("again", "--recover")
    await robot.says('"end".*"status": 4')
    await until(lambda: lab.records()[-1].get("open") == [], PATIENCE)
    assert '"cancel"' not in robot.said()
