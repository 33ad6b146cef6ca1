"""Reading and checking what carries one action to the robot: the table `carrier` of a profile's action."""

from __future__ import annotations

import re
from typing import Any, Literal, TypeAlias

from msgspec.structs import replace

from rise_adapters.ros2.mapping.action_mapping import ActionMapping, RosOptions
from rise_adapters.ros2.mapping.compiler import MessageCompiler, ProfileMistakes
from rise_adapters.ros2.mapping.field_sources import MessageSource
from rise_adapters.ros2.mapping.field_types import FieldTypes
from rise_adapters.ros2.mapping.options import parse_deadlines
from rise_adapters.ros2.mapping.quality import parse_qos
from rise_adapters.ros2.mapping.result_rule import parse_result_rule
from rise_adapters.ros2.transport.names import is_ros_name
from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.model import ActionSpec
from rise_engine.scenario.parameters import accepts_any_name, listed_names

MappingKind: TypeAlias = Literal["action", "topic"]

_KEYS: dict[MappingKind, tuple[str, ...]] = {
    "action": ("action", "type", "goal", "values", "error", "deadlines", "qos"),
    "topic": ("topic", "type", "message", "reset", "values", "deadlines", "qos"),
}
_EXAMPLES: dict[MappingKind, str] = {"action": "pepper/speech", "topic": "pepper/tablet"}
_TYPE = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/(?:(?P<kind>[a-z]+)/)?(?P<name>[A-Z][A-Za-z0-9]*)\Z", re.ASCII)


class ActionReader:
    """Reads the carrier of one action. What is wrong goes into its mistakes, all of it."""

    def __init__(self, spec: ActionSpec, options: RosOptions, types: FieldTypes, mistakes: ProfileMistakes) -> None:
        self._spec = spec
        self._table = spec.carrier
        self._options = options
        self._types = types
        self._mistakes = mistakes

    def read(self) -> ActionMapping | None:
        """None when it cannot even be told what carries the action."""
        kind = self._read_kind()
        if kind is None:
            return None
        self._mistakes.add_unknown_keys(f"actions.{self._spec.name}.carrier", self._table, _KEYS[kind])
        name, type = self._read_name(kind), self._read_known_type(kind)
        deadlines = parse_deadlines(
            self._read_table("deadlines"), self._options.deadlines, self._path_of("deadlines"), self._mistakes
        )
        compiler = MessageCompiler(self._spec, self._read_values(), self._types, self._mistakes)
        if kind == "action":
            message = compiler.compile(self._read_table("goal"), type and f"{type}_Goal", self._path_of("goal"))
            used = compiler.used_parameters
            error = self._read_table("error")
            rule = parse_result_rule(error, type, self._path_of("error"), self._types, self._mistakes)
            mapping = ActionMapping(kind, name, type, deadlines, message, result_rule=rule)
        else:
            message = compiler.compile(self._read_table("message"), type, self._path_of("message"))
            used = compiler.used_parameters | {"duration", "repetitions"}  # kept here, with a field for them or not
            mapping = ActionMapping(kind, name, type, deadlines, message, self._read_reset(type))
        return replace(
            mapping,
            unused_parameters=tuple(each for each in self._spec.parameters if each not in used),
            **parse_qos(self._read_table("qos"), kind, self._path_of("qos"), self._mistakes),
        )

    def _read_kind(self) -> MappingKind | None:
        if not self._table:
            self._mistakes.sentences.append(
                f"`actions.{self._spec.name}` has no `carrier`, which says what carries it to the robot; "
                f"if the robot cannot do it, leave the action out"
            )
        elif "action" in self._table and "topic" in self._table:
            self._add_mistake("topic", "stands beside `action`; a carrier is one or the other")
        elif "action" in self._table:
            return "action"
        elif "topic" in self._table:
            return "topic"
        else:
            self._mistakes.add(
                f"actions.{self._spec.name}.carrier", "has neither `action` nor `topic`: the name on ROS"
            )
        return None

    def _read_name(self, kind: MappingKind) -> str:
        name = self._table[kind]
        if is_ros_name(name):
            return str(name)
        self._add_mistake(
            kind, f"is a ROS name such as `{_EXAMPLES[kind]}`: letters, digits and `_`, parts divided by `/`"
        )
        return "unknown"

    def _read_known_type(self, kind: MappingKind) -> str:
        """The type on ROS; empty when it is none, or cannot be had here."""
        type = self._read_type(kind)
        parts = [f"{type}_Goal", f"{type}_Result", f"{type}_Feedback"] if kind == "action" else [type]
        if type and (missing := next(filter(None, map(self._types.why_unknown, parts)), "")):
            self._add_mistake("type", f"cannot be used here: {missing}")
            return ""
        return type

    def _read_type(self, kind: MappingKind) -> str:
        wanted = "action" if kind == "action" else "msg"
        type = self._table.get("type")
        found = _TYPE.match(type) if isinstance(type, str) else None
        if found is not None and found["kind"] == wanted:
            assert isinstance(type, str)
            return type
        example = "rise_interfaces/action/Speech" if wanted == "action" else "std_msgs/msg/String"
        what = f"is the type of the {kind} on ROS, such as `{example}`"
        if "type" not in self._table:
            self._mistakes.add(f"actions.{self._spec.name}.carrier", f"has no `type`; it {what}")
        elif found is not None:
            self._add_mistake("type", f"{what}; did you mean `{found['package']}/{wanted}/{found['name']}`?")
        else:
            self._add_mistake("type", what)
        return ""

    def _read_values(self) -> dict[str, dict[str, Any]]:
        result: dict[str, dict[str, Any]] = {}
        for name, table in self._read_table("values").items():
            parameter = self._spec.parameters.get(name)
            if parameter is None:
                known = did_you_mean(name, self._spec.parameters)
                self._add_mistake(f"values.{name}", f"is no parameter of {self._spec.name}{known}")
            elif not isinstance(table, dict) or not all(isinstance(each, str | int | float) for each in table.values()):
                self._add_mistake(f"values.{name}", 'translates values: { fear = "scared" }')
            else:
                known_here = listed_names(parameter)
                for key in table:
                    if parameter.type == "name" and not accepts_any_name(parameter) and key not in known_here:
                        self._add_mistake(
                            f"values.{name}.{key}", f"is no name of `{name}`{did_you_mean(key, known_here)}"
                        )
                result[name] = table
        return result

    def _read_reset(self, type: str) -> MessageSource | None:
        if "reset" not in self._table:
            return None
        # When it is sent nobody knows the parameters any more: an action without any.
        nobody = replace(self._spec, parameters={})
        compiler = MessageCompiler(nobody, {}, self._types, self._mistakes)
        return compiler.compile(self._read_table("reset"), type, self._path_of("reset"))

    def _read_table(self, key: str) -> dict[str, Any]:
        """One of the carrier's tables; empty when it is not there."""
        table = self._table.get(key, {})
        if isinstance(table, dict):
            return table
        self._add_mistake(key, "is a table")
        return {}

    def _path_of(self, key: str) -> str:
        return f"actions.{self._spec.name}.carrier.{key}"

    def _add_mistake(self, key: str, sentence: str) -> None:
        self._mistakes.add(self._path_of(key), sentence)
