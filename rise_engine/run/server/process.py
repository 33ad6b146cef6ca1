"""`rise-engine serve`: one session in its own process, which survives its consoles.

`SessionPreparation` decides what to run. The process runs its engine and serves the session's socket. SIGTERM and
SIGINT stop the robot and end the session in order; SIGHUP, which a lost terminal sends, is ignored.
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

from rise_engine.base import exit_status
from rise_engine.base.json_codec import encode
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import (
    RecordingStatus,
    StopRecord,
    describe_open_goals,
)
from rise_engine.ports.bridge import Bridge
from rise_engine.ports.robot import Robot
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import driver_name_for, robot_warnings
from rise_engine.run.engine.engine import END_SECONDS, Engine, versions
from rise_engine.run.protocol.client import JournalStatus, Update
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import start_remarks
from rise_engine.run.server.companions import Companions
from rise_engine.run.server.find_marks import find_marks_later
from rise_engine.run.server.hub import SessionHub
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.run.server.server import SessionServer
from rise_engine.run.server.spawn import EngineStarted, ReportStartup, StartOutcome, StartupProgress
from rise_engine.run.server.take_over import ScenarioTakeover
from rise_engine.session.folder import has_ended
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header

RECORD_SECONDS = 5.0
"""Real seconds for the disk to store the last records."""
EARLIER_GOALS_SECONDS = 5.0
"""Seconds after a recovery, or after the last wizard has left, in which a wizard can decide about open goals."""
POLL_SECONDS = 0.5
"""Interval for checking the journal, so that a lag shows, and this process, so that a standstill shows."""

_ENDING = (signal.SIGTERM, signal.SIGINT)
"""The signals that end the session."""


def serve(options: SessionOptions, report: ReportStartup) -> int:
    """Serve a session until it ends.

    :param options: what to run.
    :param report: gets the progress, and finally whether the session is served.
    :return: the exit status.
    """
    preparation: SessionPreparation | None = None
    early: list[str] = []

    def on_signal(number: int, frame: object) -> None:
        """Remember it until the session can be ended: a recovery must not leave the robot unattended."""
        if number in _ENDING:
            early.append(signal.Signals(number).name)

    before = {number: signal.signal(number, on_signal) for number in (*_ENDING, signal.SIGHUP)}
    try:
        preparation = SessionPreparation(options, report)
        return asyncio.run(_SessionProcess(preparation, report, early).run())
    except ServeRefused as refusal:
        report(refusal.report)
        return refusal.report.code
    finally:
        if preparation is not None:
            preparation.close()
        for number, handler in before.items():
            signal.signal(number, handler)


class _SessionProcess:
    """The running session."""

    def __init__(self, prepared: SessionPreparation, report: ReportStartup, early: list[str]) -> None:
        self.prepared = prepared
        self.report = report
        self.early = early
        """The signals from before the session began."""
        self.ending = False
        self.signals = 0
        """The number of signals to end it."""

    async def run(self) -> int:
        # First: a driver may be missing, or refuse an option.
        bridge = await self.prepared.connect()
        try:
            return await self._serve(bridge)
        finally:
            if bridge is not None:
                await bridge.close()

    async def _serve(self, bridge: Bridge[SessionHub] | None) -> int:
        prepared, recovered = self.prepared, self.prepared.recovered
        if self.early and recovered is None:
            raise ServeRefused(exit_status.INTERRUPTED, f"ended by {self.early[0]} before the session began")
        self.loop = asyncio.get_running_loop()
        clock = RealClock(self.loop, prepared.speed, recovered.t if recovered is not None else 0.0)
        robot = prepared.make_robot(clock, bridge)
        journal = prepared.open_journal(self._flush_soon, clock.now)
        engine = self.engine = self._make_engine(robot, clock, journal)
        view = recovered.view if recovered is not None else None
        hub = self.hub = SessionHub(engine, str(prepared.folder), view=view, end=self.end)
        recording = prepared.decide_recording()
        self.companions = Companions(prepared.companions(recording.settings), engine.post, self._recording_status)
        server = SessionServer(hub, prepared.name_lock.socket)
        hub.take_over = ScenarioTakeover(engine, prepared.folder, prepared.options.paths, server.scenario_changed).begin
        if bridge is not None:
            bridge.join(hub)
        hub.subscribe(self._keep_unrecorded_stop)
        ended = asyncio.Event()
        engine.on_ended(ended.set)
        try:
            await server.start()
        except OSError as error:
            raise ServeRefused(exit_status.FAILED, f"the session's socket cannot be made: {error}") from None
        journal.lock.write_holder(str(prepared.name_lock.socket.absolute()))
        polling = self.loop.create_task(self._poll_journal(engine))
        failed = False
        try:
            on_network = f"the session is on {bridge.about}" if bridge is not None else ""
            self._begin(engine, *filter(None, (on_network, recording.remark)))
            await ended.wait()
        except Exception as error:  # the robot must not continue without its engine
            failed = True
            if engine.failure is None:
                logging.getLogger(__name__).error("the session failed", exc_info=error)
            self.end("the engine failed")
            await ended.wait()
        finally:
            polling.cancel()
            _notify_systemd("STOPPING=1")
            await server.close()
            await self.companions.finish()  # outlets, and the recorders of a failed session
            recorded = await asyncio.to_thread(journal.close, RECORD_SECONDS)
            if prepared.study is not None:
                await asyncio.to_thread(prepared.study.note_ended)
                await asyncio.to_thread(find_marks_later, prepared.folder, hub.view)
        if failed or engine.failure is not None:
            return exit_status.FAILED
        if not recorded or not has_ended(prepared.folder):
            return exit_status.NOT_WRITTEN
        if engine.open_goals:
            logging.getLogger(__name__).error("the session has ended; %s", describe_open_goals(engine.open_goals))
            return exit_status.STILL_RUNNING
        return exit_status.OK

    def _begin(self, engine: Engine, *remarks: str) -> None:
        """Begin the session, and end it immediately if a signal came meanwhile."""
        self._start_engine(engine)
        for remark in remarks:
            engine.post(Note(text=remark))
        self._handle_signals()
        if self.early:
            self.end(f"ended by {self.early[0]}")
        if not self.ending:
            self.companions.start()
        self._report_ready()

    def _flush_soon(self) -> None:
        """Flush the engine soon; called on the journal's thread after progress."""
        with suppress(RuntimeError):  # the loop is closed
            self.loop.call_soon_threadsafe(lambda: self.engine.flush_durable())  # the engine may not exist yet

    def _make_engine(self, robot: Robot, clock: RealClock, journal: Journal) -> Engine:
        prepared, recovered = self.prepared, self.prepared.recovered
        if recovered is None:
            journal.append(encode_header(f"rise-tui {versions()['rise-tui']}"))
        elif recovered.unwritten_lines:
            journal.append(recovered.unwritten_lines)
        return Engine(
            prepared.scenario,
            robot,
            clock,
            prepared.seed,
            started=prepared.started,
            journal=journal,
            recovered=recovered,
            session_id=prepared.session_id,
        )

    def _handle_signals(self) -> None:
        for number in _ENDING:
            self.loop.add_signal_handler(number, self._end_by_signal, f"ended by {number.name}")
        self.loop.add_signal_handler(signal.SIGHUP, lambda: None)

    def _report_ready(self) -> None:
        prepared, recovered = self.prepared, self.prepared.recovered
        lines = recovered.report if recovered is not None else []
        self.report(EngineStarted(prepared.name, str(prepared.folder), lines, recovered is not None))
        _notify_systemd("READY=1")

    def _start_engine(self, engine: Engine) -> None:
        recovered = self.prepared.recovered
        if recovered is not None:
            options = engine.scenario.robot.options
            moves = driver_name_for(engine.scenario.robot, engine.scenario.mode) != "simulated"
            waits = moves and options.get("unattended") != "go on"
            engine.resume(waits_for_wizard=waits)
            if (stopper := self._read_unrecorded_stop()) is not None:
                engine.post(Submit(function="stopAll", source=stopper))
            if self.prepared.study is not None:
                for report in self.prepared.study.unrecorded_checks(self.prepared.folder, recovered.view):
                    engine.post(report)
            for sentence in recovered.report:
                engine.post(Note(text=sentence))
            if options.get("leftovers") != "keep":
                self.hub.on_wizards_gone = self._schedule_goal_cancel
                self._schedule_goal_cancel()
            return
        engine.start()
        for report in self.prepared.options.checks:
            engine.post(report)
        for sentence in (*robot_warnings(engine.scenario), *start_remarks(engine.scenario, self.prepared.started)):
            engine.post(Note(text=sentence))
        for submit in self.prepared.options.first_tasks:
            engine.post(submit)
        self._schedule(engine)

    @property
    def _stop_file(self) -> Path:
        """Beside the socket, in memory: it keeps a stop that the disk does not store, for the next engine."""
        return self.prepared.name_lock.socket.with_suffix(".stop")

    def _keep_unrecorded_stop(self, update: Update) -> None:
        with suppress(OSError):  # nothing else is possible
            if isinstance(update, JournalStatus) and update.stop is not None:
                self._stop_file.write_text(f"{self.prepared.folder.name}\n{update.stop.source}", "utf-8")
            elif isinstance(update, StopRecord):
                self._stop_file.unlink(missing_ok=True)

    def _read_unrecorded_stop(self) -> str | None:
        """Return the source of the last stop before the engine died, if the journal does not have it."""
        try:
            session, _, source = self._stop_file.read_text("utf-8").partition("\n")
        except (OSError, UnicodeDecodeError):
            return None
        return source if session == self.prepared.folder.name else None

    def _schedule_goal_cancel(self) -> None:
        self.loop.call_later(EARLIER_GOALS_SECONDS, self._cancel_earlier_goals)

    def _cancel_earlier_goals(self) -> None:
        """Stop the open goals of an earlier engine if no wizard is attached to decide about them."""
        if not self.engine.holding_goals:  # all have ended or were released
            self.hub.on_wizards_gone = lambda: None
        elif not self.hub.has_wizard:
            self.engine.accept(Submit(function="cancelOpenGoals", source="engine"))

    def _schedule(self, engine: Engine) -> None:
        """Schedule the tasks of a rehearsal. Tasks of one time share a timer, because a loop does not order timers."""
        due: dict[float, list[Submit]] = {}
        for timed in self.prepared.options.script:
            due.setdefault(timed.at, []).append(timed.task)

        def submit(tasks: list[Submit]) -> None:
            for task in tasks:
                engine.post(task)

        for at, tasks in due.items():
            engine.clock.call_at(at, partial(submit, tasks))

    def _recording_status(self, name: str) -> RecordingStatus | None:
        record = self.hub.view.recordings.get(name)
        return record.status if record is not None else None

    def _end_by_signal(self, reason: str) -> None:
        self.signals += 1
        if self.signals > 1:  # end immediately
            self.companions.end_quickly()
        self.end(reason)

    def end(self, reason: str) -> None:
        """Stop the robot, let the recorders finish, and end the session, each with a time limit."""
        if self.ending:
            return
        self.ending = self.hub.ending = True
        if self.companions.recording:
            self.engine.stop_before_end()
            self._finishing = self.loop.create_task(self._end_after_companions(reason))
        else:
            self._end_engine(reason)

    async def _end_after_companions(self, reason: str) -> None:
        try:
            await self.companions.finish_recorders()
        finally:
            self._end_engine(reason)

    def _end_engine(self, reason: str) -> None:
        # A signal this early comes without knowledge of an earlier engine's open goals.
        self.engine.end(reason, stop=True if self.early else None)
        self.loop.call_later(END_SECONDS + RECORD_SECONDS, self._abandon)

    def _abandon(self) -> None:
        if not self.engine.ended:
            trouble = self.engine.journal_status.sentence or "it is too slow"
            logging.getLogger(__name__).error("the disk did not take the last records: %s", trouble)
            self.engine.abandon()

    async def _poll_journal(self, engine: Engine) -> None:
        while True:
            self.hub.note_alive()
            await asyncio.sleep(POLL_SECONDS)
            engine.flush_durable()


def report_to_pipe(descriptor: int) -> ReportStartup:
    """Make a report function that writes to a pipe, for the process that started this one.

    :param descriptor: the pipe's; it is closed after the last report.
    """

    def write(message: StartupProgress | StartOutcome) -> None:
        with suppress(OSError):  # nothing reads it any more; the session continues
            os.write(descriptor, encode(message) + b"\n")
        if not isinstance(message, StartupProgress):
            os.close(descriptor)

    return write


def _notify_systemd(state: str) -> None:
    """Notify systemd, for a unit of Type=notify (sd_notify(3))."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.connect("\0" + address[1:] if address.startswith("@") else address)
        notify.send(state.encode())
