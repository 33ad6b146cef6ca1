"""A session without a console: `rise-engine run` after the parsing of its arguments.

In real time it runs on an asyncio loop; in virtual time in a plain loop, without waiting.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base import exit_status
from rise_engine.base.errors import FileError
from rise_engine.cli.session.transcript import Output, ThreadedOutput
from rise_engine.cli.terminal import print_notes
from rise_engine.kernel.inputs import Note, SessionStarted
from rise_engine.kernel.records import AnyRecord, TaskRecord, describe_open_goals
from rise_engine.ports.bridge import Bridge
from rise_engine.run.engine.clock import RealClock, SessionClock, VirtualClock
from rise_engine.run.engine.drivers import make_robot, open_bridge, robot_warnings
from rise_engine.run.engine.engine import MAX_LATE_SECONDS, Engine
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import first_input, start_remarks
from rise_engine.run.protocol.task_file import TaskFileReader, TimedTask, warning_for_task
from rise_engine.run.server.hub import ALIVE_SECONDS, ALLOWED_WITHOUT_CONTROL, POSSIBLY_REPEATED, STOPPING, SessionHub
from rise_engine.scenario.model import Scenario

LIVELOCK = 20_000
"""Number of inputs, without the script's tasks, within which virtual time must advance by LIVELOCK_SECONDS."""
LIVELOCK_SECONDS = 0.1
ENDLESS_AFTER = 86_400.0
"""Virtual seconds after the last scripted task after which a busy session counts as endless."""


class RunOptions(Struct, frozen=True):
    """The session to run, and its end."""

    scenario: Scenario
    session: SessionOptions
    """Its options; `session.first_tasks` are submitted at time 0, in this order, before the script."""
    script: tuple[TimedTask, ...] = ()
    stream: bool = False
    """Read further tasks from standard input while the session runs."""
    virtual: bool = False
    """In virtual time, without ROS 2."""
    until: float | None = None
    """Seconds of session time; None: until nothing happens by itself any more."""
    json: bool = False
    strict: bool = False
    """Whether a rejected or aborted task changes the exit status."""
    started: SessionStarted | None = None
    """The first input, for a session of a study."""

    @property
    def seed(self) -> int:
        return self.session.seed or 0


def run_session(options: RunOptions) -> int:
    """Run a session to its end and return the exit status.

    Raises rise_engine.base.errors.AdapterError and RobotOptionsError, before anything has started.
    """
    if options.virtual:
        return _run_virtual(options)
    return asyncio.run(_run_real(options))


