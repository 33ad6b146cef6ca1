"""An OBS for tests: obs-websocket 5 as OBS 29 and 30 speak it, with what can go wrong."""

from __future__ import annotations

import asyncio
import base64
import hashlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

SALT, CHALLENGE = "c2FsdA==", "Y2hhbGxlbmdl"


class ObsServer:
    """One OBS. Its attributes say how it behaves, and may be changed while it runs."""

    def __init__(self, password: str = "") -> None:
        self.password = password
        self.recording = False
        self.bytes = 0
        self.grows = True
        self.path = "/home/lab/2026-11-22 14-15-03.mkv"
        self.mute: set[str] = set()
        """Requests that get no answer; `Hello`: the connection does not even begin."""
        self.refuse: dict[str, tuple[int, str]] = {}
        self.requests: list[str] = []
        self.identified: dict[str, Any] = {}
        self.url = ""
        self._sockets: list[web.WebSocketResponse] = []

    async def drop(self) -> None:
        """Cut every connection."""
        for socket in self._sockets:
            await socket.close(code=WSCloseCode.GOING_AWAY)

    async def handle(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(protocols=("obswebsocket.json",))
        await socket.prepare(request)
        self._sockets.append(socket)
        if "Hello" not in self.mute:
            hello: dict[str, Any] = {"obsWebSocketVersion": "5.1.0", "rpcVersion": 1}
            if self.password:
                hello["authentication"] = {"challenge": CHALLENGE, "salt": SALT}
            await socket.send_json({"op": 0, "d": hello})
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                await self._take(socket, message.json())
        return socket

    async def _take(self, socket: web.WebSocketResponse, message: dict[str, Any]) -> None:
        data = message["d"]
        if message["op"] == 1:
            self.identified = data
            secret = base64.b64encode(hashlib.sha256((self.password + SALT).encode()).digest())
            right = base64.b64encode(hashlib.sha256(secret + CHALLENGE.encode()).digest()).decode()
            if self.password and data.get("authentication") != right:
                await socket.close(code=4009, message=b"Authentication failed.")
                return
            await socket.send_json({"op": 2, "d": {"negotiatedRpcVersion": 1}})
        elif message["op"] == 6:
            kind = data["requestType"]
            self.requests.append(kind)
            if kind in self.mute:
                return
            status: dict[str, Any] = {"result": True, "code": 100}
            if kind in self.refuse:
                code, comment = self.refuse[kind]
                status = {"result": False, "code": code, "comment": comment}
            elif kind == "StartRecord" and self.recording:
                status = {"result": False, "code": 500}
            elif kind == "StopRecord" and not self.recording:
                status = {"result": False, "code": 501}
            answer = self._answer(kind) if status["result"] else {}
            reply = {"requestType": kind, "requestId": data["requestId"], "requestStatus": status}
            await socket.send_json({"op": 7, "d": reply | {"responseData": answer}})
            if status["result"] and kind in ("StartRecord", "StopRecord"):
                await self._tell(socket, kind == "StartRecord")

    def _answer(self, kind: str) -> dict[str, Any]:
        match kind:
            case "GetVersion":
                return {"obsVersion": "30.2.3", "obsWebSocketVersion": "5.5.2", "rpcVersion": 1}
            case "GetCurrentProgramScene":
                return {"currentProgramSceneName": "Lab", "sceneName": "Lab"}
            case "GetRecordStatus":
                self.bytes += 5000 if self.grows and self.recording else 0
                return {
                    "outputActive": self.recording,
                    "outputPaused": False,
                    "outputBytes": self.bytes,
                    "outputDuration": 1200,
                    "outputTimecode": "00:00:01.200",
                }
            case "StartRecord":
                self.recording = True
            case "StopRecord":
                self.recording = False
                return {"outputPath": self.path}
        return {}

    async def _tell(self, socket: web.WebSocketResponse, started: bool) -> None:
        """The events that follow, the first of which names no file."""
        words = ("STARTING", "STARTED") if started else ("STOPPING", "STOPPED")
        for word in words:
            event = {
                "outputActive": started,
                "outputState": f"OBS_WEBSOCKET_OUTPUT_{word}",
                "outputPath": None if word.endswith("ING") else self.path,
            }
            await asyncio.sleep(0)
            data = {"eventType": "RecordStateChanged", "eventIntent": 64, "eventData": event}
            await socket.send_json({"op": 5, "d": data})


@asynccontextmanager
async def obs_server(password: str = "") -> AsyncIterator[ObsServer]:
    server = ObsServer(password)
    app = web.Application()
    app.router.add_get("/", server.handle)
    runner = web.AppRunner(app, shutdown_timeout=0.1)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    assert site._server is not None
    port = site._server.sockets[0].getsockname()[1]  # type: ignore[attr-defined]
    server.url = f"ws://127.0.0.1:{port}"
    try:
        yield server
    finally:
        await server.drop()
        await runner.cleanup()
