"""The message types of an installed ROS, found by import."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from rise_adapters.ros2.transport.interfaces.definitions import read_built_hashes
from rise_adapters.ros2.transport.port import PortError
from rise_adapters.ros2.transport.rclpy.conversion import (
    FieldConverter,
    MessageConverter,
    list_converter,
    number_converter,
    text_converter,
)

_NAME = re.compile(
    r"(?P<package>[a-z][a-z0-9_]*)/(?P<kind>msg|srv|action)/(?P<base>[A-Za-z][A-Za-z0-9]*)(_(?P<part>\w+))?"
)
_PARTS = {
    ("srv", "Request"): "Request",
    ("srv", "Response"): "Response",
    ("action", "Goal"): "Goal",
    ("action", "Result"): "Result",
    ("action", "Feedback"): "Feedback",
    ("action", "FeedbackMessage"): "Impl.FeedbackMessage",
    ("action", "SendGoal"): "Impl.SendGoalService",
    ("action", "SendGoal_Request"): "Impl.SendGoalService.Request",
    ("action", "SendGoal_Response"): "Impl.SendGoalService.Response",
    ("action", "GetResult"): "Impl.GetResultService",
    ("action", "GetResult_Request"): "Impl.GetResultService.Request",
    ("action", "GetResult_Response"): "Impl.GetResultService.Response",
}
"""The attribute of an implied class of a service or an action, in its own class."""


class InstalledTypes:
    """The types that can be imported. Every method raises PortError that names the missing type and its source."""

    def __init__(self) -> None:
        self._converters: dict[str, MessageConverter] = {}
        self._hashes: dict[str, dict[str, str]] = {}

    def find_message(self, type: str) -> tuple[Any, MessageConverter]:
        """rclpy's class of a message type, and its converter."""
        found = self._import_class(type)
        if not hasattr(found, "SLOT_TYPES"):
            raise PortError(f"{type} is not a message")
        return found, self._converter_of(type, found)

    def find_service(self, type: str) -> tuple[Any, MessageConverter, MessageConverter]:
        """rclpy's class of a service type, and the converters of its request and response."""
        found = self._import_class(type)
        if not hasattr(found, "Request") or not hasattr(found, "Response"):
            raise PortError(f"{type} is not a service")
        return (
            found,
            self._converter_of(f"{type}_Request", found.Request),
            self._converter_of(f"{type}_Response", found.Response),
        )

    def fields(self, type: str) -> dict[str, str]:
        """As `port.Transport.fields`."""
        return dict(self.find_message(type)[1].fields)

    def find_hash(self, type: str) -> str:
        """`RIHS01_...` as rosidl wrote it beside the definition; empty: not available."""
        match = _NAME.fullmatch(type)
        if match is None:
            return ""
        whole = f"{match['package']}/{match['kind']}/{match['base']}"
        if whole not in self._hashes:
            self._hashes[whole] = _read_hashes(match["package"], f"{match['kind']}/{match['base']}.json")
        return self._hashes[whole].get(type, "")

    def _import_class(self, type: str) -> Any:
        match = _NAME.fullmatch(type)
        if match is None:
            raise PortError(f"{type!r} is not the name of a type; one is written like std_msgs/msg/String")
        package, kind, base, part = match["package"], match["kind"], match["base"], match["part"]
        try:
            module = import_module(f"{package}.{kind}")
            if module.__spec__ is not None and module.__spec__.origin is None:  # a checkout's folder of definitions
                raise ImportError(name=package)
            found = getattr(module, base, None)
        except ImportError as error:
            raise PortError(_describe_missing(type, package, kind, error)) from None
        path = _PARTS.get((kind, part), "?") if part else ""
        for name in path.split(".") if path else ():
            found = getattr(found, name, None)
        if found is None:
            raise PortError(f"The ROS package {package} that is installed here has no {type}.")
        return found

    def _converter_of(self, type: str, found: Any) -> MessageConverter:
        if type not in self._converters:
            names = list(found.get_fields_and_field_types())
            converters = {name: self._field_converter(slot) for name, slot in zip(names, found.SLOT_TYPES, strict=True)}
            defaults = [name for name in names if hasattr(found, f"{name.upper()}__DEFAULT")]
            self._converters[type] = MessageConverter(type, found, converters, defaults)
        return self._converters[type]

    def _field_converter(self, slot: Any) -> FieldConverter:
        """The converter for a field, from the syntax tree of the definition, which rosidl keeps with each class."""
        kind = type(slot).__name__
        if kind == "BasicType":
            return number_converter(slot.typename)
        if kind in ("UnboundedString", "UnboundedWString"):
            return text_converter("string" if kind == "UnboundedString" else "wstring", None)
        if kind in ("BoundedString", "BoundedWString"):
            return text_converter("string" if kind == "BoundedString" else "wstring", slot.maximum_size)
        if kind == "NamespacedType":
            return self._nested_converter("/".join((*slot.namespaces, slot.name)))
        if kind == "Array":
            return list_converter(self._field_converter(slot.value_type), f"[{slot.size}]", fixed=slot.size)
        if kind == "BoundedSequence":
            return list_converter(
                self._field_converter(slot.value_type), f"[<={slot.maximum_size}]", most=slot.maximum_size
            )
        if kind == "UnboundedSequence":
            return list_converter(self._field_converter(slot.value_type), "[]")
        raise PortError(f"a field of the type {slot} cannot be used here")

    def _nested_converter(self, type: str) -> FieldConverter:
        _, converter = self.find_message(type)
        return FieldConverter(
            type, converter.write, lambda: converter.write({}), converter.read, converter.has_defaults
        )


# --- missing types ----------------------------------------------------------------------------------------------------


def _describe_missing(type: str, package: str, kind: str, error: ImportError) -> str:
    name = getattr(error, "name", None)
    if name == f"{package}.{kind}":
        return f"The ROS package {package} that is installed here has no {type}."
    if name != package:
        return f"The ROS package {package} is here, but it cannot be used ({error}); build it again for this Python."
    return (
        f"{type} cannot be used: the ROS package {package} is not installed, or not sourced. Install it with "
        f"`sudo apt install ros-jazzy-{package.replace('_', '-')}` where it is released; otherwise build it with "
        "colcon and source its install/setup.bash before this program is started."
    )


def _read_hashes(package: str, file: str) -> dict[str, str]:
    try:
        share = import_module("ament_index_python.packages").get_package_share_directory(package)
    except (ImportError, LookupError):
        return {}
    return read_built_hashes(Path(share, file))
