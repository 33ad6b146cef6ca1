"""Robots that answer as they are told, and a scenario for them."""

from __future__ import annotations

from pathlib import Path

from rise_engine.checks.programs import ChildRequest
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.ports.robot import Clock, ReportCallback
from rise_engine.scenario.model import RobotProfile
from tests.cli.processes import folder

ACTIONS = "[actions.Speech]\n[actions.LookAt]\n[actions.Animation]\n"
PROFILE = f'title = "Lamp"\ndriver = "lamp"\n{ACTIONS}'


def scenario(path: Path, toml: str = "", *, profile: str = PROFILE) -> ChildRequest:
    """A scenario with the robot `lamp`, and the request to look for it."""
    made = folder(path / "scenario", f'robot = "lamp"\nmode = "real"\n{toml}')
    (made / "robots").mkdir()
    (made / "robots" / "lamp.toml").write_text(profile)
    return ChildRequest("robot", str(made), mode="real", sessions=str(path / "sessions"))


class Lamp:
    """A `Driver` by its class methods: what it says is set on the class that a test makes of it."""

    links: tuple[tuple[float, str, str], ...] = ((0.0, "connected", "Lamp on a wire"),)
    """When, how it stands, and in what words."""
    ending: str | None = "succeeded"
    """Of every action, after a second; None: it never ends."""
    reason = ""

    def __init__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> None:
        self.profile = profile
        self.clock = clock
        self.closed = False
        type(self).made = self

    made: Lamp

    def connect(self, report: ReportCallback) -> None:
        self.report = report
        for at, status, detail in self.links:
            change = RobotChanged(status=status, detail=detail)  # type: ignore[arg-type]
            if at == 0:
                report(change)
            else:
                self.clock.call_at(at, lambda change=change: report(change))  # type: ignore[misc]

    def start(self, goal: StartAction) -> None:
        self.said = goal.parameters.get("message")
        if self.ending is not None:
            ending = ActionReport(action=goal.action, status=self.ending, reason=self.reason)  # type: ignore[arg-type]
            self.clock.call_at(self.clock.now() + 1.0, lambda: self.report(ending))

    def cancel(self, action: str) -> None:
        self.report(ActionReport(action=action, status="canceled"))

    def stop_all(self) -> None:
        self.report(StopReport(confirmed=("lamp",)))

    def last_seen(self) -> float | None:
        return None

    def close(self) -> None:
        self.closed = True
