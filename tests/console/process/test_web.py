"""`rise-tui --web`: a real server process, asked as a browser asks it, and as somebody else would."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from time import monotonic

import pyte
import pytest

aiohttp = pytest.importorskip("aiohttp")
pytest.importorskip("textual_serve")

from rise_engine.protocol.session_options import SessionOptions  # noqa: E402
from rise_engine.server.spawn import EngineStarted, start_engine  # noqa: E402
from rise_tui.web.admission import MOST_WAITING, MOST_WAITING_OF_USER, Admission, PendingConnection, user_of_connection  # noqa: E402
from rise_tui.web.auth import TokenAuth  # noqa: E402
from rise_tui.web.page import console_page, security_headers  # noqa: E402
from tests.console.fake import DEMO  # noqa: E402
from tests.console.terminals import ROOT, UNKNOWN_TO_PYTE, alive, environment_of  # noqa: E402
from tests.patience import PATIENCE  # noqa: E402

pytestmark = pytest.mark.slow


class Serving:
    """A server process on a session that runs."""

    def __init__(self, home: str) -> None:
        self.home = home
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rise_tui", "--web", "0", "--wizard", "next door"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=ROOT,
            env=environment_of(home),
        )
        assert self.process.stdout is not None
        said = ""
        while "ctrl+c ends this" not in said:
            line = self.process.stdout.readline()
            assert line, f"it ended: {said}"
            said += line
        self.said = said
        found = re.search(r"(http://127\.0\.0\.1:(\d+)/)\?token=(\S+)", said)
        assert found is not None
        self.url, self.port, self.token = found[1], int(found[2]), found[3]

    def engines(self) -> list[int]:
        return [int(lock.read_text()) for lock in Path(self.home, "run").glob("*.lock")]

    def consoles(self) -> list[int]:
        """The processes that it has started for browsers."""
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                process, _, rest = path.read_text().partition(" ")
                if int(rest.rpartition(")")[2].split()[1]) == self.process.pid:
                    found.append(int(process))
        return found


@contextmanager
def serving() -> Iterator[Serving]:
    home = mkdtemp(prefix="rise-", dir="/tmp")
    environment = environment_of(home)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("RISE_RUNTIME", "RISE_SESSIONS"):
            patch.setenv(name, environment[name])
        started = start_engine(SessionOptions(DEMO, seed=1))
    assert isinstance(started, EngineStarted)
    it: Serving | None = None
    try:
        it = Serving(home)
        yield it
    finally:
        if it is not None:
            if it.process.poll() is None:
                it.process.kill()
            it.process.wait()
            assert it.process.stdout is not None
            it.process.stdout.close()
        for lock in Path(home, "run").glob("*.lock"):
            with suppress(ProcessLookupError, ValueError):
                os.kill(int(lock.read_text()), signal.SIGKILL)
        rmtree(home, ignore_errors=True)


async def status(url: str, **options: object) -> int:
    async with aiohttp.ClientSession() as browser, browser.get(url, allow_redirects=False, **options) as answer:
        await answer.read()
        return int(answer.status)


async def until(holds: object, what: str) -> None:
    end = monotonic() + PATIENCE
    while not holds():  # type: ignore[operator]
        assert monotonic() < end, what
        await asyncio.sleep(0.05)


class Browser:
    """A terminal in a page, at the other end of a connection."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, width: int, height: int) -> None:
        self.socket = socket
        self._screen = pyte.Screen(width, height)
        self._stream = pyte.ByteStream(self._screen)

    async def until(self, text: str, *, there: bool = True) -> None:
        end = monotonic() + PATIENCE
        while any(text in line for line in self._screen.display) is not there:
            assert monotonic() < end, "\n".join((text, *self._screen.display))
            try:
                message = await self.socket.receive(timeout=1.0)
            except TimeoutError:
                continue
            assert message.type is aiohttp.WSMsgType.BINARY, f"{message}: {self._screen.display}"
            self._stream.feed(UNKNOWN_TO_PYTE.sub("", message.data.decode("latin-1")).encode("latin-1"))

    async def type(self, keys: str) -> None:
        await self.socket.send_str(json.dumps(["stdin", keys]))

    async def resize(self, width: object, height: object) -> None:
        await self.socket.send_str(json.dumps(["resize", {"width": width, "height": height}]))
        if isinstance(width, int) and isinstance(height, int):
            self._screen.resize(height, width)


