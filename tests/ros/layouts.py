"""Fields of message types, as a transport gives them (`RosTransport.fields`), for tests without one."""

from __future__ import annotations

from collections.abc import Mapping

from rise_adapters.ros2.transport.port import PortError

_DURATION = "builtin_interfaces/msg/Duration"
_POINT = "geometry_msgs/msg/PointStamped"
_META, _RESULT = "std_skills/msg/Meta", "std_skills/msg/Result"

RISE = {
    "Speech": {"message": "string", "language": "string", "voice": "string", "rate": "float32", "volume": "float32"},
    "LookAt": {"target": _POINT, "roll": "float32", "duration": _DURATION},
    "Emotion": {"value": "uint8", "duration": _DURATION},
    "Animation": {"name": "string", "repetitions": "uint32", "duration": _DURATION, "scale": "float32"},
    "SocialExpression": {"name": "string", "duration": _DURATION},
    "PointAt": {"target": _POINT, "hand": "string", "duration": _DURATION},
}
"""The goals of rise_interfaces."""

LAYOUTS: dict[str, dict[str, str]] = {
    **{f"rise_interfaces/action/{name}_Goal": goal for name, goal in RISE.items()},
    **{f"rise_interfaces/action/{name}_Result": {"reason": "string"} for name in RISE},
    **{f"rise_interfaces/action/{name}_Feedback": {"progress": "float32"} for name in RISE},
    "std_skills/msg/Feedback": {
        "data_bool": "bool",
        "data_int": "uint16",
        "data_float": "float32",
        "data_str": "string",
    },
    "std_msgs/msg/String": {"data": "string"},
    "std_msgs/msg/Header": {"stamp": "builtin_interfaces/msg/Time", "frame_id": "string"},
    "builtin_interfaces/msg/Time": {"sec": "int32", "nanosec": "uint32"},
    _DURATION: {"sec": "int32", "nanosec": "uint32"},
    "geometry_msgs/msg/Point": {"x": "float64", "y": "float64", "z": "float64"},
    _POINT: {"header": "std_msgs/msg/Header", "point": "geometry_msgs/msg/Point"},
    _META: {"caller": "string", "priority": "uint8"},
    _RESULT: {"error_code": "uint8", "error_msg": "string"},
    "communication_skills/action/Say_Goal": {
        "meta": _META,
        "person_id": "string",
        "group_id": "string",
        "input": "string",
    },
    "communication_skills/action/Say_Result": {"result": _RESULT},
    "communication_skills/action/Say_Feedback": {"feedback": "std_skills/msg/Feedback"},
    "interaction_skills/action/LookAt_Goal": {"meta": _META, "policy": "string", "target": _POINT},
    "interaction_skills/action/LookAt_Result": {"result": _RESULT},
    "interaction_skills/action/LookAt_Feedback": {"feedback": "std_skills/msg/Feedback"},
    "interaction_skills/msg/SetExpression": {"meta": _META, "expression": "hri_msgs/msg/Expression"},
    "hri_msgs/msg/Expression": {
        "header": "std_msgs/msg/Header",
        "expression": "string",
        "valence": "float32",
        "arousal": "float32",
        "confidence": "float32",
    },
    "motions_skills/action/ReplayMotion_Goal": {"meta": _META, "name": "string", "unsafe": "bool"},
    "motions_skills/action/ReplayMotion_Result": {"result": _RESULT},
    "motions_skills/action/ReplayMotion_Feedback": {"feedback": "std_skills/msg/Feedback"},
}


def fields(type: str) -> Mapping[str, str]:
    """As `RosTransport.fields`."""
    return looked_up(LAYOUTS, type)


def looked_up(layouts: Mapping[str, Mapping[str, str]], type: str) -> Mapping[str, str]:
    if type not in layouts:
        raise PortError(f"the type {type} is not known")
    return layouts[type]
