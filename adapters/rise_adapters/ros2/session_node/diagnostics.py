"""What `/diagnostics` says about a session, once a second (diagnostic_msgs/msg/DiagnosticArray)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rise_adapters.ros2.transport.port import Message
from rise_engine.base.text import escape_surrogates
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.run.server.hub import SessionHub

TOPIC = "/diagnostics"
TYPE = "diagnostic_msgs/msg/DiagnosticArray"
SECONDS = 1.0

OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""

LAG_WARN, LAG_ERROR = 0.05, 0.5
"""Seconds that the engine's loop may be late: a key that takes longer than the first is felt."""


def session_statuses(hub: SessionHub, lag: tuple[float, float], ros: Message, private: PrivateValues) -> list[Message]:
    """One DiagnosticStatus for each part of the session.

    `lag`: seconds that the loop was late at most, lately and ever. `ros`: the status of the connection to ROS itself.
    `private`: what stays out of it.
    """
    return [_session_status(hub, private), _robot_status(hub), _journal_status(hub), _lag_status(hub, *lag), ros]


def make_status(hub: SessionHub, name: str, level: int, message: str, values: Mapping[str, object]) -> Message:
    """A DiagnosticStatus. The hardware is the robot."""
    return {
        "level": level,
        "name": f"rise: {name}",
        "message": escape_surrogates(message),
        "hardware_id": hub.engine.scenario.robot.name,
        "values": [{"key": key, "value": escape_surrogates(str(value))} for key, value in values.items()],
    }


def _session_status(hub: SessionHub, private: PrivateValues) -> Message:
    engine, view = hub.engine, hub.view
    scenario = engine.scenario
    level, message = OK, "running" if view.running else "idle"
    if engine.failure is not None:
        level, message = ERROR, f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
    elif view.ended or engine.ended:
        level, message = STALE, f"the session has ended: {view.end_reason}".removesuffix(": ")
    elif view.session is None:
        level, message = STALE, "the session has not begun yet"
    elif view.stop.latched:
        level, message = WARN, "everything is stopped, until the stop is released"
        if view.stop.unconfirmed:
            level, message = ERROR, f"stopped, but not confirmed by {', '.join(view.stop.unconfirmed)}"
    running = [view.tasks[id].behavior for id in view.running if id in view.tasks]
    values = {
        "title": scenario.title,
        "mode": scenario.mode,
        "scenario_hash": scenario.hash,
        "seconds": f"{max(engine.clock.now(), 0.0):.1f}",
        "records": view.seq,
        "acts running": private.hide_value(", ".join(running[:20])),
        "acts waiting": len(view.waiting),
        "rules running": ", ".join(view.running_rules()[:20]),
        "control": view.control or "nobody",
        "clients": len(hub.clients),
        "stop": view.stop.status,
        "stop confirmed": ", ".join(view.stop.confirmed),
        "stop not confirmed": ", ".join(view.stop.unconfirmed),
    }
    return make_status(hub, "session", level, message, values)


def _robot_status(hub: SessionHub) -> Message:
    robot = hub.view.robot
    if robot is None:
        level, message = STALE, "no word from the robot yet"
    else:
        level = {"connected": OK, "degraded": WARN}.get(robot.status, ERROR)
        message = f"{robot.status}: {robot.detail}" if robot.detail else robot.status
    profile = hub.engine.scenario.robot
    driver = "simulated" if hub.engine.scenario.mode == "debug" else profile.driver
    since = {"since": robot.wall} if robot is not None else {}
    return make_status(hub, "robot link", level, message, {"robot": profile.title, "driver": driver, **since})


def _journal_status(hub: SessionHub) -> Message:
    journaling = hub.engine.journal_status
    if journaling.trouble:
        level, message = ERROR, f"nothing can be recorded, so the session is paused: {journaling.trouble}"
    elif journaling.behind:
        level, message = WARN, f"the disk is {journaling.behind:.1f} s behind"
    elif not hub.folder:
        level, message = OK, "this session is not recorded"
    else:
        level, message = OK, "recording"
    values = {"folder": Path(hub.folder).name, "durable": journaling.durable, "behind": f"{journaling.behind:.1f}"}
    return make_status(hub, "journal", level, message, values)


def _lag_status(hub: SessionHub, recent: float, most: float) -> Message:
    level = OK if recent < LAG_WARN else WARN if recent < LAG_ERROR else ERROR
    message = "in time" if level == OK else f"the engine was up to {recent:.2f} s late in the last seconds"
    return make_status(hub, "loop lag", level, message, {"recent (s)": f"{recent:.4f}", "most (s)": f"{most:.4f}"})
