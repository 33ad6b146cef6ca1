"""`rise-engine serve`: one session in a process of its own, which no console can take down.

The process claims the session's name, makes or takes up the session's folder, runs the engine, and listens on the
session's socket until the session ends. SIGTERM and SIGINT stop the robot and end the session in order; SIGHUP, which a
lost terminal sends, is ignored.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import socket
from contextlib import suppress
from functools import partial
from pathlib import Path
from random import SystemRandom
from typing import TYPE_CHECKING, TypeAlias

import msgspec

from rise_engine import exit_status
from rise_engine.engine.clock import RealClock
from rise_engine.engine.drivers import DriverError, RobotOptionsError, make_robot, open_bridge, simulated_robot_warning
from rise_engine.engine.engine import Engine, ResumeState, versions
from rise_engine.errors import RiseError
from rise_engine.kernel.inputs import Note
from rise_engine.ports.bridge import Bridge, BridgeError, RosConnection
from rise_engine.ports.robot import Robot
from rise_engine.protocol.registry import RegistryError, SessionLock, acquire_lock, session_name
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.scenario import load
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.study import condition_problem
from rise_engine.server.hub import SessionHub
from rise_engine.server.server import SessionServer
from rise_engine.server.spawn import StartupProgress, StartupReport
from rise_engine.session.folder import (
    JOURNAL,
    SessionError,
    belongs_to,
    create_session,
    describe_session,
    find_session,
    find_unfinished,
    mark_abandoned,
    participant_text,
    read_info,
    running_sessions,
    sessions_folder,
)
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header
from rise_engine.session.lock import JournalLock, JournalLockedError, one_at_a_time, running_message
from rise_engine.session.recovery import RecoveredSession, recover
from rise_engine.text import escape_all_surrogates

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

END_SECONDS = 6.0
"""Real seconds that the robot gets to confirm the last stop."""
RECORD_SECONDS = 5.0
"""Real seconds that the disk gets to take the last records."""
POLL_SECONDS = 0.5


ReportStartup: TypeAlias = "Callable[[StartupReport | StartupProgress], None]"
"""How an engine's process tells whoever started it how far it is, and at last whether it serves."""


class ServeRefused(RiseError):
    """Nothing is served."""

    def __init__(
        self,
        code: int,
        *lines: str,
        unfinished: Sequence[Path] = (),
        others: Sequence[Path] = (),
        socket: str = "",
    ) -> None:
        super().__init__("\n".join(lines))
        self.report = StartupReport(
            code, lines=list(lines), unfinished=_descriptions(unfinished), others=_descriptions(others), socket=socket
        )


def _descriptions(folders: Sequence[Path]) -> list[tuple[str, str]]:
    return [(str(folder), describe_session(folder)) for folder in folders]


def serve(options: SessionOptions, say: ReportStartup) -> int:
    """Serve a session until it ends; gives the exit status. `say` gets the progress, and then one `StartupReport`."""
    try:
        session = _SessionPreparation(options, say)
    except ServeRefused as refusal:
        say(refusal.report)
        return refusal.report.code
    try:
        return asyncio.run(_SessionProcess(session, say).run())
    except ServeRefused as refusal:
        say(refusal.report)
        return refusal.report.code
    finally:
        session.close()


