"""LabRecorder, which records the streams of a lab (LSL) to one XDF file, over its remote control: lines on TCP.

https://github.com/labstreaminglayer/App-LabRecorder. Its answer `OK` (without a line end) means only that it has read a
command, and no command returns its state. So this module checks the file. The remote control changes the given name to
lower case and renames an existing file, so each recording gets a new name.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from rise_adapters.recorders.options import OptionReader
from rise_adapters.recorders.program import new_path, recording_stem, size_of
from rise_engine.base.text import clean
from rise_engine.ports.recorder import MediaKind, RecorderError, RecorderStatus, RecordingPlan
from rise_engine.scenario.model import Json

DEFAULT_PORT = 22345
ANSWER_SECONDS = 2.0
"""Time limit in seconds of one answer."""
UPDATE_SECONDS = 2.0
"""Seconds from the request to look for streams until the existing ones are found."""
FILE_SECONDS = 1.5
"""Seconds that `start` waits for the file."""


class LabRecorder:
    """One LabRecorder. Each call opens its own connection."""

    kind: MediaKind = "streams"
    stalled_after = 12.0  # without fast streams, it writes every 5 to 10 s

    def __init__(self, name: str, options: Mapping[str, Json]) -> None:
        """
        :param name: the recorder's name, a part of the file's name.
        :param options: `host`, `port`, and on another computer `folder`, the file's folder there.
        :raises RecorderError: with all errors.
        """
        self.name = name
        read = OptionReader(options, ("host", "port", "folder"))
        self.host = read.text("host", "127.0.0.1")
        self.port = read.number("port", DEFAULT_PORT, 1, 65_535)
        self.folder = read.text("folder")
        if "}" in self.folder or "\n" in self.folder:
            read.refuse("`folder` has no } in it: LabRecorder cannot read that")
        read.finish()
        self._path = ""
        self._updated_at = 0.0
        self._stopped = True

    async def prepare(self, plan: RecordingPlan) -> str:
        """Check that it answers, and let it look for streams."""
        self.plan = plan
        await self._send("update")
        self._updated_at = asyncio.get_running_loop().time()
        return f"LabRecorder at {self.host}:{self.port}"

    async def start(self) -> str:
        """Record every stream into a new file, and check that the file exists."""
        place = Path(self.folder) if self.folder else self.plan.folder
        stem = recording_stem(self.plan, self.name).lower()
        path = new_path(place, stem, ".xdf")
        if "}" in str(place):
            raise RecorderError(f"LabRecorder cannot write into a folder with a brace in its name: {place}")
        await asyncio.sleep(max(0.0, self._updated_at + UPDATE_SECONDS - asyncio.get_running_loop().time()))
        self._path, self._stopped = str(path), False
        await self._send(f"filename {{root:{place}}}{{template:{path.name}}}", "start")
        if self._is_here:
            for _ in range(round(FILE_SECONDS / 0.05)):
                if size_of(path) is not None:
                    break
                await asyncio.sleep(0.05)
            else:
                raise RecorderError(
                    f"LabRecorder said OK, and there is no {path}: does it see a stream, and may it write there?"
                )
        return self._path

    async def status(self) -> RecorderStatus:
        """The size of its file. On another computer, only whether LabRecorder answers."""
        if self._is_here:
            return RecorderStatus(True, bytes=size_of(Path(self._path)) or 0, path=self._path)
        _, writer = await self._connect()
        writer.close()
        return RecorderStatus(True, path=self._path)

    async def stop(self) -> str:
        """End the recording."""
        if self._stopped:
            return ""
        await self._send("stop")
        self._stopped = True
        if self._is_here and not size_of(Path(self._path)):
            raise RecorderError(f"nothing was recorded: there is no {self._path}")
        return self._path

    async def close(self) -> None:
        """Do nothing: LabRecorder keeps running."""

    @property
    def _is_here(self) -> bool:
        return self.host in ("127.0.0.1", "localhost", "::1")

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                return await asyncio.open_connection(self.host, self.port)
        except TimeoutError:
            why = f"no answer within {ANSWER_SECONDS:g} s"
        except OSError as error:
            why = error.strerror or str(error)
        raise RecorderError(
            f"LabRecorder cannot be reached at {self.host}:{self.port} ({why}): "
            "is it running, with its remote control on?"
        )

    async def _send(self, *commands: str) -> None:
        """Send commands in order, each after the previous one was read. Raises RecorderError."""
        reader, writer = await self._connect()
        try:
            for command in commands:
                word = command.split()[0]
                try:
                    async with asyncio.timeout(ANSWER_SECONDS):
                        writer.write(command.encode() + b"\n")
                        await writer.drain()
                        answer = await reader.readexactly(2)
                except TimeoutError:
                    raise RecorderError(f"LabRecorder did not answer within {ANSWER_SECONDS:g} s ({word})") from None
                except (OSError, asyncio.IncompleteReadError):
                    raise RecorderError(f"LabRecorder cut the connection ({word})") from None
                if answer != b"OK":
                    answered = clean(answer.decode("utf-8", "replace"))
                    raise RecorderError(f"the program at {self.host}:{self.port} is not LabRecorder: {answered!r}")
        finally:
            writer.close()
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(0.2):
                    await writer.wait_closed()
