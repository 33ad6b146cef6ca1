"""Scenario folders: text files in, one checked and immutable `Scenario` out, or findings with file, line and column.

`load` is the door.
"""

from rise_engine.scenario.durations import expected_seconds, limit_seconds
from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.findings import Finding
from rise_engine.scenario.loader import Loaded, load
from rise_engine.scenario.parameters import call_parameters, convert
from rise_engine.scenario.robots import robot_names

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