class _SessionPreparation:
    """Everything that can be refused, before anything runs."""

    def __init__(self, options: SessionOptions, say: ReportStartup) -> None:
        self.options = options
        self._report = say
        self.recovered: RecoveredSession | None = None
        self.lock: JournalLock | None = None
        """Of the journal of a session that goes on, until that is open."""
        try:
            self.name = options.socket_name or session_name(Path(options.folder))
            claimed = acquire_lock(self.name)
        except RegistryError as error:
            raise ServeRefused(exit_status.FAILED, str(error)) from None
        if claimed is None:
            raise ServeRefused(
                exit_status.ALREADY_RUNNING, f"a session of this scenario is running already: {self.name}"
            )
        self.name_lock: SessionLock = claimed
        try:
            self._choose_session()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let go of what is still held."""
        if self.lock is not None:
            self.lock.release()
        self.name_lock.close()

    def _choose_session(self) -> None:
        options = self.options
        self._refuse_if_running()
        which: Path | None = None
        if options.unfinished not in ("ask", "new", "recover"):
            try:
                which = find_session(options.unfinished)
                self._check_participant(which)
            except SessionError as error:
                raise ServeRefused(exit_status.USAGE, str(error)) from None
        else:
            there = find_unfinished(str(Path(options.folder).absolute()))
            meant = [
                folder for folder in there if belongs_to(read_info(folder), options.participant, options.condition)
            ]
            others = [folder for folder in there if folder not in meant]
            if there and options.unfinished == "ask":
                raise ServeRefused(
                    exit_status.UNFINISHED,
                    "an earlier session of this scenario did not end: recover it, or begin a new one",
                    unfinished=meant,
                    others=others,
                )
            if others and not meant and options.unfinished == "recover":
                raise ServeRefused(
                    exit_status.UNFINISHED,
                    f"no session of {participant_text(options.participant, options.condition)} waits to be recovered",
                    others=others,
                )
            if meant and options.unfinished == "recover":
                which = meant[0]
            for folder in meant if options.unfinished == "new" else ():  # others' stay to be recovered
                mark_abandoned(folder)
        if which is not None:
            self._recover(which)
        else:
            self._load_scenario()

    def _refuse_if_running(self) -> None:
        """One session of a scenario at a time, whoever's environment its engine has, unless somebody gave it a name."""
        if self.options.socket_name is not None:
            return
        for folder, holder in running_sessions(str(Path(self.options.folder).absolute())).items():
            socket = holder.socket if holder is not None and holder.is_this_computer else ""
            raise ServeRefused(exit_status.ALREADY_RUNNING, running_message(folder, holder), socket=socket)

    def _check_participant(self, which: Path) -> None:
        """Nobody's session goes on as somebody else's. Raises SessionError."""
        options, info = self.options, read_info(which)
        if not belongs_to(info, options.participant, options.condition):
            named = participant_text(options.participant, options.condition)
            raise SessionError(
                f"{which.name} is the session of {participant_text(info.participant, info.condition)}, not of {named}: "
                "nothing was started"
            )

    def _load_scenario(self) -> None:
        options = self.options
        loaded = load(options.folder, robot=options.robot, mode=options.mode, paths=options.paths)
        if loaded.scenario is None:
            raise ServeRefused(exit_status.REFUSED, *map(str, loaded.diagnostics))
        self.scenario: Scenario = loaded.scenario
        if problem := condition_problem(self.scenario, options.condition):
            raise ServeRefused(exit_status.USAGE, f"error: {problem}")
        self.seed = options.seed if options.seed is not None else SystemRandom().randrange(2**31)
        self.speed, self.faults, self.wire = options.speed, options.faults, options.ros
        self._files = loaded.files

    def open_journal(self, open: Callable[[Path, int, JournalLock | None], Journal]) -> Journal:
        """Of the session that goes on, or of a new one in a folder of its own, once nothing is in its way."""
        try:
            if self.recovered is not None:
                journal = open(self.folder / JOURNAL, self.recovered.size, self.lock)
                self.lock = None  # it is the journal's now
                return journal
            root = sessions_folder()
            with suppress(OSError):
                root.mkdir(0o700, parents=True, exist_ok=True)
            with one_at_a_time(root):
                self._refuse_if_running()
                self._make_folder()
                return open(self.folder / JOURNAL, 0, None)
        except OSError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, f"the journal cannot be opened: {error}") from None
        except SessionError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, str(error)) from None

    def _make_folder(self) -> None:
        try:
            self.folder = create_session(
                sessions_folder(),
                self.scenario,
                self._files,
                seed=self.seed,
                speed=self.speed,
                faults=self.faults,
                wire=self.wire,
                versions=versions(),
                participant=self.options.participant,
                condition=self.options.condition,
                wizard=self.options.wizard,
            )
        except SessionError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, str(error)) from None

    def _recover(self, which: Path) -> None:
        try:
            with one_at_a_time(which.parent):
                self._refuse_if_running()
                self.lock = JournalLock(which / JOURNAL, here=self.options.from_other_computer)
            self.recovered = recover(which, lock=self.lock, on_progress=self._report_recovery)
        except JournalLockedError as error:
            holder = error.holder
            socket = holder.socket if holder and holder.is_this_computer else ""
            raise ServeRefused(exit_status.ALREADY_RUNNING, str(error), socket=socket) from None
        except SessionError as error:
            raise ServeRefused(exit_status.UNRECOVERABLE, f"{which.name} cannot be recovered: {error}") from None
        info = self.recovered.info
        self.scenario, self.folder = self.recovered.scenario, which
        self.seed, self.speed, self.faults = info.seed, info.speed, info.faults
        self.wire = RosConnection(info.ros, info.ros_args)

    def _report_recovery(self, sentence: str) -> None:
        self._report(StartupProgress(f"recovering: {sentence}"))

    async def connect(self) -> Bridge[SessionHub] | None:
        """The connection to ROS, where the session has one."""
        try:
            return await open_bridge(self.wire, self.scenario.robot, self.scenario.mode)
        except BridgeError as error:
            raise ServeRefused(exit_status.REFUSED, *(f"error: {line}" for line in error.lines)) from None

    def make_robot(self, clock: RealClock, bridge: Bridge[SessionHub] | None) -> Robot:
        try:
            return make_robot(self.scenario.robot, self.scenario.mode, clock, self.seed, self.faults, bridge)
        except DriverError as error:
            raise ServeRefused(exit_status.REFUSED, f"error: {error}") from None
        except RobotOptionsError as error:
            raise ServeRefused(exit_status.USAGE, f"error: {error}") from None


