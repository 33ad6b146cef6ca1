"""The options of a profile whose driver is `ros2`, and the deadlines, which each action can change."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_adapters.ros2.mapping.action_mapping import MAX_CANCEL_SECONDS, EstopMapping, GoalDeadlines, RosOptions
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.field_sources import fit_literal
from rise_adapters.ros2.mapping.field_types import FieldTypes
from rise_adapters.ros2.transport.names import is_ros_name
from rise_adapters.ros2.transport.port import PortError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.act_runner import CANCEL_LIMIT
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.model import RobotProfile

# --- the emergency stop -----------------------------------------------------------------------------------------------

WHERE = "options.estop"
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*", re.ASCII)
_TOPIC_KEYS = ("topic", "type", "when", "silent_after")


def parse_estop(table: Any, types: FieldTypes, mistakes: ProfileMistakes) -> EstopMapping | None:
    """Read the emergency stop of `options.estop`; None: not usable. Errors go to `mistakes`."""
    if not isinstance(table, dict) or ("topic" in table) == ("service" in table):
        mistakes.add(WHERE, 'is a table with a `topic` or a `service`: { topic = "/estop", type = ..., when = ... }')
        return None
    kind = "topic" if "topic" in table else "service"
    mistakes.add_unknown_keys(WHERE, table, _TOPIC_KEYS if kind == "topic" else ("service",))
    name = table[kind]
    if not is_ros_name(name):
        mistakes.add(f"{WHERE}.{kind}", "is a ROS name such as `/estop_pressed`")
        return None
    if kind == "service":
        return EstopMapping(name)
    type = table.get("type")
    if not isinstance(type, str) or not _TYPE.fullmatch(type):
        mistakes.add(f"{WHERE}.type", "is the type of its messages, such as `std_msgs/msg/Bool`")
        return None
    seconds = table.get("silent_after", 0)
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0 <= seconds <= MAX_SECONDS:
        mistakes.add(f"{WHERE}.silent_after", f"is a number of seconds, up to {MAX_SECONDS:.0f} (24 hours)")
        seconds = 0
    if "silent_after" not in table:
        why = "has no `silent_after`, so nobody notices when the program of the button hangs"
        mistakes.add(f"{WHERE}.{kind}", f"{why}; set it to two or three periods of the topic, or to 0", "doubtful")
    when = table.get("when")
    if not isinstance(when, dict) or not when:
        mistakes.add(f"{WHERE}.when", "says which values mean that it is pressed: { data = true }")
        return None
    fields = tuple((path, _read_values(path, value, type, types, mistakes)) for path, value in _flatten(when))
    return EstopMapping(name, type, fields, float(seconds))


def _flatten(table: Mapping[str, Any], before: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The values by the path of each field: `{ a.b = 1 }` and `{ "a.b" = 1 }` are equal."""
    for key, value in table.items():
        path = (*before, *key.split("."))
        if isinstance(value, dict):
            yield from _flatten(value, path)
        else:
            yield path, value


def _read_values(
    path: tuple[str, ...], written: Any, type: str, types: FieldTypes, mistakes: ProfileMistakes
) -> tuple[Any, ...]:
    """Read one value or a list of values for the field."""
    values = tuple(written) if isinstance(written, list) else (written,)
    try:
        field = types.find(type, path)
        if not values or not all(isinstance(value, bool | int | float | str) for value in values):
            raise ValueError("is a value, or a list of values: [3, 6, 7]")
        if field is not None and field.is_list:
            raise ValueError(f"is a list ({field}), and lists are not compared")
        return tuple(fit_literal(value, field) for value in values)
    except (ValueError, PortError) as error:
        is_missing = isinstance(error, PortError)
        mistakes.add(f"{WHERE}.when.{'.'.join(path)}", str(error), "missing" if is_missing else "wrong")
        return ()


DRIVER = "ros2"
MIN_FEEDBACK_SECONDS = 0.5


def parse_options(
    profile: RobotProfile,
    mistakes: ProfileMistakes,
    types: FieldTypes = FieldTypes(None),  # noqa: B008
) -> RosOptions:
    """Read the profile's `[options]`. Errors go to `mistakes` and are omitted."""
    known = RosOptions.__struct_fields__
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
    unattended = profile.options.get("unattended", "wait")
    if unattended not in ("wait", "go on"):
        mistakes.add("options.unattended", "is `wait` or `go on`")
        unattended = "wait"
    written = profile.options.get("estop")
    estop = None if written is None else parse_estop(written, types, mistakes)
    return RosOptions(frame, deadlines, error, wrapper, leftovers, unattended, tuple(folders), estop)


def parse_deadlines(table: Any, before: GoalDeadlines, where: str, mistakes: ProfileMistakes) -> GoalDeadlines:
    """Read deadlines from a table of seconds. Deadlines that are not in the table stay as `before`."""
    if not isinstance(table, dict):
        mistakes.add(where, "is a table of seconds: { acceptance = 2 }")
        return before
    known = GoalDeadlines.__struct_fields__
    found: dict[str, float] = {}
    for key, value in table.items():
        may_be_zero = key in ("feedback", "result")
        if key not in known:
            mistakes.add(f"{where}.{key}", f"does not exist{did_you_mean(key, known)}")
        elif isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= MAX_SECONDS:
            mistakes.add(f"{where}.{key}", f"is a number of seconds, up to {MAX_SECONDS:.0f} (24 hours)")
        elif not value and not may_be_zero:
            mistakes.add(f"{where}.{key}", "is a number of seconds above 0")
        elif key == "cancel" and value > MAX_CANCEL_SECONDS:
            what = f"must be at most {MAX_CANCEL_SECONDS:g}: an act waits {CANCEL_LIMIT:g} s for its actions to stop"
            mistakes.add(f"{where}.{key}", what)
        elif key == "feedback" and 0 < value < MIN_FEEDBACK_SECONDS:
            what = f"must be 0, or at least {MIN_FEEDBACK_SECONDS:g}: it is read ten times a second"
            mistakes.add(f"{where}.{key}", what)
        else:
            found[key] = float(value)
    return replace(before, **found)
