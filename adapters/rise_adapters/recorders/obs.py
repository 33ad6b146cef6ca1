"""OBS Studio, through its WebSocket server (obs-websocket 5, part of OBS since 28).

Its protocol: https://github.com/obsproject/obs-websocket. OBS names its file itself and reports the name in the event
`RecordStateChanged`. The time of that event is not the time of the first frame. OBS listens on every network of the
computer, so it has a password. This module reads the password from a file, because study.toml is shared.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import itertools
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rise_adapters.recorders.options import OptionReader
from rise_engine.base.text import clean
from rise_engine.ports.recorder import MediaKind, RecorderError, RecorderStatus, RecordingPlan
from rise_engine.scenario.model import Json

if TYPE_CHECKING:
    from aiohttp import ClientSession, ClientWebSocketResponse

DEFAULT_URL = "ws://127.0.0.1:4455"
ANSWER_SECONDS = 3.0
"""Time limit in seconds of one answer."""
FILE_SECONDS = 1.5
"""Seconds that `stop` waits until OBS reports a complete file."""
_OUTPUT_EVENTS = 1 << 6
_HELLO, _IDENTIFY, _IDENTIFIED, _EVENT, _REQUEST, _RESPONSE = 0, 1, 2, 5, 6, 7
_AUTHENTICATION_FAILED = 4009
_OUTPUT_RUNNING = 500
_LARGEST_MESSAGE = 4_000_000


class ObsRecorder:
    """One OBS. If the connection is cut, the next call connects again. OBS continues to record meanwhile."""

    kind: MediaKind = "video"
    stalled_after = 3.0

    def __init__(self, name: str, options: Mapping[str, Json]) -> None:
        """
        :param name: the recorder's name.
        :param options: `url`, `password_file`.
        :raises RecorderError: with all errors.
        """
        read = OptionReader(options, ("url", "password_file"))
        self.url = read.text("url", DEFAULT_URL)
        if not self.url.startswith(("ws://", "wss://")):
            read.refuse(f'`url` begins with ws:// or wss://: url = "{DEFAULT_URL}"')
        self.password_file = read.text("password_file")
        read.finish()
        self._http: ClientSession | None = None
        self._socket: ClientWebSocketResponse | None = None
        self._reading: asyncio.Task[None] | None = None
        self._answers: dict[str, asyncio.Future[dict[str, Any]]] = {}
        self._numbers = itertools.count(1)
        self._path = ""
        self._is_ours = False
        self._recording, self._complete = asyncio.Event(), asyncio.Event()

    async def prepare(self, plan: RecordingPlan) -> str:
        """Connect; returns the version of OBS and its present scene."""
        version = await self._ask("GetVersion")
        scene = await self._ask("GetCurrentProgramScene")
        name = scene.get("sceneName") or scene.get("currentProgramSceneName") or ""
        return f"OBS {clean(str(version.get('obsVersion', '')))}, scene {clean(str(name))}"

    async def start(self) -> str:
        """Record. A recording that OBS has already begun does not belong to this session."""
        self._recording.clear()
        self._path = ""
        self._is_ours = True  # even without an answer: recording may have begun
        if refusal := _refusal("StartRecord", await self._call("StartRecord")):
            self._is_ours = False
            raise RecorderError(refusal)
        with suppress(TimeoutError):
            async with asyncio.timeout(ANSWER_SECONDS / 2):
                await self._recording.wait()
        return self._path

    async def status(self) -> RecorderStatus:
        """OBS's report of its recording."""
        found = await self._ask("GetRecordStatus", again=True)
        milliseconds = found.get("outputDuration")
        return RecorderStatus(
            recording=found.get("outputActive") is True and found.get("outputPaused") is not True,
            bytes=_whole(found.get("outputBytes")),
            seconds=milliseconds / 1000 if isinstance(milliseconds, int | float) else None,
            path=self._path,
        )

    async def stop(self) -> str:
        """End the recording, and wait until its file is complete. A recording that this session did not start
        continues."""
        if not self._is_ours:
            return ""
        self._complete.clear()
        found = await self._ask("StopRecord")
        self._path = _text(found.get("outputPath")) or self._path
        with suppress(TimeoutError):
            async with asyncio.timeout(FILE_SECONDS):
                await self._complete.wait()
        return self._path

    async def close(self) -> None:
        """Disconnect; OBS keeps running."""
        if self._reading is not None:
            self._reading.cancel()
        if self._http is not None:
            await self._http.close()
        self._http = self._socket = self._reading = None

    # --- the protocol -----------------------------------------------------------------------------------------------

    async def _ask(self, request: str, *, again: bool = False) -> dict[str, Any]:
        """Return OBS's answer. `again`: try a new connection if this one is cut. Raises RecorderError."""
        found = await self._call(request, again=again)
        if refusal := _refusal(request, found):
            raise RecorderError(refusal)
        return _table(found.get("responseData"))

    async def _call(self, request: str, *, again: bool = False) -> dict[str, Any]:
        """Return OBS's answer, even a refusal."""
        socket = await self._connected()
        number = str(next(self._numbers))
        answer = self._answers[number] = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                await socket.send_json({"op": _REQUEST, "d": {"requestType": request, "requestId": number}})
                found: dict[str, Any] = await answer
                return found
        except TimeoutError:
            raise RecorderError(f"OBS did not answer within {ANSWER_SECONDS:g} s ({request})") from None
        except (OSError, RuntimeError) as error:
            if not again:
                raise RecorderError(f"the connection to OBS was cut: {error}") from None
        finally:
            self._answers.pop(number, None)
        return await self._call(request)

    async def _connected(self) -> ClientWebSocketResponse:
        if self._socket is not None and not self._socket.closed and self._reading and not self._reading.done():
            return self._socket
        try:
            from aiohttp import ClientError, ClientSession, ClientTimeout  # an extra
        except ImportError:
            raise RecorderError('OBS is reached by a package that is missing: pip install "rise-tui[obs]"') from None
        await self.close()
        self._http = ClientSession(timeout=ClientTimeout(total=None, connect=ANSWER_SECONDS))
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                socket = await self._http.ws_connect(
                    self.url, protocols=("obswebsocket.json",), max_msg_size=_LARGEST_MESSAGE, heartbeat=None
                )
                await self._identify(socket)
        except TimeoutError:
            raise RecorderError(f"OBS did not answer within {ANSWER_SECONDS:g} s at {self.url}") from None
        except (ClientError, OSError, ValueError) as error:
            raise RecorderError(
                f"OBS cannot be reached at {self.url}: is it running, and is its WebSocket server on (Tools)? ({error})"
            ) from None
        self._socket = socket
        self._reading = asyncio.create_task(self._read(socket))
        return socket

    async def _identify(self, socket: ClientWebSocketResponse) -> None:
        hello = _table(await _receive(socket, _HELLO))
        identify: dict[str, Json] = {"rpcVersion": 1, "eventSubscriptions": _OUTPUT_EVENTS}
        if challenge := _table(hello.get("authentication")):
            identify["authentication"] = challenge_answer(
                await asyncio.to_thread(self._read_password),
                _text(challenge.get("salt")),
                _text(challenge.get("challenge")),
            )
        await socket.send_json({"op": _IDENTIFY, "d": identify})
        await _receive(socket, _IDENTIFIED)

    def _read_password(self) -> str:
        if not self.password_file:
            raise RecorderError('OBS asks for its password: put it into a file of yours alone, password_file = "..."')
        path = Path(self.password_file).expanduser()
        try:
            return path.read_text("utf-8").strip()
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is not text"
            raise RecorderError(
                f"the file with the password of OBS cannot be read ({self.password_file}): {why}"
            ) from None

    async def _read(self, socket: ClientWebSocketResponse) -> None:
        """Pass answers to their callers and note events. The end of the connection cancels all waiting calls."""
        from aiohttp import WSMsgType

        try:
            async for message in socket:
                if message.type is not WSMsgType.TEXT:
                    continue
                with suppress(ValueError):
                    self._take(_table(message.json()))
        finally:
            for answer in self._answers.values():
                if not answer.done():
                    answer.set_exception(ConnectionError("OBS has closed it, or has ended"))

    def _take(self, message: dict[str, Any]) -> None:
        data = _table(message.get("d"))
        if message.get("op") == _RESPONSE:
            answer = self._answers.get(_text(data.get("requestId")))
            if answer is not None and not answer.done():
                answer.set_result(data)
        elif message.get("op") == _EVENT and data.get("eventType") == "RecordStateChanged":
            event = _table(data.get("eventData"))
            self._path = _text(event.get("outputPath")) or self._path
            if event.get("outputState") == "OBS_WEBSOCKET_OUTPUT_STARTED":
                self._recording.set()
            elif event.get("outputState") == "OBS_WEBSOCKET_OUTPUT_STOPPED":
                self._complete.set()