class _SessionProcess:
    """The running session."""

    def __init__(self, prepared: _SessionPreparation, say: ReportStartup) -> None:
        self.prepared = prepared
        self.report = say
        self.ending = False
        self.unrecorded = False

    async def run(self) -> int:
        # A driver that is not installed, or an option that it does not take, is found before a session is made.
        bridge = await self.prepared.connect()
        try:
            return await self._serve(bridge)
        finally:
            if bridge is not None:
                await bridge.close()

    async def _serve(self, bridge: Bridge[SessionHub] | None) -> int:
        prepared, recovered = self.prepared, self.prepared.recovered
        self.loop = asyncio.get_running_loop()
        clock = RealClock(self.loop, prepared.speed, recovered.t if recovered is not None else 0.0)
        robot = prepared.make_robot(clock, bridge)
        journal = prepared.open_journal(partial(self._open_journal, clock))
        engine = self.engine = self._make_engine(robot, clock, journal)
        view = recovered.view if recovered is not None else None
        hub = SessionHub(engine, str(prepared.folder), view=view, end=self.end)
        server = SessionServer(hub, prepared.name_lock.socket)
        if bridge is not None:
            bridge.join(hub)
        ended = asyncio.Event()
        engine.on_ended(ended.set)
        self._handle_signals()
        try:
            await server.start()
        except OSError as error:
            raise ServeRefused(exit_status.FAILED, f"the session's socket cannot be made: {error}") from None
        journal.lock.write_holder(str(prepared.name_lock.socket.absolute()))
        looking = self.loop.create_task(self._poll_journal(engine))
        self._start_engine(engine, recovered)
        if bridge is not None:
            engine.post(Note(text=f"the session is on {bridge.about}"))
        self._report_ready()
        try:
            await ended.wait()
        finally:
            looking.cancel()
            _notify_systemd("STOPPING=1")
            await server.close()
            recorded = await asyncio.to_thread(journal.close, RECORD_SECONDS)
        if engine.failure is not None:
            return exit_status.FAILED
        return exit_status.OK if recorded and not self.unrecorded else exit_status.NOT_WRITTEN

    def _open_journal(self, clock: RealClock, path: Path, size: int, lock: JournalLock | None) -> Journal:
        loop = self.loop

        def changed() -> None:
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(self.engine.flush_durable)

        return Journal(path, size=size, lock=lock, changed=changed, now=clock.now)

    def _make_engine(self, robot: Robot, clock: RealClock, journal: Journal) -> Engine:
        prepared, recovered = self.prepared, self.prepared.recovered
        resumption = None
        if recovered is None:
            journal.append(encode_header(f"rise-tui {versions()['rise-tui']}"))
        else:
            if recovered.unwritten_lines:
                journal.append(recovered.unwritten_lines)
            resumption = ResumeState(recovered.kernel, recovered.inputs, recovered.timers, "its engine had gone")
        return Engine(
            prepared.scenario,
            robot,
            clock,
            prepared.seed,
            participant=prepared.options.participant,
            condition=prepared.options.condition,
            journal=journal,
            resumption=resumption,
        )

    def _handle_signals(self) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            self.loop.add_signal_handler(number, self.end, f"ended by {number.name}")
        self.loop.add_signal_handler(signal.SIGHUP, lambda: None)

    def _report_ready(self) -> None:
        prepared, recovered = self.prepared, self.prepared.recovered
        lines = list(recovered.report) if recovered is not None else []
        name, folder = prepared.name, str(prepared.folder)
        self.report(StartupReport(exit_status.OK, name, folder, lines, recovered=recovered is not None))
        _notify_systemd("READY=1")

    def _start_engine(self, engine: Engine, recovered: RecoveredSession | None) -> None:
        if recovered is not None:
            engine.resume()
            for sentence in recovered.report:
                engine.post(Note(text=sentence))
            return
        engine.start()
        warning = simulated_robot_warning(engine.scenario.robot, engine.scenario.mode)
        if warning is not None:
            engine.post(Note(text=warning))
        for submit in self.prepared.options.first_tasks:
            engine.post(submit)

    def end(self, reason: str) -> None:
        """Stop the robot, end the session, and do not wait for ever for either robot or disk."""
        if self.ending:
            return
        self.ending = True
        self.engine.end(reason, stop=True if self.engine.busy else None)
        self.loop.call_later(END_SECONDS, self.engine.end_now, reason)
        self.loop.call_later(END_SECONDS + RECORD_SECONDS, self._abandon)

    def _abandon(self) -> None:
        if not self.engine.ended:
            self.unrecorded = True
            logging.getLogger(__name__).error("the disk did not take the last records: %s", self.engine.journal_status)
            self.engine.abandon()

    async def _poll_journal(self, engine: Engine) -> None:
        while True:
            await asyncio.sleep(POLL_SECONDS)
            engine.flush_durable()


def report_to_pipe(descriptor: int) -> ReportStartup:
    """How it says it to whoever started it and waits at the other end of a pipe."""

    def say(word: StartupReport | StartupProgress) -> None:
        with suppress(OSError):  # it has gone; the session goes on without it
            os.write(descriptor, msgspec.json.encode(escape_all_surrogates(msgspec.to_builtins(word))) + b"\n")
        if isinstance(word, StartupReport):
            os.close(descriptor)

    return say


def _notify_systemd(state: str) -> None:
    """For a unit of Type=notify (sd_notify(3))."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.connect("\0" + address[1:] if address.startswith("@") else address)
        notify.send(state.encode())
