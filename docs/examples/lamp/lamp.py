"""A lamp that shows emotions as colours."""

from __future__ import annotations

import socket
from contextlib import suppress
from functools import partial

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.ports.robot import Clock, ReportCallback, Timer
from rise_engine.scenario.model import RobotProfile

COLOURS = {"happy": "yellow", "sad": "blue", "angry": "red"}


class Lamp:
    """Implements `rise_engine.ports.robot.Robot`; the class itself is the `Driver`."""

    def __init__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> None:
        port = profile.options.get("port")
        if not isinstance(port, int):
            raise ValueError(f"{profile.title}: the option `port` is the number of the lamp's UDP port")
        self._address = (str(profile.options.get("host", "127.0.0.1")), port)
        self._title = profile.title
        self._clock = clock
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._running: dict[str, Timer] = {}
        self._report: ReportCallback = _ignore

    def connect(self, report: ReportCallback) -> None:
        self._report = report
        report(RobotChanged(status="connected", detail=f"{self._title} at {self._address[0]}:{self._address[1]}"))

    def start(self, goal: StartAction) -> None:
        emotion = goal.parameters.get("value")
        try:
            self._show(COLOURS[emotion])
        except KeyError:
            self._report(ActionReport(action=goal.action, status="failed", reason=f"no colour stands for {emotion}"))
        except OSError as error:
            self._report(ActionReport(action=goal.action, status="failed", reason=f"the lamp is out of reach: {error}"))
        else:
            self._report(ActionReport(action=goal.action, status="accepted"))
            ends_at = self._clock.now() + goal.expected
            self._running[goal.action] = self._clock.call_at(ends_at, partial(self._end, goal.action, "succeeded"))

    def cancel(self, action: str) -> None:
        if action in self._running:
            self._end(action, "canceled")

    def stop_all(self) -> None:
        for action in tuple(self._running):
            self.cancel(action)
        # The lamp never answers, so we cannot tell whether it is dark: not confirmed.
        self._report(StopReport(unconfirmed=("lamp (it gives no answer)",)))

    def last_seen(self) -> float | None:
        return None

    def close(self) -> None:
        self._report = _ignore
        for action in tuple(self._running):
            self.cancel(action)
        self._socket.close()

    def _end(self, action: str, status: str) -> None:
        self._running.pop(action).cancel()
        with suppress(OSError):  # it is dark already, or out of reach
            self._show("off")
        self._report(ActionReport(action=action, status=status))

    def _show(self, colour: str) -> None:
        self._socket.sendto(colour.encode(), self._address)


def _ignore(report: object) -> None:
    """Reports before `connect` and after `close` go nowhere."""