async def test_a_browser_with_the_token_sees_the_console_and_nobody_else_anything() -> None:
    with serving() as it:
        assert f"ssh -N -L {it.port}:127.0.0.1:{it.port} " in it.said
        welcome = f"{it.url}?token={it.token}"
        for url, more in (
            (it.url, {}),
            (f"{it.url}?token=", {}),
            (f"{it.url}?token={it.token[:-1]}", {}),
            (f"{it.url}?token={it.token}x", {}),
            (f"{it.url}static/js/textual.js", {}),
            (f"{it.url}static/js/textual.js?token={it.token}", {}),
            (f"{it.url}ws", {}),
            (f"{it.url}ws?token={it.token}", {}),
            (welcome, {"headers": {"Host": "evil.example"}}),
            (welcome, {"headers": {"Host": f"127.0.0.1.evil.example:{it.port}"}}),
        ):
            assert await status(url, **more) == 403, url

        jar = aiohttp.CookieJar(unsafe=True)  # it keeps cookies of addresses without a name, as browsers do
        async with aiohttp.ClientSession(cookie_jar=jar) as browser:
            async with browser.get(welcome) as answer:
                text = await answer.text()
                assert answer.status == 200 and it.token not in text and 'content="0;url=/?fontsize=16"' in text
                cookie = answer.headers["Set-Cookie"]
                assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and "Path=/" in cookie
                assert "Domain" not in cookie and answer.headers["Referrer-Policy"] == "no-referrer"
            async with browser.get(it.url) as answer:
                text = await answer.text()
                assert answer.status == 200 and f"ws://127.0.0.1:{it.port}/ws" in text and "Demo study" in text
                assert "connect-src 'self' ws://127.0.0.1" in answer.headers["Content-Security-Policy"]
            async with browser.get(f"{it.url}?fontsize=24") as answer:
                assert 'data-font-size="24"' in await answer.text()
            async with browser.get(f"{it.url}static/js/textual.js") as answer:
                assert answer.status == 200
            for path in ("static/", "static/../../rise_tui/cli.py", "static/%2e%2e/server.py"):
                async with browser.get(f"{it.url}{path}") as answer:
                    assert answer.status in (403, 404), path

            for origin in (None, "null", "http://evil.example", f"https://127.0.0.1:{it.port}", "http://127.0.0.1:1"):
                with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                    await browser.ws_connect(f"{it.url}ws", headers={"Origin": origin} if origin else {})
                assert refused.value.status == 403, origin
            assert it.consoles() == [], "a refused browser has got a console"

            where = f"{it.url}ws?width=100&height=30"
            async with browser.ws_connect(where, headers={"Origin": it.url.rstrip("/")}) as socket:
                seen = Browser(socket, 100, 30)
                await seen.until("WATCHING")
                assert len(it.consoles()) == 1
                for message in ("not for us", "[" * 50_000, '{"a":' * 10_000, "7", "[]"):
                    await socket.send_str(message)
                await seen.resize("wide", 1e9)
                await seen.resize(90, 26)
                await seen.type("?")
                await seen.until("type to search")
                await seen.type("\x1b")
                await seen.until("type to search", there=False)
                await seen.type("\x07")  # ctrl+g: those who watch can stop everything
                await seen.until("■ STOP")
            await until(lambda: it.consoles() == [], "the console outlived its browser")


async def test_who_only_connects_locks_nobody_out() -> None:
    with serving() as it:
        idle = [await asyncio.open_connection("127.0.0.1", it.port) for _ in range(300)]
        half = await asyncio.open_connection("127.0.0.1", it.port)
        half[1].write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        descriptors = Path(f"/proc/{it.process.pid}/fd")
        await until(lambda: len(list(descriptors.iterdir())) < MOST_WAITING + 40, "all of them are kept")
        assert await status(f"{it.url}?token={it.token}") == 200
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            async with browser.get(f"{it.url}?token={it.token}"):
                pass
            async with browser.ws_connect(f"{it.url}ws", headers={"Origin": it.url.rstrip("/")}) as socket:
                seen = Browser(socket, 80, 24)
                await seen.until("WATCHING")
                more = [await asyncio.open_connection("127.0.0.1", it.port) for _ in range(100)]
                await seen.type("?")
                await seen.until("type to search")
        for _, writer in (*idle, *more, half):
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_it_ends_with_its_consoles_and_the_session_goes_on(number: signal.Signals) -> None:
    with serving() as it:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            async with browser.get(f"{it.url}?token={it.token}"):
                pass
            async with browser.ws_connect(f"{it.url}ws", headers={"Origin": it.url.rstrip("/")}) as socket:
                await Browser(socket, 80, 24).until("WATCHING")
                consoles = it.consoles()
                it.process.send_signal(number)
                while (await socket.receive(timeout=PATIENCE)).type is aiohttp.WSMsgType.BINARY:
                    pass
        assert await asyncio.to_thread(it.process.wait, PATIENCE) == 0
        assert consoles and not any(alive(console) for console in consoles)
        assert it.engines() and all(alive(engine) for engine in it.engines())


async def test_a_console_of_a_killed_server_ends_too() -> None:
    with serving() as it:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            async with browser.get(f"{it.url}?token={it.token}"):
                pass
            async with browser.ws_connect(f"{it.url}ws", headers={"Origin": it.url.rstrip("/")}) as socket:
                await Browser(socket, 80, 24).until("WATCHING")
                consoles = it.consoles()
                it.process.kill()
        await until(lambda: not any(alive(console) for console in consoles), "a console was left over")


