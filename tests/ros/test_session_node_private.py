"""What private memory keys hold does not go out on ROS, whoever asks; the session itself has it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rise_adapters.ros2.bridge import session_parameters
from rise_adapters.ros2.session_node import interface, record_topics

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ActionRecord
from tests.ros.session_node_bench import START_ACT, Node, scenario_folder, session_and_node, status_of, until

GREET = """<Dialogs><Dialog name="Greet"><Speech><actionID>1</actionID><message>Dear {name|you}!</message></Speech>
</Dialog></Dialogs>"""


def private_scenario(place: Path) -> Path:
    folder = scenario_folder(place)
    (folder / "acts" / "greet.xml").write_text(GREET, "utf-8")
    (folder / "scenario.toml").write_text('title = "Private"\nprivate = ["name", "list"]\n', "utf-8")
    return folder


def everything(node: Node, *more: Any) -> str:
    """All that a node has heard, and what was answered to its goals."""
    heard: list[Any] = [node.records, node.tasks, node.rules, node.diagnostics, *more]
    heard += [[asked.feedback, asked.result] for asked in node.asked.values()]
    return json.dumps(heard, ensure_ascii=False, default=str)


async def test_nothing_private_is_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interface, "DIAGNOSTICS_SECONDS", 0.02)
    async with session_and_node(tmp_path, scenario=private_scenario(tmp_path)) as (session, node, _):
        spoken: list[ActionRecord] = []
        session.hub.subscribe(lambda each: spoken.append(each) if isinstance(each, ActionRecord) else None)
        log = node.hear("/rosout", record_topics.ROSOUT_TYPE, record_topics.ROSOUT_QOS)
        for behavior in ("name = Zoë", 'name = "Zoë Müller"', "name = = Zoë", "copy = name", "list = [98765432]"):
            await node.ask("assignValue", behavior).decided()
        assert await node.ask(START_ACT, "Greet").ended() == ("SUCCEEDED", "")
        assert not await node.ask(START_ACT, "Müller").decided()
        session.engine.post(Submit(function="say", behavior="Moin Zoë", source="wizard:w"))
        last = await until(lambda: len(spoken) > 3 and session.hub.view.seq)
        assert spoken[0].parameters == {"message": "Dear Zoë Müller!"}, "the robot says it"
        await until(lambda: node.records and node.records[-1]["seq"] >= last)
        since = len(node.diagnostics)
        await until(lambda: len(node.diagnostics) > since and status_of(node, "session")["level"] is not None)
        text = everything(node, log)
        assert "Dear {name|you}!" in text and "Moin {name}" in text and "was rejected" in text
        for word in ("Zoë", "Müller", "98765432"):
            assert word not in text, word
        for key, value in (
            ("name", "{name}"),
            ("copy", "{name}"),
            ("list", "{list}"),
            ("list.0", "{list}"),
            ("age", 7),
        ):
            answer = await node.get(key)
            assert answer["found"] and json.loads(answer["value"]) == value


@pytest.mark.parametrize(("mode", "shown"), [("real", "~/study"), ("debug", "{home}/study")])
def test_parameters_of_a_real_session_tell_no_login(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str, shown: str
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    texts = dict.fromkeys(("title", "robot", "participant", "condition"), "x")
    about = SimpleNamespace(mode=mode, seed=1, scenario_folder=f"{tmp_path}/study", folder=f"{tmp_path}/study", **texts)
    found = session_parameters(SimpleNamespace(summary=lambda: about))  # type: ignore[arg-type]
    assert found["scenario"].value == found["session"].value == shown.format(home=tmp_path)
