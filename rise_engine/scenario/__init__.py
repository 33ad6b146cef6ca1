"""Scenario folders: text files in, one checked and immutable `Scenario` out, or findings with file, line and column.

`load` is the door.
"""

from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.durations import expected_seconds, limit_seconds
from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.parameters import convert_parameter, fill_parameters
from rise_engine.scenario.robot_profiles import robot_names

__all__ = [
    "Diagnostic",
    "LoadResult",
    "act_schema_text",
    "convert_parameter",
    "expected_seconds",
    "fill_parameters",
    "limit_seconds",
    "load",
    "robot_names",
    "rule_schema_text",
]
