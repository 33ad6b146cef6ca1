"""Processes of `rise-engine`, and of other programs of ours, that need not load their modules anew.

To start Python and load the program takes longer than most of what the tests ask of it. So each run of tests has one
process that has loaded everything and does nothing; each command is a fork of it, with its own standard streams,
environment and folder. What a start of Python decides (the encoding of a terminal, the seed of hashes, which modules
are loaded) is that of the first one: tests of these use `subprocess`.
"""

from __future__ import annotations

import asyncio
import atexit
import fcntl
import gc
import io
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from click import Context, Group

from tests.patience import PATIENCE

ENGINE = str(Path(sys.executable).with_name("rise-engine"))
PIPE, DEVNULL, STDOUT = subprocess.PIPE, subprocess.DEVNULL, subprocess.STDOUT

_server: tuple[socket.socket, subprocess.Popen[bytes]] | None = None
_asking = threading.Lock()


class Forked:
    """Like `subprocess.Popen` with `text=True`, for `rise-engine`. Use it as a context, or wait for its end.

    :param module: instead of `rise-engine`, what `python -m` runs.
    :param code: instead, what `python -c` runs.
    :param terminal: whether `stdin` becomes its controlling terminal, whose keys can interrupt it.
    :param loads: further modules that the first process has loaded from then on.
    """

    stdin: IO[str] | None = None
    stdout: IO[str] | None = None
    stderr: IO[str] | None = None

    def __init__(
        self,
        *arguments: object,
        module: str = "",
        code: str = "",
        terminal: bool = False,
        loads: Sequence[str] = (),
        stdin: int | None = DEVNULL,
        stdout: int | IO[Any] | None = PIPE,
        stderr: int | IO[Any] | None = PIPE,
        env: Mapping[str, str] | None = None,
        cwd: str | os.PathLike[str] | None = None,
    ) -> None:
        self.args = ["-c" if code else module or ENGINE, *map(str, arguments)]
        self.returncode: int | None = None
        self._end, theirs = socket.socketpair()
        given: list[int] = [theirs.fileno()]
        for name, stream, number in (("stdin", stdin, 0), ("stdout", stdout, 1), ("stderr", stderr, 2)):
            if stream == PIPE:
                ours, its = os.pipe() if number else reversed(os.pipe())
                setattr(self, name, os.fdopen(ours, "r" if number else "w", 1, encoding="utf-8"))
                given.append(its)
            elif stream == DEVNULL:
                given.append(os.open(os.devnull, os.O_RDWR))
            elif stream == STDOUT:
                given.append(os.dup(given[-1]))
            elif isinstance(stream, int) or stream is None:
                given.append(os.dup(number if stream is None else stream))
            else:
                given.append(os.dup(stream.fileno()))
        what = {
            "arguments": self.args[1:],
            "module": module,
            "code": code,
            "terminal": terminal,
            "loads": [*loads],
            "environment": dict(os.environ if env is None else env),
            "folder": os.fspath(cwd or Path.cwd()),
        }
        message = json.dumps(what).encode()
        with _asking:  # a test may start several at once, in threads
            server = _fork_server()
            socket.send_fds(server, [len(message).to_bytes(4, "big")], given)
            server.sendall(message)
        theirs.close()
        for each in given[1:]:
            os.close(each)
        self.pid = self._read_number()

    def poll(self) -> int | None:
        return self._look(0)

    def wait(self, timeout: float | None = None) -> int:
        code = self._look(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0)
        return code

    def _look(self, timeout: float | None) -> int | None:
        if self.returncode is None and select.select([self._end], [], [], timeout)[0]:
            self.returncode = self._read_number()
            self._end.close()
        return self.returncode

    def _read_number(self) -> int:
        read = self._end.recv(4, socket.MSG_WAITALL)
        assert len(read) == 4, "the process that the others are forks of has ended"
        return int.from_bytes(read, "big", signed=True)

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with suppress(ProcessLookupError):  # it has ended just now
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, text: str | None = None, timeout: float | None = None) -> tuple[str, str]:
        """Write `text`, read everything, and wait for the end."""
        read = {}

        def read_all(name: str, stream: IO[str]) -> None:
            with stream:
                read[name] = stream.read()

        threads = [
            threading.Thread(target=read_all, args=(name, stream), daemon=True)
            for name, stream in (("out", self.stdout), ("err", self.stderr))
            if stream is not None and not stream.closed
        ]
        for thread in threads:
            thread.start()
        if self.stdin is not None and not self.stdin.closed:
            with suppress(BrokenPipeError), self.stdin:
                self.stdin.write(text or "")
        for thread in threads:
            thread.join(timeout)
            if thread.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout or 0)
        self.wait(timeout)
        return read.get("out", ""), read.get("err", "")

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *error: object) -> None:
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream is not None and not stream.closed:
                stream.close()
        self.wait()


