"""Scenario folders: text files in, one checked and immutable `Scenario` out, or findings with file, line and column.

`load` is the door. Importing this package is cheap: what reads files is imported when it is first asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rise_engine.scenario.durations import expected_seconds, limit_seconds
    from rise_engine.scenario.findings import Finding
    from rise_engine.scenario.loader import Loaded, load
    from rise_engine.scenario.parameters import call_parameters, convert
    from rise_engine.scenario.relaxng import act_schema_text, rule_schema_text
    from rise_engine.scenario.robots import robot_names

_HOMES = {
    "Finding": "findings",
    "Loaded": "loader",
    "act_schema_text": "relaxng",
    "call_parameters": "parameters",
    "convert": "parameters",
    "expected_seconds": "durations",
    "limit_seconds": "durations",
    "load": "loader",
    "robot_names": "robots",
    "rule_schema_text": "relaxng",
}

__all__ = [
    "Finding",
    "Loaded",
    "act_schema_text",
    "call_parameters",
    "convert",
    "expected_seconds",
    "limit_seconds",
    "load",
    "robot_names",
    "rule_schema_text",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
