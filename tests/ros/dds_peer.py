"""A process with a DDS transport for test_dds: `python -m tests.ros.dds_peer ROLE`. It ends with its input."""

from __future__ import annotations

import asyncio
import sys
import time

from rise_adapters.ros2.transport.dds import DdsTransport
from rise_adapters.ros2.transport.dds.transport import DdsPublisher
from rise_adapters.ros2.transport.port import QoS

TEXT = "std_msgs/msg/String"
SET = "std_srvs/srv/SetBool"


async def main(role: str) -> None:
    loop = asyncio.get_running_loop()
    transport = DdsTransport(loop, node="peer")
    said = transport.publisher("said", TEXT, QoS(depth=2000))
    if role == "echo":
        transport.subscribe("heard", TEXT, said.publish)
        transport.serve("set", SET, lambda asked, reply: reply({"success": asked["data"], "message": "from the peer"}))
    elif role == "burst":
        transport.subscribe("heard", TEXT, lambda message: _burst(loop, said, int(message["data"])))
    await loop.run_in_executor(None, sys.stdin.read)
    transport.close()


def _burst(loop: asyncio.AbstractEventLoop, said: DdsPublisher, seconds: int) -> None:
    """A thousand messages a second."""
    began, whole, sent = time.monotonic(), seconds * 1000, 0

    def send() -> None:
        nonlocal sent
        due = int((time.monotonic() - began) * 1000)
        while sent < min(due, whole):
            said.publish({"data": str(sent)})
            sent += 1
        if sent < whole:
            loop.call_later(0.001, send)

    send()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
