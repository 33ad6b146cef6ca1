"""Bags of ROS 2 (https://github.com/ros2/rosbag2), in one of two ways.

- As a child process, `ros2 bag record`: works with every release. SIGINT makes it write the bag's metadata.yaml and
  end.
- A recorder that already runs (`node = "/rosbag2_recorder"`), through its services `record` and `stop`, which Jazzy has
  since rosbag2 0.26.10. On Jazzy it stays paused after a stop, so that the next bag would be empty. So it is resumed
  after `record`, and its state is checked.

A bag is a new folder. Its file grows in steps, because messages are collected until a chunk is full.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rise_adapters.recorders.options import OptionReader
from rise_adapters.recorders.program import RecordingProgram, new_path, recording_stem, size_of
from rise_engine.base.errors import AdapterError
from rise_engine.base.text import clean
from rise_engine.ports.recorder import (
    MediaKind,
    Recorder,
    RecorderError,
    RecorderStatus,
    RecordingPlan,
)
from rise_engine.scenario.model import Json

if TYPE_CHECKING:
    from rise_adapters.ros2.transport.port import Message, Transport

STALLED_AFTER = 30.0
ANSWER_SECONDS = 2.0
"""Time limit in seconds of one answer of a service."""
FOUND_SECONDS = 3.0
"""Time limit in seconds for finding a recorder's services."""
METADATA_SECONDS = 2.0
"""Maximum seconds from `stop` until metadata.yaml exists."""
METADATA = "metadata.yaml"
_OPTIONS = ("node", "topics", "arguments", "program", "ros", "ros_arguments")


def open_rosbag2(name: str, options: Mapping[str, Json]) -> Recorder:
    """Make the recorder of bags for these options.

    :param name: the recorder's name, a part of the bag's name.
    :param options: `topics` (empty: all), `arguments` (of `ros2 bag record`), `program`; or `node`, `ros`,
        `ros_arguments`.
    :raises RecorderError: with all errors.
    """
    read = OptionReader(options, _OPTIONS)
    node = read.text("node") if "node" in options else ""
    topics = read.texts("topics", 'topics = ["/rise/record", "/camera/image"]')
    arguments = read.texts("arguments", 'arguments = ["--compression-mode", "file"]')
    program = read.text("program", "ros2")
    ros = read.choice("ros", ("auto", "rclpy", "dds"))
    ros_arguments = read.texts("ros_arguments", 'ros_arguments = ["--ros-args", "-r", "__ns:=/lab"]')
    of_node = [key for key in ("ros", "ros_arguments") if key in options]
    of_program = [key for key in ("topics", "arguments", "program") if key in options]
    if node:
        if not node.startswith("/"):
            read.refuse('`node` is the full name of the node that records: node = "/rosbag2_recorder"')
        for key in of_program:
            read.refuse(
                f"`{key}` is for a recorder that is started for the session; the recorder at `node` has its own"
            )
    else:
        for key in of_node:
            read.refuse(f"`{key}` goes with `node`, a recorder that runs already")
    read.finish()
    if node:
        return BagOverServices(name, node, ros, ros_arguments)
    return BagByProgram(name, program, topics, arguments)


class BagByProgram:
    """`ros2 bag record`, started for the session."""

    kind: MediaKind = "bag"
    stalled_after = STALLED_AFTER

    def __init__(self, name: str, program: str, topics: list[str], arguments: list[str]) -> None:
        self.name, self.program, self.topics, self.arguments = name, program, topics, arguments
        self._run: RecordingProgram | None = None
        self._path: Path | None = None

    async def prepare(self, plan: RecordingPlan) -> str:
        """Check that the program exists."""
        self.plan = plan
        trial = RecordingProgram(f"{self.program} bag record")
        lines: list[str] = []
        await trial.start([self.program, "bag", "record", "--help"], lines.append)
        try:
            await trial.gone.wait()
        finally:
            trial.close()
        if trial.process is None or trial.process.returncode != 0:
            raise RecorderError(trial.ending())
        return f"{self.program} bag record"

    async def start(self) -> str:
        """Record into a new bag."""
        path = self._path = new_path(self.plan.folder, recording_stem(self.plan, self.name))
        run = self._run = RecordingProgram(f"{self.program} bag record")
        topics = self.topics or ["--all"]
        await run.start([self.program, "bag", "record", "--output", str(path), *self.arguments, *topics])
        while size_of(path) is None and run.runs:  # noqa: ASYNC110  # a folder that another program makes
            await asyncio.sleep(0.05)
        if not run.runs:
            raise RecorderError(run.ending(), ended=True)
        return str(path)

    async def status(self) -> RecorderStatus:
        """The total size of the bag."""
        run, path = self._run, self._path
        assert run is not None and path is not None
        if not run.runs:
            raise RecorderError(run.ending(), ended=True)
        return RecorderStatus(True, bytes=size_of(path) or 0, path=str(path))

    async def stop(self) -> str:
        """End the program, which completes the bag."""
        run, path = self._run, self._path
        if run is None or path is None:
            return ""
        ended_well = await run.end()
        if not ended_well:
            raise RecorderError(f"{run.name} did not end when it was asked to, and was killed: {_reindex(path)}")
        if not (path / METADATA).exists():
            raise RecorderError(f"the bag has no {METADATA}: {_reindex(path)}")
        return str(path)

    async def close(self) -> None:
        """Kill the program if it still runs."""
        if self._run is not None:
            self._run.close()


