"""Who may release a stop over ROS, on a wire in memory and a real engine."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel.records import NoteRecord
from tests.ros.memory import MemoryTransport
from tests.ros.session_node_bench import Node, scenario_folder, session_and_node, task_records, until

# --- releasing a stop ---------------------------------------------------------------------------------------------


def who_may_release(place: Path, *names: str) -> Path:
    folder = scenario_folder(place)
    (folder / "scenario.toml").write_text(f"[control]\nmay_release = {json.dumps(names)}\n", "utf-8")
    return folder


async def stopped(session: Any, node: Node) -> None:
    assert (await node.ask("stopAll").ended())[0] == "SUCCEEDED"
    await until(lambda: session.hub.view.stop.status == "latched")


async def test_a_node_that_the_scenario_names_releases_a_stop_and_the_record_says_who(tmp_path: Path) -> None:
    folder = who_may_release(tmp_path, "/lab/supervisor", "/node")
    async with session_and_node(tmp_path, scenario=folder) as (session, node, _):
        records = task_records(session)
        await stopped(session, node)
        asked = node.ask("releaseStop", "/node")
        assert await asked.ended() == ("SUCCEEDED", "")
        assert not session.hub.view.stop.latched
        assert (records[-1].function, records[-1].source, records[-1].ref) == (
            "releaseStop",
            "ros:/node",
            asked.id.hex(),
        )
        state = await until(lambda: [s for s in node.tasks if s["function_type"] == "releaseStop"])
        assert (state[0]["source"], state[0]["status"], state[0]["goal_id"]) == (
            "ros:/node", "SUCCEEDED", asked.id.hex()
        )  # fmt: skip
        assert [name for name in session.hub.clients if "node" in name] == [], "it leaves again"


@pytest.mark.parametrize(
    ("named", "says", "why"),
    [
        (
            (),
            "",
            "a stop can be released by the wizard who holds control, or by a node that scenario.toml names; a node",
        ),
        ((), "/node", 'or by a node that scenario.toml names: [control] may_release = ["/node"]'),
        (
            ("/lab/boss",),
            "/node",
            "a stop can be released by the wizard who holds control, or by /lab/boss, and not by /node",
        ),
        (("/lab/boss",), "/lab/boss", "it says that it is /lab/boss, and no node of that name uses /rise/domain_task"),
        (("/node",), "node", "a stop can be released by the wizard who holds control, or by /node, and not by node"),
    ],
)
@pytest.mark.slow
async def test_any_other_node_does_not(tmp_path: Path, named: tuple[str, ...], says: str, why: str) -> None:
    async with session_and_node(tmp_path, scenario=who_may_release(tmp_path, *named)) as (session, node, _):
        notes: list[str] = []
        session.hub.subscribe(lambda update: notes.append(update.text) if isinstance(update, NoteRecord) else None)
        await stopped(session, node)
        for _ in range(2):
            assert not await node.ask("releaseStop", says).decided()
        refused = await until(lambda: [s for s in node.tasks if s["function_type"] == "releaseStop"])
        assert refused[0]["status"] == "REJECTED" and why in refused[0]["reason"]
        assert session.hub.view.stop.latched
        await until(lambda: notes)
        assert (
            len(notes) == 1
            and notes[0].startswith("a node asked to release the stop and may not: ")
            and why in notes[0]
        )


async def test_behind_the_node_s_name_it_says_which_rules_go_on(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, scenario=who_may_release(tmp_path, "/node")) as (session, node, _):
        name, rule = next(iter(session.hub.engine.scenario.rules.items()))
        node.ask("startInteractionRule", json.dumps({"rule": name, "enter": False}))
        await until(lambda: name in session.hub.view.rules and session.hub.view.rules[name].running)
        await stopped(session, node)
        assert not await node.ask("releaseStop", '/node {"nothing": "enter"}').decided()
        assert session.hub.view.stop.latched
        assert (await node.ask("releaseStop", "/node " + json.dumps({name: "wait"})).ended())[0] == "SUCCEEDED"
        assert (session.hub.view.rules[name].state, session.hub.view.rules[name].running) == (rule.initial, True)


async def test_a_node_whose_name_is_not_known_yet_is_waited_for(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, scenario=who_may_release(tmp_path, "/late")) as (session, node, wire):
        await stopped(session, node)
        asked = node.ask("releaseStop", "/late")
        await asyncio.sleep(0)
        Node(MemoryTransport(wire, asyncio.get_running_loop(), "/late"))
        assert (await asked.ended())[0] == "SUCCEEDED"


@pytest.mark.slow
async def test_many_that_say_they_are_a_node_that_is_not_there_wait_not_long(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, scenario=who_may_release(tmp_path, "/late")) as (session, node, _):
        await stopped(session, node)
        asked = [node.ask("releaseStop", "/late") for _ in range(40)]
        await until(lambda: sum(each.accepted is False for each in asked) >= 30)
        await until(lambda: all(each.accepted is False for each in asked))
        assert session.hub.view.stop.latched and not session.face._tasks._releasing