class AsyncForked:
    """The same for a loop, like what `asyncio.create_subprocess_exec` gives: its streams are those of asyncio."""

    stdin: asyncio.StreamWriter
    stdout: asyncio.StreamReader
    stderr: asyncio.StreamReader

    def __init__(self, process: Forked) -> None:
        self._process = process
        self._ended: asyncio.Task[int] | None = None
        self.pid = process.pid
        self.send_signal, self.kill, self.terminate = process.send_signal, process.kill, process.terminate

    @classmethod
    async def start(cls, *arguments: object, **more: Any) -> AsyncForked:
        """The arguments are those of `Forked`."""
        made = cls(Forked(*arguments, **more))
        loop = asyncio.get_running_loop()
        for name in ("stdout", "stderr"):
            if (pipe := getattr(made._process, name)) is not None:
                reader = asyncio.StreamReader()
                await loop.connect_read_pipe(lambda reader=reader: asyncio.StreamReaderProtocol(reader), pipe)  # type: ignore[misc]
                setattr(made, name, reader)
        if (pipe := made._process.stdin) is not None:
            transport, protocol = await loop.connect_write_pipe(asyncio.streams.FlowControlMixin, pipe)
            made.stdin = asyncio.StreamWriter(transport, protocol, None, loop)
        return made

    @property
    def returncode(self) -> int | None:
        return self._process.poll()

    async def wait(self) -> int:
        """Several may wait at once."""
        if self._ended is None:
            self._ended = asyncio.create_task(self._wait())
        return await asyncio.shield(self._ended)

    async def _wait(self) -> int:
        loop, end = asyncio.get_running_loop(), self._process._end
        if self.returncode is None:
            ended = loop.create_future()
            loop.add_reader(end, ended.set_result, None)
            try:
                await ended
            finally:
                loop.remove_reader(end)
        return self._process.wait()


def run_engine(
    *arguments: object, stdin: str | None = None, timeout: float | None = PATIENCE, **more: Any
) -> subprocess.CompletedProcess[str]:
    """`rise-engine`, or another program, run to its end. `more` is for `Forked`."""
    process = Forked(*arguments, stdin=DEVNULL if stdin is None else PIPE, **more)
    try:
        out, err = process.communicate(stdin, timeout)
    except BaseException:
        process.kill()
        process.wait()
        raise
    return subprocess.CompletedProcess(process.args, process.wait(), out, err)


def _fork_server() -> socket.socket:
    """The connection with this process's own server, which ends when the connection does."""
    global _server
    if _server is None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-m", "tests.forked", str(theirs.fileno())]
        with theirs:
            process = subprocess.Popen(
                command, pass_fds=[theirs.fileno()], cwd=Path(__file__).parents[1], stdin=DEVNULL, stdout=DEVNULL
            )
        _server = ours, process
    return _server[0]


# --- in the server ---


