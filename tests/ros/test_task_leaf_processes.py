"""Both leaves for behaviour trees beside a session with ROS: py_trees over rclpy, BehaviorTree.CPP over rclcpp. Each
tree and each session is a process."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from signal import SIGKILL
from xml.sax.saxutils import quoteattr

import pytest

from rise_engine.run.client import Session, connect
from tests.patience import PATIENCE
from tests.ros.contract.peers import cyclone_rmw, missing
from tests.ros.programs import Program

pytestmark = [pytest.mark.dds, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
PYTHON_LEAF = ROOT / "adapters/rise_ros/rise_ros/task_leaf.py"
FUNCTIONS = {"act": "startCommunicationRobotAct", "rule": "startInteractionRule", "event": "raiseEventTopic"}

SCENARIO = {
    "scenario.toml": 'title = "Tree"\nrobot = "generic"\nmode = "debug"\n',
    "acts/acts.xml": """<Dialogs>
        <Dialog name="Hello"><Speech><actionID>1</actionID><message>Hello</message></Speech></Dialog>
        <Dialog name="Story"><Wait><actionID>1</actionID><duration>600000</duration></Wait></Dialog>
    </Dialogs>""",
    "rules/rules.xml": """<InteractionRule name="Door" initial="Closed">
        <State id="Closed"><transition eventTopic="/open" target="Open"/></State>
        <State id="Open"><transition after="0.1s" target="Gone"/></State>
        <State id="Gone"/>
    </InteractionRule>""",
}


def python_tree(place: Path, *tasks: str) -> list[str]:
    """The command of a tree that does tasks, one after the other."""
    return [sys.executable, str(PYTHON_LEAF), *tasks]


def cpp_tree(place: Path, *tasks: str) -> list[str]:
    leaves = [task.partition(":") for task in tasks]
    file = place / "tree.xml"
    file.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Tasks"><Sequence>'
        + "".join(
            f"<RiseTask name={quoteattr(name)} function={quoteattr(FUNCTIONS[kind])} behavior={quoteattr(name)} "
            'reason="{reason}"/>'
            for kind, _, name in leaves
        )
        + "</Sequence></BehaviorTree></root>",
        "utf-8",
    )
    return [str(cpp_program()), str(file)]


def cpp_program() -> Path:
    prefix = import_module("ament_index_python.packages").get_package_prefix("rise_behavior_tree")
    return Path(prefix, "lib", "rise_behavior_tree", "task_tree")


def why_not(kind: str) -> str:
    """Why a tree cannot be tried here; empty when it can."""
    if why := missing("rclpy"):
        return why
    if not cyclone_rmw():
        return "rclpy does not run on rmw_cyclonedds_cpp here, which misses a killed session after 2 s"
    if find_spec("rise_interfaces") is None:
        return "rise_interfaces is not built, or its workspace is not sourced"
    if kind == "behaviortree_cpp":
        try:
            there = cpp_program().exists()
        except LookupError:
            return "rise_behavior_tree is not built, or its workspace is not sourced"
        return "" if there else "rise_behavior_tree was built without behaviortree_cpp"
    return ""


@pytest.fixture(
    params=[
        pytest.param(make, marks=pytest.mark.skipif(bool(why_not(kind)), reason=why_not(kind)), id=kind)
        for kind, make in (("py_trees", python_tree), ("behaviortree_cpp", cpp_tree))
    ]
)
def start_tree(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Program]]:
    programs: list[Program] = []

    def start(*tasks: str) -> Program:
        programs.append(Program(tmp_path / f"tree {len(programs)}.log", *request.param(tmp_path, *tasks)))
        return programs[-1]

    yield start
    for program in programs:
        if program.process.poll() is None:
            program.process.kill()
            program.process.wait()


@pytest.fixture
def serving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Program]:
    for name, text in SCENARIO.items():
        file = tmp_path / "scenario" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    places = {"RISE_SESSIONS": str(tmp_path / "sessions"), "RISE_RUNTIME": str(tmp_path / "run")}
    for name, value in places.items():
        monkeypatch.setenv(name, value)
    command = (sys.executable, "-m", "rise_engine", "serve", str(tmp_path / "scenario"))
    options = ("--mode", "debug", "--ros", "rclpy", "--new", "--name", "tree")
    program = Program(tmp_path / "session.log", *command, *options, **places)
    yield program
    if program.process.poll() is None:
        program.process.kill()
        program.process.wait()


@pytest.fixture
async def session(serving: Program) -> AsyncIterator[Session]:
    await serving.says("serving tree")
    async with connect("tree", name="test") as session:
        yield session


async def said_in_the_end(program: Program) -> tuple[int, str]:
    """Its exit status, and what it has written; meanwhile the session is followed."""
    status = await asyncio.to_thread(program.process.wait, PATIENCE)
    assert "Traceback" not in program.said(), program.said()
    return status, program.said()


async def test_acts_rules_and_events_are_leaves_that_succeed(
    start_tree: Callable[..., Program], session: Session
) -> None:
    rule = start_tree("rule:Door")
    await session.wait_until(lambda view: "Door" in view.rules and view.rules["Door"].state == "Closed", PATIENCE)
    status, said = await said_in_the_end(start_tree("act:Hello", "event:/open"))
    assert status == 0 and "SUCCEEDED" in said, said
    status, said = await said_in_the_end(rule)
    assert status == 0 and "SUCCEEDED" in said, said
    await session.wait_for_task(3, PATIENCE)
    tasks = sorted(session.view.tasks.values(), key=lambda task: task.id)
    assert [(task.function, task.behavior, task.status, task.source) for task in tasks] == [
        (FUNCTIONS[kind], name, "SUCCEEDED", "ros:domain_task")
        for kind, name in (("rule", "Door"), ("act", "Hello"), ("event", "/open"))
    ]


async def test_ending_the_tree_cancels_its_act(start_tree: Callable[..., Program], session: Session) -> None:
    tree = start_tree("act:Story")
    await session.wait_until(lambda view: 1 in view.tasks and view.tasks[1].status == "ACTIVE", PATIENCE)
    assert await asyncio.to_thread(tree.end) == 1
    assert (await session.wait_for_task(1, PATIENCE)).status == "CANCELED"
    assert "halted" in tree.said() and "Traceback" not in tree.said()


async def test_a_stop_fails_the_leaf_and_the_next_one(start_tree: Callable[..., Program], session: Session) -> None:
    tree = start_tree("act:Story")
    await session.wait_until(lambda view: 1 in view.tasks and view.tasks[1].status == "ACTIVE", PATIENCE)
    await session.stop_all()
    status, said = await said_in_the_end(tree)
    assert status == 1 and "stop-all by node:test" in said, said
    status, said = await said_in_the_end(start_tree("act:Hello"))
    assert status == 1 and "the session refused the task" in said, said


async def test_what_the_session_does_not_know_fails(start_tree: Callable[..., Program], session: Session) -> None:
    status, said = await said_in_the_end(start_tree("act:Helo", "event:/open"))
    assert status == 1 and "the session refused the task" in said, said
    assert (await session.wait_for_task(1, PATIENCE)).status == "REJECTED"
    assert [task.behavior for task in session.view.tasks.values()] == ["Helo"]


async def test_without_a_session_the_leaf_fails(start_tree: Callable[..., Program]) -> None:
    status, said = await said_in_the_end(start_tree("act:Hello"))
    assert status == 1 and "no session is there" in said, said


async def test_a_session_that_is_killed_fails_the_leaf(
    start_tree: Callable[..., Program], session: Session, serving: Program
) -> None:
    tree = start_tree("act:Story")
    await session.wait_until(lambda view: 1 in view.tasks and view.tasks[1].status == "ACTIVE", PATIENCE)
    serving.end(SIGKILL)
    status, said = await said_in_the_end(tree)
    assert status == 1 and "the session went before the task had ended" in said, said