class _HeadlessSession:
    """The common part of real and virtual time: the task file, the reasons to end, the exit status."""

    def __init__(
        self, options: RunOptions, clock: SessionClock, output: Output, bridge: Bridge[SessionHub] | None = None
    ) -> None:
        self.options = options
        scenario = options.scenario
        robot = make_robot(scenario.robot, scenario.mode, clock, options.seed, options.session.faults, bridge)
        begun = options.started or first_input(scenario, options.session)
        speed = getattr(clock, "speed", 1.0)
        self.started = replace(begun, injected_faults=options.session.faults, speed=speed)
        self.engine = Engine(
            scenario,
            robot,
            clock,
            options.seed,
            started=self.started,
            sinks=(output, self._note_failed_task),
        )
        self.output = output
        self.status = exit_status.OK
        self.submitted = 0
        """The number of submitted tasks of the script."""
        self._due: dict[float, list[TimedTask]] = {}
        """Tasks still to be submitted, by their time."""
        self.streaming = options.stream
        self.may_have_old_requests: Callable[[], bool] = lambda: False
        """Whether this process has just stood still."""
        self._unsuccessful = False
        self._output_failure_reported = False

    def start(self) -> None:
        """Begin the session: submit its first tasks, and schedule those of the task file."""
        engine, clock = self.engine, self.engine.clock
        for task in self.options.script:
            self._print_warning(task)
        engine.start()
        scenario = self.options.scenario
        for sentence in (*robot_warnings(scenario), *start_remarks(scenario, self.started)):
            print_notes(f"warning: {sentence}")
            engine.post(Note(text=sentence))
        for submit in self.options.session.first_tasks:
            engine.accept(submit)
        for task in self.options.script:
            self._schedule(task)
        if self.options.until is not None:
            clock.call_at(self.options.until, lambda: engine.end(f"{self.options.until:g} s are over"))

    def add_task(self, task: TimedTask) -> None:
        """Add a task that came while the session runs; submit it immediately if its time has passed."""
        self._print_warning(task)
        if task.at > self.engine.clock.now():
            self._schedule(task)
        else:
            self._submit(task, POSSIBLY_REPEATED if self.may_have_old_requests() else "")

    def _print_warning(self, task: TimedTask) -> None:
        warning = warning_for_task(task, self.options.scenario)
        if warning is not None:
            print_notes(warning)

    def end_if_idle(self) -> None:
        """With `--until idle`, end the session when it is idle and no task is left to submit."""
        if self.options.until is None and not self._due and not self.streaming and self.engine.idle:
            self.engine.end("nothing is left to do")

    def interrupt(self) -> None:
        """End on the user's request; stop the robot first."""
        self.status = exit_status.INTERRUPTED
        self.engine.end("interrupted", stop=True)

    def end_if_output_failed(self) -> None:
        """End the session when its output can no longer be written, so that no robot continues unrecorded."""
        if self.output.failure is not None:
            if not self._output_failure_reported:
                self._output_failure_reported = True
                error = self.output.failure
                text = f"{type(error).__name__}: {error}".removesuffix(": ")
                print_notes(f"error: a record could not be written ({text}); the session was ended")
                self.status = exit_status.FAILED
                self.engine.end("a record could not be written", stop=True)
        elif self.output.broken and self.status != exit_status.BROKEN_PIPE:
            self.status = exit_status.BROKEN_PIPE
            self.engine.end("nobody reads the output")

    def end_as_endless(self, message: str) -> None:
        """End a session that would never end by itself; `message`: the reason."""
        print_notes(f"error: {message}")
        self.status = exit_status.ENDLESS
        self.engine.end(message, stop=True)

    def status_at_end(self) -> int:
        """Return the exit status of the finished session."""
        if self.engine.open_goals:
            print_notes(f"error: the session has ended; {describe_open_goals(self.engine.open_goals)}")
        if self.engine.failure is not None:
            print_notes(f"error: the engine failed, which is a mistake in this program: {self.engine.failure!r}")
            return exit_status.FAILED
        if self.output.failure is not None:
            self.end_if_output_failed()
            return exit_status.FAILED
        if self.engine.open_goals:
            return exit_status.STILL_RUNNING
        if self.status == exit_status.OK and self.options.strict and self._unsuccessful:
            return exit_status.TASK_FAILED
        return self.status

    def _schedule(self, task: TimedTask) -> None:
        # Tasks of one time share a timer, in the order of their lines: asyncio does not keep the order of timers.
        tasks = self._due.setdefault(task.at, [])
        if not tasks:
            self.engine.clock.call_at(task.at, lambda: self._submit_due(task.at))
        tasks.append(task)

    def _submit_due(self, at: float) -> None:
        late = (self.engine.clock.now() - at) / self.engine.clock.speed
        # Without a standstill, a session that should run a thousand times as fast is only slow.
        is_too_late = late > MAX_LATE_SECONDS and self.may_have_old_requests()
        why_not = f"it was due {late:.0f} s ago" if is_too_late else ""
        for task in self._due.pop(at):
            self._submit(task, why_not)

    def _submit(self, task: TimedTask, why_not: str = "") -> None:
        """Submit a task. `why_not`: the reason if it is too late, unless it only stops something."""
        self.submitted += 1
        if self.engine.ended:
            return
        if not why_not or task.task.function in STOPPING | ALLOWED_WITHOUT_CONTROL:
            self.engine.post(task.task)
            return
        self._unsuccessful = True
        what = f"{task.file}:{task.line}: {task.task.function} {task.task.behavior}".strip()
        self.engine.post(Note(text=f"{what} was not done: {why_not}"))

    def _note_failed_task(self, record: AnyRecord) -> None:
        if isinstance(record, TaskRecord) and record.status in ("REJECTED", "ABORTED"):
            self._unsuccessful = True


# --- virtual time ---------------------------------------------------------------------------------------------------


def _run_virtual(options: RunOptions) -> int:
    clock = VirtualClock()
    session = _HeadlessSession(options, clock, Output(json=options.json))
    engine = session.engine
    interrupts: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        if interrupts:
            sys.exit(exit_status.INTERRUPTED)
        interrupts.append(number)

    horizon = ENDLESS_AFTER + max((task.at for task in options.script), default=0.0)
    with _signals_to(on_signal), _tolerate_engine_failure(engine):
        session.start()
        moment, inputs = clock.now(), engine.inputs
        while not engine.ended:
            session.end_if_output_failed()
            session.end_if_idle()
            if engine.ended or not clock.advance():
                break
            now, handled = clock.now(), engine.inputs - session.submitted
            if now >= moment + LIVELOCK_SECONDS:
                moment, inputs = now, handled
            elif handled - inputs > LIVELOCK:
                if session.status == exit_status.ENDLESS:
                    break
                inputs = handled
                session.end_as_endless(
                    f"{LIVELOCK:,} inputs in one moment, at {now:g} s: something goes round in circles"
                )
            if options.until is None and now > horizon and session.status != exit_status.ENDLESS:
                session.end_as_endless(
                    f"after {now / 3600:.0f} hours of session time something still goes on by itself; "
                    "limit the run: --until SECONDS"
                )
            if interrupts and session.status != exit_status.INTERRUPTED:
                session.interrupt()
        engine.end_now("nothing is left to do")
    return session.status_at_end()