def _serve(control: socket.socket) -> dict[str, Any]:
    """Fork for each request until nobody is left who asks. Returns, in each fork, what it is to do."""
    running: dict[int, socket.socket] = {}
    woken, wakes = socket.socketpair()
    woken.setblocking(False)
    wakes.setblocking(False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wakes.fileno())
    gc.freeze()
    while True:
        ready = select.select([control, woken], [], [])[0]
        if woken in ready:
            woken.recv(4096)
            _report_ends(running)
        if control not in ready:
            continue
        head, given, _, _ = socket.recv_fds(control, 4, 4)
        if not head:
            os._exit(0)
        what = json.loads(control.recv(int.from_bytes(head, "big"), socket.MSG_WAITALL))
        end = socket.socket(fileno=given[0])
        if new := {what["module"], *what["loads"]} - sys.modules.keys() - {""}:
            for name in new:
                with suppress(ImportError):
                    import_module(name)
            gc.freeze()
        pid = os.fork()
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever started the tests, such as nohup, may ignore it
            for connection in (control, end, woken, wakes, *running.values()):
                connection.close()
            _become(what, given[1:])
            return what  # type: ignore[no-any-return]
        running[pid] = end
        end.sendall(pid.to_bytes(4, "big"))
        for each in given[1:]:
            os.close(each)


def _report_ends(running: dict[int, socket.socket]) -> None:
    while running:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid == 0:
            return
        with running.pop(pid) as end, suppress(OSError):  # nobody waits for it any more
            end.sendall(os.waitstatus_to_exitcode(status).to_bytes(4, "big", signed=True))


def _become(what: dict[str, Any], streams: list[int]) -> None:
    os.environ.clear()
    os.environ.update(what["environment"])
    os.chdir(what["folder"])
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    if what["terminal"]:
        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    sys.argv = ["-c" if what["code"] else what["module"] or ENGINE, *what["arguments"]]
    if what["environment"].get("PYTHONWARNINGS") == "error":
        warnings.simplefilter("error")
    unbuffered = bool(what["environment"].get("PYTHONUNBUFFERED"))
    sys.stdin = sys.__stdin__ = os.fdopen(0, encoding="utf-8", errors="surrogateescape", closefd=False)  # type: ignore[misc]
    for name, number, errors in (("stdout", 1, "strict"), ("stderr", 2, "backslashreplace")):
        lines = number == 2 or os.isatty(number)
        binary = os.fdopen(number, "wb", 0 if unbuffered else -1, closefd=False)
        text = io.TextIOWrapper(binary, "utf-8", errors, line_buffering=lines, write_through=unbuffered)
        setattr(sys, name, text)
        setattr(sys, f"__{name}__", text)


def _do(what: dict[str, Any]) -> int:
    """Do what was asked for; the exit status. Raises SystemExit for one that is no number."""
    try:
        if what["code"]:
            exec(what["code"], {"__name__": "__main__"})
        elif name := what["module"]:
            if not hasattr(sys.modules.get(name), "__path__"):
                sys.modules.pop(name, None)  # it runs as `__main__`
            runpy.run_module(name, run_name="__main__", alter_sys=True)
        else:
            program.main(prog_name="rise-engine")
    except SystemExit as end:
        if not isinstance(end.code, int | None):
            raise
        return end.code or 0
    return 0


def _end(status: int) -> None:
    """End as Python does, without taking everything apart before, which takes longer than most commands."""
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except Exception:  # what becomes of it then, Python says
        sys.exit(status)
    os._exit(status)


def _load_commands(group: Group) -> None:
    context = Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, Group):
            _load_commands(command)


def load_program() -> None:
    """Load what the commands of `rise-engine` load, which they do late."""
    from rise_engine.cli import program

    _load_commands(program.main)
    for module in ("rise_adapters.simulated", "rise_adapters.ros2.profile_check"):
        import_module(module)
    import_module("rise_engine.scenario.loader").load(Path(__file__).parents[1] / "scenarios" / "greeting")


if __name__ == "__main__":
    from rise_engine.cli import program

    load_program()
    sys.modules["tests.forked"] = sys.modules["__main__"]
    _end(_do(_serve(socket.socket(fileno=int(sys.argv[1])))))
