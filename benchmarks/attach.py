"""Attaching to a session of 100,000 records: wall time until a client has its state. The target is a second.

The floor is the minimum of any method: encoding the state once and decoding it once, in the same run. The engine is a
separate process, as for a console. The client's time is measured, including the loading of its scenario.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import msgspec
from measure import Report

ROOT = Path(__file__).parents[1]
RECORDS = 100_000
ROUNDS = 7

ENGINE = """
import asyncio, sys
from contextlib import closing
from pathlib import Path
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.engine import Engine
from rise_engine.kernel.inputs import Submit
from rise_engine.run.protocol.registry import acquire_lock
from rise_engine.run.server.hub import SessionHub
from rise_engine.run.server.server import SessionServer
from rise_engine.run.engine.drivers import make_robot
from rise_engine.scenario.loader import load
from rise_engine.session.folder import create_session

async def main(root, records):
    loaded = load("scenarios/lablinking")
    scenario = loaded.scenario
    folder = create_session(Path(root) / "sessions", scenario, loaded.files, seed=1, faults=(), versions={})
    clock = RealClock(asyncio.get_running_loop(), 1000)
    engine = Engine(scenario, make_robot(scenario.robot, scenario.mode, clock, 1, ()), clock, 1)
    with closing(acquire_lock("attach")) as name:
        hub = SessionHub(engine, str(folder))
        server = SessionServer(hub, name.socket)
        await server.start()
        engine.start()
        number = 0
        while hub.view.seq < records:
            act = ("R_Task1_Step1", "R_Praise", "R_Nod")[number % 3]
            engine.post(Submit(function="startCommunicationRobotAct", behavior=act, source="wizard:anna"))
            engine.post(Submit(function="assignValue", behavior=f"step = {number}", source="wizard:anna"))
            engine.post(Submit(function="raiseEventTopic", behavior="/next", source="wizard:anna"))
            number += 1
            if len(hub.view.waiting) > 5:
                await asyncio.sleep(0.002)
        print(name.socket, flush=True)
        await asyncio.to_thread(sys.stdin.read)
        engine.end_now("done")
        await server.close()

asyncio.run(main(sys.argv[1], int(sys.argv[2])))
"""


def main() -> bool:
    from rise_engine.kernel.task_view import TaskView
    from rise_engine.kernel.view import SessionView
    from rise_engine.run.client.socket import SocketClient
    from rise_engine.run.protocol.messages import ViewWithoutTasks, with_tasks, without_tasks

    async def attach(path: str) -> tuple[float, SessionView]:
        client = SocketClient(Path(path), "bench", "observer")
        begun = time.perf_counter()
        attachment = await client.attach()
        took = time.perf_counter() - begun
        await client.close()
        return took, attachment.view

    def bare(view: SessionView) -> float:
        begun = time.perf_counter()
        state, tasks = msgspec.json.encode(without_tasks(view)), msgspec.json.encode(list(view.tasks.values()))
        with_tasks(msgspec.json.decode(state, type=ViewWithoutTasks), msgspec.json.decode(tasks, type=list[TaskView]))
        return time.perf_counter() - begun

    report = Report("Attach to a running session", "wall time")
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    before = os.environ.get("RISE_RUNTIME")
    os.environ["RISE_RUNTIME"] = f"{root}/run"
    try:
        with subprocess.Popen(
            [sys.executable, "-c", ENGINE, root, str(RECORDS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        ) as engine:
            assert engine.stdout is not None and engine.stdin is not None
            path = engine.stdout.readline().strip()
            attached, floor = [], []
            asyncio.run(attach(path))
            for _ in range(ROUNDS):
                took, view = asyncio.run(attach(path))
                attached.append(took)
                floor.append(bare(view))
            engine.stdin.close()
    finally:
        shutil.rmtree(root)
        if before is None:
            del os.environ["RISE_RUNTIME"]
        else:
            os.environ["RISE_RUNTIME"] = before
    ours, least = statistics.median(attached), statistics.median(floor)
    size = len(msgspec.json.encode(list(view.tasks.values())))
    report.row("records, tasks in the state", f"{view.seq:,}, {len(view.tasks):,}", f"{size / 1e6:.1f} MB")
    report.row("encode and decode the state, nothing else", f"{least * 1000:.0f} ms")
    report.row("attach, scenario loaded", f"{ours * 1000:.0f} ms", f"{json.dumps([round(a, 3) for a in attached])}")
    report.row("against the floor", f"{ours / least:.1f} times")
    report.target("seconds to attach to 100,000 records", ours, 1.0, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
