"""A study that is changed while a session of it runs: the session goes on with what it began with."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from rise_engine.author.edit.edits import SetParameter
from rise_engine.author.edit.workspace import Workspace
from tests.forked import Forked, run_engine

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"
ENGINE = str(Path(sys.executable).parent / "rise-engine")
TASK = {"function_type": "startCommunicationRobotAct", "domain_task_behavior": "R_Attention"}


def spoken(records: list[dict[str, Any]]) -> list[str]:
    return [each["parameters"]["message"] for each in records
            if each["kind"] == "action" and each["type"] == "Speech" and each["status"] == "started"]  # fmt: skip


def told(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The records without the clock that ran; what the robot answers in one moment may come in another order."""
    clocks = {"seq", "t", "wall", "speed"}
    found = [{name: value for name, value in each.items() if name not in clocks and not name.endswith("_at")}
             for each in records if each["kind"] in ("session", "task", "action")]  # fmt: skip
    return sorted(found, key=lambda each: json.dumps(each, sort_keys=True))


def run(study: Path, *arguments: str) -> list[dict[str, Any]]:
    done = run_engine("run", study, "--json", "--seed", "3", *arguments)
    done.check_returncode()
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.slow
def test_a_running_session_is_not_changed_and_the_next_one_speaks_the_new_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    study, tasks = tmp_path / "lab", tmp_path / "tasks.jsonl"
    shutil.copytree(LABLINKING, study)
    tasks.write_text("".join(json.dumps(TASK | {"at": at}) + "\n" for at in (0, 8)))
    undisturbed = run(study, "--tasks", str(tasks), "--speed", "4")

    with Forked("run", study, "--json", "--seed", "3", "--tasks", tasks, "--speed", "2") as session:
        assert session.stdout is not None
        records = []
        for line in session.stdout:
            records.append(json.loads(line))
            if len(spoken(records)) == 1 and spoken(records[-1:]):
                workspace = Workspace(study)
                act = workspace.outline.act("R_Attention")
                assert act is not None
                speech = next(each for each in act.actions if each.calls[0].type == "Speech")
                for variant in range(len(speech.calls)):
                    workspace.apply(SetParameter("R_Attention", speech.id, "message", "Look here!", variant=variant))
                workspace.save()
                workspace.close()
    assert session.returncode == 0
    assert len(spoken(records)) == 2 and told(records) == told(undisturbed)

    after = run(study, "--tasks", str(tasks), "--speed", "max")
    assert spoken(after) == ["Look here!", "Look here!"]
    assert after[0]["scenario_hash"] != records[0]["scenario_hash"]
