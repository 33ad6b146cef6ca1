"""A session with its face on DDS, for `test_face_dds`: python -m tests.ros.session_node_process FOLDER DOMAIN

Says `ready PATH` with the socket of the session when it runs, and ends when its standard input does; then it says how
late its loop was.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from pathlib import Path

from rise_adapters.ros2.transport.dds import DdsTransport

from rise_engine.base.files import Disk
from rise_engine.run.server.server import SessionServer
from tests.ros.session_node_bench import faced

LOOPBACK = (
    "<General><AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface name='lo'/></Interfaces></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    "<Peers><Peer address='localhost'/></Peers></Discovery>"
)
"""Cyclone's settings with which nothing leaves the machine."""


def environment(domain: int) -> dict[str, str]:
    """Nothing but that, in a domain."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "CYCLONE", "AMENT"))}
    return {**kept, "CYCLONEDDS_URI": LOOPBACK, "ROS_DOMAIN_ID": str(domain)}


async def main(place: Path, domain: int) -> None:
    loop = asyncio.get_running_loop()
    transport = DdsTransport(loop, node="rise", environment=environment(domain))
    async with faced(place, transport, speed=20, disk=Disk()) as session:
        server = SessionServer(session.hub, place / "socket")
        await server.start()
        print("ready", place / "socket", flush=True)
        await loop.run_in_executor(None, sys.stdin.read)
        print(json.dumps({"late": server.lag.max, "tasks": len(session.hub.view.tasks)}), flush=True)
        await server.close()
    transport.close()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