@contextmanager
def _tolerate_engine_failure(engine: Engine) -> Iterator[None]:
    """Suppress the exception of a failed engine, which has stopped the robot; `status_at_end` reports the reason."""
    try:
        yield
    except Exception:
        if engine.failure is None:
            raise


@contextmanager
def _signals_to(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Call `handler` for the signals that end a session inside the block."""
    before = [(each, signal.signal(each, handler)) for each in _ending_signals()]
    try:
        yield
    finally:
        for each, handler_before in before:
            signal.signal(each, handler_before)


def _ending_signals() -> list[signal.Signals]:
    """SIGINT, SIGTERM, and SIGHUP for a lost terminal, unless the program was started to survive that."""
    survives = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    return [signal.SIGINT, signal.SIGTERM, *([] if survives else [signal.SIGHUP])]


# --- real time ------------------------------------------------------------------------------------------------------


async def _run_real(options: RunOptions) -> int:
    bridge = await open_bridge(options.session.ros, options.scenario.robot, options.scenario.mode)
    try:
        return await _run_connected(options, bridge)
    finally:
        if bridge is not None:
            await bridge.close()


async def _run_connected(options: RunOptions, bridge: Bridge[SessionHub] | None) -> int:
    loop = asyncio.get_running_loop()
    output = ThreadedOutput(json=options.json)
    session = _HeadlessSession(options, RealClock(loop, options.session.speed), output, bridge)
    engine = session.engine
    hub = SessionHub(engine)
    session.may_have_old_requests = hub.may_have_old_requests
    if bridge is not None:
        bridge.join(hub)
    ended = asyncio.Event()
    engine.on_ended(ended.set)
    engine.after_inputs = lambda: loop.call_soon(session.end_if_idle)

    def on_output_failure() -> None:
        with suppress(RuntimeError):  # the session is over and its loop is closed
            loop.call_soon_threadsafe(session.end_if_output_failed)

    output.on_failure = on_output_failure
    interrupts: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        if len(interrupts) == 1:
            loop.call_soon_threadsafe(session.interrupt)
        # At a logout, SIGTERM and several SIGHUPs come within milliseconds: only repeated ctrl+c may abandon a robot.
        elif number == signal.SIGINT and (pressed := interrupts.count(signal.SIGINT)) > 1:
            is_real = options.scenario.mode == "real"
            if pressed > 1 + is_real:
                sys.exit(exit_status.STILL_RUNNING if is_real else exit_status.INTERRUPTED)
            print_notes(
                "the robot is being stopped; press ctrl+c again to leave at once, although it may still be moving"
            )

    for each in _ending_signals():
        # Python runs `on_signal` only when the loop does something. This handler makes each signal wake the loop, even
        # one that comes just before it begins to wait.
        loop.add_signal_handler(each, lambda: None)
    watching = loop.create_task(_note_alive(hub))
    with _signals_to(on_signal):
        try:
            with _tolerate_engine_failure(engine):
                session.start()
                if options.stream:
                    _submit_from_standard_input(loop, session)
                session.end_if_idle()
                await ended.wait()
        finally:
            watching.cancel()
            output.close(hurried=lambda: bool(interrupts))
    return session.status_at_end()


async def _note_alive(hub: SessionHub) -> None:
    """Watch for standstills, until it is cancelled."""
    while True:
        hub.note_alive()
        await asyncio.sleep(ALIVE_SECONDS)


def _submit_from_standard_input(loop: asyncio.AbstractEventLoop, session: _HeadlessSession) -> None:
    """Submit tasks as their lines arrive on standard input; its end ends the script."""
    reader = TaskFileReader("-")

    def submit_line(text: bytes) -> None:
        try:
            task = reader.read_line(text)
        except FileError as error:  # the session continues without this line
            print_notes(*error.lines)
            session.status = exit_status.USAGE
        else:
            if task is not None:
                session.add_task(task)

    def end_stream() -> None:
        session.streaming = False
        session.end_if_idle()

    def read_lines() -> None:
        # Read the descriptor directly: at the program's exit, nothing may wait for a lock of sys.stdin.
        rest = b""
        try:
            descriptor = sys.stdin.fileno()
            while chunk := os.read(descriptor, 65_536):
                *lines, rest = (rest + chunk).split(b"\n")
                for text in lines:
                    loop.call_soon_threadsafe(submit_line, text)
            if rest:
                loop.call_soon_threadsafe(submit_line, rest)
            loop.call_soon_threadsafe(end_stream)
        except RuntimeError:  # the session is over and its loop is closed
            return
        except (AttributeError, OSError, ValueError):  # there is no standard input
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(end_stream)

    threading.Thread(target=read_lines, name="rise-stdin", daemon=True).start()