def test_only_this_machine_can_connect() -> None:
    with serving() as it:
        listening = [
            line.split()[1]
            for table in ("tcp", "tcp6")
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
            if line.split()[3] == "0A" and line.split()[1].endswith(f":{it.port:04X}")
        ]
        assert listening == [f"0100007F:{it.port:04X}"]


def test_without_a_session_and_on_a_taken_port_nothing_is_served(tmp_path: Path) -> None:
    def asked(*arguments: str, home: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "rise_tui", *arguments]
        environment = environment_of(home)
        return subprocess.run(
            command, capture_output=True, text=True, cwd=ROOT, env=environment, check=False, stdin=subprocess.DEVNULL
        )

    done = asked("--web", home=str(tmp_path))
    assert done.returncode == 2 and "no session is running" in done.stderr
    with serving() as it:
        done = asked("--web", str(it.port), home=it.home)
        assert done.returncode == 2 and f"port {it.port} cannot be used" in done.stderr and "--web 0" in done.stderr


# --- the door ---------------------------------------------------------------------------------------------------------


class Wire:
    """A connection's transport, as far as the door looks at it."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.gone = False

    def get_extra_info(self, name: str) -> tuple[str, int]:
        return ("127.0.0.1", 8321 if name == "sockname" else self.number)

    def abort(self) -> None:
        self.gone = True


def visit(door: Admission, wire: Wire) -> PendingConnection:
    visitor = PendingConnection(door, None)
    visitor.transport = wire  # type: ignore[assignment]
    door.add(visitor)
    return visitor


def test_of_too_many_that_wait_the_first_goes_and_who_has_the_token_stays() -> None:
    door = Admission(who_is=lambda here, there: None, own=1000)
    wires = [Wire(number) for number in range(MOST_WAITING + 5)]
    visit(door, wires[0])
    door.admit(wires[0])  # type: ignore[arg-type]
    for wire in wires[1:]:
        visit(door, wire)
    assert [wire.number for wire in wires if wire.gone] == [1, 2, 3, 4] and door.waiting == MOST_WAITING


def test_one_user_of_the_machine_cannot_push_out_another() -> None:
    door = Admission(who_is=lambda here, there: 1001 if there[1] >= 100 else 1000, own=1000)
    own = [Wire(number) for number in range(MOST_WAITING_OF_USER)]
    theirs = [Wire(100 + number) for number in range(200)]
    for wire in (*own, *theirs):
        visit(door, wire)
    assert not any(wire.gone for wire in own)
    assert sum(not wire.gone for wire in theirs) == MOST_WAITING_OF_USER and not theirs[-1].gone


def test_who_waits_too_long_goes_unless_the_token_came() -> None:
    door = Admission(who_is=lambda here, there: None)
    one, other = Wire(1), Wire(2)
    visitors = visit(door, one), visit(door, other)
    door.admit(other)  # type: ignore[arg-type]
    for visitor in visitors:
        door.time_out(visitor)
    assert one.gone and not other.gone and door.waiting == 0


def test_whose_a_connection_is() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        here = server.getsockname()
        with socket.create_connection(here) as visitor:
            there = visitor.getsockname()
            if sys.platform == "linux":
                assert user_of_connection(here, there) == os.getuid()
            assert user_of_connection(here, ("127.0.0.1", 1)) is None
            assert (
                user_of_connection(here, there, Path("/nowhere")) is None
                and user_of_connection(("::1", 1), ("::1", 2)) is None
            )


# --- the parts --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "local"),
    [
        ("127.0.0.1:8321", True),
        ("localhost:9000", True),
        ("localhost", True),
        ("[::1]:8321", True),
        ("localhost.evil.example", False),
        ("127.0.0.1:8321@evil.example", False),
        ("127.0.0.1:", False),
        ("127.0.0.1:8321\n", False),
        ("0.0.0.0:8321", False),
        ("", False),
        (None, False),
    ],
)
def test_which_names_lead_here(host: str | None, local: bool) -> None:
    assert TokenAuth.is_local_host(host) is local


def test_every_server_has_its_own_token_and_cookie() -> None:
    one, other = TokenAuth(), TokenAuth()
    assert one.token != other.token and one.cookie != other.cookie and len(one.token) >= 43
    assert (
        one.is_token(one.token)
        and not one.is_token(other.token)
        and not one.is_token(None)
        and not one.is_token("\udcff")
    )


def test_the_page_loads_nothing_from_elsewhere_and_takes_no_markup() -> None:
    made = console_page("<script>alert(1)</script>", "localhost:1", 16)
    assert "<script>alert" not in made
    hosts = set(re.findall(r"(?:https?:|wss?:)?//[^/\"')\s]+", made))
    assert hosts == {"ws://localhost:1"}
    assert "default-src 'none'" in security_headers("localhost:1")["Content-Security-Policy"]
