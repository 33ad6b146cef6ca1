"""The server behind `--web`: on this machine's own address only, one console for each browser window, all observers."""

from __future__ import annotations

import asyncio
import json
import signal
import socket
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from getpass import getuser
from pathlib import Path
from typing import Any

import click
import textual_serve
from aiohttp import WSCloseCode, WSMsgType, web

from rise_engine.errors import RiseError
from rise_engine.protocol.registry import RegistryError, ask_summary
from rise_tui.rendering.text import clean
from rise_tui.web.admission import Admission, PendingConnection
from rise_tui.web.auth import TokenAuth
from rise_tui.web.page import STATIC, console_page, security_headers, token_page
from rise_tui.web.terminal import WebTerminal

ADDRESS = "127.0.0.1"
MOST_CONSOLES = 8
"""Consoles at one time: each is a process of its own."""
FONT_SIZES = (6, 16, 40)
"""Least, usual and largest size of the letters, in pixels (`/?fontsize=20`)."""
STATICS = Path(textual_serve.__file__).parent / "static"
_MOST_MESSAGE_BYTES = 100_000
"""Bytes of one message from a browser."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class WebError(RiseError):
    """Nothing is served; the text says why, for a person."""


def serve(name: str, arguments: Sequence[str], port: int) -> None:
    """Serve consoles on a running session until SIGINT, SIGTERM or SIGHUP.

    `name`: the session's, or its socket. `arguments`: with which the console of each browser is started. `port`: 0 for
    any that is free. Raises WebError.
    """
    listening = _listen(port)
    with suppress(KeyboardInterrupt):
        asyncio.run(BrowserServer(name, _session_title(name), arguments).run(listening))


def _listen(port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((ADDRESS, port))
        listening.listen(64)
    except OSError as error:
        listening.close()
        reason = f"port {port} cannot be used: {error.strerror or error}"
        raise WebError(f"{reason}; name another one with --web PORT, or any that is free with --web 0") from None
    return listening


def _session_title(name: str) -> str:
    try:
        found = ask_summary(name)
    except RegistryError:
        found = None
    return clean(found.title) if found is not None else name


class BrowserServer:
    """Pages and consoles of one session."""

    def __init__(self, name: str, title: str, arguments: Sequence[str]) -> None:
        self.auth = TokenAuth()
        self._name, self._title, self._arguments = name, title, tuple(arguments)
        self._browsers: set[web.WebSocketResponse] = set()
        self._admission = Admission()

    async def run(self, listening: socket.socket) -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, stop.set)
        runner = web.AppRunner(self.application(), access_log=None, shutdown_timeout=10.0)
        await runner.setup()
        server = runner.server
        assert server is not None
        port = listening.getsockname()[1]
        open_port = await loop.create_server(
            lambda: PendingConnection(self._admission, server()), sock=listening, backlog=128
        )
        try:
            self._print_address(port)
            await stop.wait()
        finally:
            open_port.close()
            await runner.cleanup()

    def application(self) -> web.Application:
        app = web.Application(middlewares=[self._authenticate])
        app.add_routes(
            [
                web.get("/", self._serve_page),
                web.get("/ws", self._serve_console),
                web.static(STATIC, STATICS),
            ]
        )
        app.on_shutdown.append(self._close_consoles)
        return app

    def _print_address(self, port: int) -> None:
        for line in (
            f"{self._title} ({self._name}) in browsers on this machine, to watch, add notes, and stop everything:",
            "",
            f"  http://{ADDRESS}:{port}/?token={self.auth.token}",
            "",
            "To see it on another computer, leave this running there and open the same address:",
            "",
            f"  ssh -N -L {port}:{ADDRESS}:{port} {getuser()}@{socket.gethostname()}",
            "",
            "Whoever has the address can watch. ctrl+c ends this; the session goes on.",
        ):
            click.echo(line)

    @web.middleware
    async def _authenticate(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Nothing is answered before it is certain who asks."""
        host = request.headers.get("Host")
        if host is None or not self.auth.is_local_host(host):
            return _refusal("this address is only for browsers on this machine, or at the end of a tunnel to it")
        if "token" in request.query:
            if request.path != "/" or not self.auth.is_token(request.query["token"]):
                return _refusal("this is not the token: take the whole address that rise-tui --web has printed")
            self._admission.admit(request.transport)
            answer = web.Response(
                text=token_page(_font_size(request)), content_type="text/html", headers=security_headers(host)
            )
            answer.set_cookie(self.auth.cookie, self.auth.token, httponly=True, samesite="Strict", path="/")
            return answer
        if not self.auth.is_token(request.cookies.get(self.auth.cookie)):
            return _refusal("open the whole address, with its token, that rise-tui --web has printed")
        if request.path == "/ws" and not self.auth.is_own_origin(request.headers.get("Origin"), host):
            return _refusal("only a page of this server can open a console")
        self._admission.admit(request.transport)
        try:
            answer_to = await handler(request)
        except web.HTTPException as error:
            error.headers.update(security_headers(host))
            raise
        if not answer_to.prepared:
            answer_to.headers.update(security_headers(host))
        return answer_to

    async def _serve_page(self, request: web.Request) -> web.Response:
        return web.Response(text=console_page(self._title, request.host, _font_size(request)), content_type="text/html")

    async def _serve_console(self, request: web.Request) -> web.WebSocketResponse:
        browser = web.WebSocketResponse(heartbeat=15.0, max_msg_size=_MOST_MESSAGE_BYTES, compress=True)
        await browser.prepare(request)
        if len(self._browsers) >= MOST_CONSOLES:
            await browser.send_bytes(f"{MOST_CONSOLES} consoles are open here already; close one of them\r\n".encode())
            await browser.close(code=WSCloseCode.TRY_AGAIN_LATER)
            return browser
        self._browsers.add(browser)
        try:
            width, height = (_parse_number(request.query.get(side), 0) for side in ("width", "height"))
            terminal = await WebTerminal.open(self._arguments, width or 80, height or 24)
            shown = asyncio.create_task(_send_output(terminal, browser))
            try:
                await _receive_input(terminal, browser)
            finally:
                shown.cancel()
                with suppress(asyncio.CancelledError):
                    await shown
                await asyncio.shield(terminal.close())
        finally:
            self._browsers.discard(browser)
        return browser

    async def _close_consoles(self, app: web.Application) -> None:
        for browser in list(self._browsers):
            await browser.close(code=WSCloseCode.GOING_AWAY)


