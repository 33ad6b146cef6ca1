"""The options of a profile whose driver is `ros2`, and the deadlines, which each action may change."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from msgspec.structs import fields as struct_fields
from msgspec.structs import replace

from rise_adapters.ros2.mapping.action_mapping import GoalDeadlines, RosOptions
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.estop import parse_estop
from rise_adapters.ros2.mapping.field_types import FieldTypes
from rise_adapters.ros2.transport.names import is_ros_name
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.model import RobotProfile

DRIVER = "ros2"
LEAST_FEEDBACK_SECONDS = 0.5


def parse_options(
    profile: RobotProfile,
    mistakes: ProfileMistakes,
    types: FieldTypes = FieldTypes(None),  # noqa: B008
) -> RosOptions:
    """The profile's `[options]`; what is wrong goes into `mistakes`, and is left out."""
    known = [field.name for field in struct_fields(RosOptions)]
    for key in profile.options:
        if key not in known:
            mistakes.add(f"options.{key}", f"does not exist for the driver `{DRIVER}`{did_you_mean(key, known)}")
    frame = profile.options.get("frame", RosOptions().frame)
    if not isinstance(frame, str) or not frame.strip():
        mistakes.add("options.frame", "is the name of a coordinate frame, a text")
        frame = RosOptions().frame
    deadlines = parse_deadlines(profile.options.get("deadlines", {}), GoalDeadlines(), "options.deadlines", mistakes)
    share = profile.options.get("share", [])
    if not isinstance(share, list) or not all(isinstance(each, str) and each for each in share):
        mistakes.add("options.share", 'is a list of folders: ["/opt/robot/share"]')
        share = []
    folders = [os.path.expandvars(os.path.expanduser(each)) for each in share]  # noqa: PTH111  # no Path needed
    for each in folders:
        if not Path(each).is_absolute():
            mistakes.add("options.share", f"has `{each}`; give the whole path, from `/` or `~`")
    error = profile.options.get("error", {})
    if not isinstance(error, dict):
        mistakes.add("options.error", 'is a table: { code = "result.error_code" }')
        error = {}
    wrapper = profile.options.get("wrapper", "")
    if wrapper and not is_ros_name(wrapper):
        mistakes.add("options.wrapper", "is a ROS name such as `pepper`: letters, digits and `_`, parts divided by `/`")
        wrapper = ""
    leftovers = profile.options.get("leftovers", "cancel")
    if leftovers not in ("cancel", "keep"):
        mistakes.add("options.leftovers", "is `cancel` or `keep`")
        leftovers = "cancel"
    written = profile.options.get("estop")
    estop = None if written is None else parse_estop(written, types, mistakes)
    return RosOptions(frame, deadlines, error, wrapper, leftovers, tuple(folders), estop)


def parse_deadlines(table: Any, before: GoalDeadlines, where: str, mistakes: ProfileMistakes) -> GoalDeadlines:
    """A table of seconds; what it does not name stays as it was `before`."""
    if not isinstance(table, dict):
        mistakes.add(where, "is a table of seconds: { acceptance = 2 }")
        return before
    known = [field.name for field in struct_fields(GoalDeadlines)]
    found: dict[str, float] = {}
    for key, value in table.items():
        may_be_zero = key in ("feedback", "result")
        if key not in known:
            mistakes.add(f"{where}.{key}", f"does not exist{did_you_mean(key, known)}")
        elif isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= MAX_SECONDS:
            mistakes.add(f"{where}.{key}", f"is a number of seconds, up to {MAX_SECONDS:.0f} (24 hours)")
        elif not value and not may_be_zero:
            mistakes.add(f"{where}.{key}", "is a number of seconds above 0")
        elif key == "feedback" and 0 < value < LEAST_FEEDBACK_SECONDS:
            what = f"must be 0, or at least {LEAST_FEEDBACK_SECONDS:g}: it is read ten times a second"
            mistakes.add(f"{where}.{key}", what)
        else:
            found[key] = float(value)
    return replace(before, **found)
