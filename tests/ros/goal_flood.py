"""DomainTask goals at a steady rate, for `test_face_dds`: python -m tests.ros.goal_flood DOMAIN RATE SECONDS"""

from __future__ import annotations

import asyncio
import json
import os
import sys

from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.transport.dds import DdsTransport

from tests.patience import PATIENCE
from tests.ros.session_node_process import environment


async def main(domain: int, rate: float, seconds: float) -> None:
    loop = asyncio.get_running_loop()
    transport = DdsTransport(loop, node="flood", environment=environment(domain))
    client = ActionClient(transport, "/rise/domain_task", "rise_interfaces/action/DomainTask")
    goal = {"function_type": "raiseEventTopic", "domain_task_behavior": "/noise", "calling_type": ""}
    sent = 0
    answers: list[bool] = []
    async with asyncio.timeout(PATIENCE):
        while not client.count_servers():  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    print("begun", flush=True)
    began = loop.time()
    while (now := loop.time()) < began + seconds:
        while sent < (now - began) * rate:
            client.send(os.urandom(16), goal, answers.append)
            sent += 1
        await asyncio.sleep(0.001)
    lasted = loop.time() - began
    for _ in range(500):
        if len(answers) == sent:
            break
        await asyncio.sleep(0.01)
    print(json.dumps({"sent": sent, "rate": sent / lasted, "answered": len(answers), "accepted": sum(answers)}))
    transport.close()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])))
