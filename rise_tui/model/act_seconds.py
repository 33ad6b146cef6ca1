"""How long an action that has been sent will probably take."""

from __future__ import annotations

from rise_engine.kernel.task_view import ActionView
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Scenario


def estimate_action_seconds(scenario: Scenario, action: ActionView) -> float | None:
    """Seconds, with the parameters that it was sent with; None for an action that the robot does not know."""
    spec = scenario.robot.actions.get(action.type)
    return expected_seconds(spec, action.parameters) if spec is not None else None