def challenge_answer(password: str, salt: str, challenge: str) -> str:
    """Compute the proof of the password for OBS: base64(SHA-256(base64(SHA-256(password + salt)) + challenge)).

    >>> challenge_answer("supersecretpassword", "lM1GncleQOaCu9lT1yeUZhFYnqhsLLP1G5lAGo3ixaI=",
    ...                  "+IxH4CnCiqpX1rM9scsNynZzbOe4KhDeYcTNS3PDaeY=")
    '1Ct943GAT+6YQUUX47Ia/ncufilbe6+oD6lY+5kaCu4='
    """
    secret = base64.b64encode(hashlib.sha256((password + salt).encode()).digest())
    return base64.b64encode(hashlib.sha256(secret + challenge.encode()).digest()).decode()


async def _receive(socket: ClientWebSocketResponse, wanted: int) -> object:
    """Return the data of the next message, which must be of this kind. Raises RecorderError."""
    from aiohttp import WSMsgType

    message = await socket.receive()
    if message.type is not WSMsgType.TEXT:
        if socket.close_code == _AUTHENTICATION_FAILED:
            raise RecorderError("OBS did not accept the password")
        raise RecorderError(f"OBS has closed the connection (code {socket.close_code})")
    found = _table(message.json())
    if found.get("op") != wanted:
        raise RecorderError("the program there is not OBS, or is older than version 28")
    return found.get("d")


def _refusal(request: str, answer: dict[str, Any]) -> str:
    """Why OBS refuses a request; empty: it does not."""
    status = _table(answer.get("requestStatus"))
    if status.get("result") is True:
        return ""
    code = _whole(status.get("code")) or 0
    if request == "StartRecord" and code == _OUTPUT_RUNNING:
        return "OBS is already recording: stop that first, so that no other recording goes on"
    comment = clean(_text(status.get("comment")))
    return f"OBS refused {request} (code {code})" + (comment and f": {comment}")


def _table(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _whole(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None