async def _send_output(terminal: WebTerminal, browser: web.WebSocketResponse) -> None:
    with suppress(ConnectionError):
        async for data in terminal.read_output():
            await browser.send_bytes(data)
    await browser.close()


async def _receive_input(terminal: WebTerminal, browser: web.WebSocketResponse) -> None:
    """What the browser sends: pairs of a word and a value, as the script of textual-serve makes them."""
    async for message in browser:
        if message.type is not WSMsgType.TEXT:
            continue
        try:
            word, *rest = json.loads(message.data)
        except (ValueError, TypeError, RecursionError):
            continue
        match word, rest:
            case "stdin", [str(typed)]:
                terminal.write_input(typed.encode("utf-8", "replace"))
            case "resize", [{"width": int(width), "height": int(height)}]:
                terminal.resize(width, height)
            case "ping", [value]:
                await browser.send_json(["pong", value])


def _font_size(request: web.Request) -> int:
    least, usual, most = FONT_SIZES
    return min(max(_parse_number(request.query.get("fontsize"), usual), least), most)


def _parse_number(text: str | None, otherwise: int) -> int:
    return int(text) if text is not None and text.isdecimal() and len(text) < 6 else otherwise


def _refusal(why: str) -> web.Response:
    more: dict[str, Any] = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}
    return web.Response(status=403, text=f"{why}\n", headers=more)