class BagOverServices:
    """A recorder that already runs."""

    kind: MediaKind = "bag"
    stalled_after = STALLED_AFTER

    def __init__(self, name: str, node: str, ros: str, ros_arguments: list[str]) -> None:
        self.name, self.node, self.ros, self.ros_arguments = name, node.rstrip("/"), ros, ros_arguments
        self._transport: Transport | None = None
        self._path: Path | None = None
        self._is_ours = False

    async def prepare(self, plan: RecordingPlan) -> str:
        """Check that it exists and accepts requests."""
        self.plan = plan
        await self._call("is_paused", "IsPaused")
        return f"the bag recorder {self.node} over {self._opened.about}"

    async def start(self) -> str:
        """Record into a new bag, and check that it receives messages."""
        path = self._path = new_path(self.plan.folder, recording_stem(self.plan, self.name))
        self._is_ours = True  # even without an answer
        answer = await self._call("record", "Record", {"uri": str(path)})
        if answer.get("return_code"):
            self._is_ours = False
            reason = clean(str(answer.get("error_string", "")))
            raise RecorderError(
                f"{self.node} refused to record (code {answer['return_code']})" + (reason and f": {reason}")
            )
        await self._call("resume", "Resume")
        if (await self._call("is_paused", "IsPaused")).get("paused"):
            raise RecorderError(f"{self.node} has made a bag and stays paused: nothing would be in it")
        return str(path)

    async def status(self) -> RecorderStatus:
        """The size of a bag on this computer, and whether the recorder accepts messages."""
        paused = (await self._call("is_paused", "IsPaused")).get("paused") is True
        size = size_of(self._path) if self._path is not None else None
        return RecorderStatus(not paused, bytes=size, path=str(self._path or ""))

    async def stop(self) -> str:
        """End the bag, and wait for its metadata. A bag that this session did not start continues."""
        path = self._path
        if not self._is_ours or path is None:
            return ""
        problem: RecorderError | None = None
        try:
            await self._call("stop", "Stop")
        except RecorderError as error:  # later releases have another type of answer
            problem = error
        if size_of(path) is None:
            if problem is not None:
                raise problem
            return str(path)  # it is on another computer
        for _ in range(round(METADATA_SECONDS / 0.05)):
            if (path / METADATA).exists():
                return str(path)
            await asyncio.sleep(0.05)
        raise problem or RecorderError(f"the bag has no {METADATA}: {_reindex(path)}")

    async def close(self) -> None:
        """Disconnect; the recorder keeps running."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()

    @property
    def _opened(self) -> Transport:
        assert self._transport is not None
        return self._transport

    async def _call(self, service: str, type: str, request: Message | None = None) -> Message:
        """Return the answer of a service of the recorder. Raises RecorderError."""
        from rise_adapters.ros2.transport.selection import open_transport  # imports a transport of ROS

        try:
            if self._transport is None:
                self._transport = await open_transport(self.ros, self.ros_arguments, node="rise_recorders")
            client = self._opened.client(f"{self.node}/{service}", f"rosbag2_interfaces/srv/{type}")
        except AdapterError as error:
            raise RecorderError(" ".join(str(error).split())) from None
        answer: asyncio.Future[Message] = asyncio.get_running_loop().create_future()

        def take(message: Message) -> None:
            if not answer.done():
                answer.set_result(message)

        try:
            for _ in range(round(FOUND_SECONDS / 0.05)):
                if client.count_servers():
                    break
                await asyncio.sleep(0.05)
            else:
                what = "is the recorder running, and is it of rosbag2 0.26.10 or later?"
                raise RecorderError(f"there is no service {self.node}/{service}: {what}")
            client.call(request or {}, take)
            async with asyncio.timeout(ANSWER_SECONDS):
                return await answer
        except TimeoutError:
            raise RecorderError(f"{self.node}/{service} did not answer within {ANSWER_SECONDS:g} s") from None
        except AdapterError as error:
            raise RecorderError(str(error)) from None
        finally:
            client.close()


def _reindex(path: Path) -> str:
    return f"`ros2 bag reindex {path}` repairs it"
