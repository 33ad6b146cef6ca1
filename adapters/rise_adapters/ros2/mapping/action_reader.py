"""Reads and checks the table `carrier` of a profile's action."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf, isfinite
from typing import Any

from msgspec.structs import replace

from rise_adapters.ros2.mapping.action_mapping import ActionMapping, MappingKind, ResultRule, RosOptions
from rise_adapters.ros2.mapping.compiler import MessageCompiler, ProfileMistakes
from rise_adapters.ros2.mapping.field_sources import MessageSource
from rise_adapters.ros2.mapping.field_types import FieldTypes, MessageFieldType
from rise_adapters.ros2.mapping.options import parse_deadlines
from rise_adapters.ros2.transport.names import is_ros_name
from rise_adapters.ros2.transport.port import FEEDBACK, RELIABLE, STATUS, STATUS_TOPIC, PortError, QoS
from rise_engine.base.nearest_name import did_you_mean, nearest_name
from rise_engine.scenario.model import ActionSpec
from rise_engine.scenario.parameters import accepts_any_name, listed_names

# --- quality of service -----------------------------------------------------------------------------------------------

_QUALITY_KEYS = ("reliability", "durability", "depth")
_RELIABILITY = {"reliable": True, "best_effort": False}
_DURABILITY = {"volatile": False, "transient_local": True}
_MAX_HISTORY = 10_000
"""Maximum number of messages kept for one topic."""


def parse_qos(table: Mapping[str, Any], kind: str, where: str, mistakes: ProfileMistakes) -> dict[str, QoS]:
    """Read the quality of service of a topic or an action (`kind`), by field of `ActionMapping`. Errors go to
    `mistakes`."""
    if kind == "topic":
        return {"topic_qos": _parse_quality(table, RELIABLE, where, mistakes)}
    usual = {FEEDBACK: RELIABLE, STATUS_TOPIC: STATUS}
    for key in table:
        if key in _QUALITY_KEYS:
            mistakes.add(f"{where}.{key}", f"belongs in `qos.{FEEDBACK}` or `qos.{STATUS_TOPIC}`: goals have no other")
        elif key not in usual:
            mistakes.add(f"{where}.{key}", f"does not exist{did_you_mean(key, usual)}")
    return {
        f"{key}_qos": _parse_quality(table.get(key, {}), before, f"{where}.{key}", mistakes)
        for key, before in usual.items()
    }


def _parse_quality(table: Any, before: QoS, where: str, mistakes: ProfileMistakes) -> QoS:
    if not isinstance(table, dict):
        mistakes.add(where, 'is a table: { reliability = "best_effort" }')
        return before
    mistakes.add_unknown_keys(where, table, _QUALITY_KEYS)
    depth = table.get("depth", before.depth)
    if isinstance(depth, bool) or not isinstance(depth, int) or not 1 <= depth <= _MAX_HISTORY:
        mistakes.add(f"{where}.depth", f"is a whole number of messages from 1 to {_MAX_HISTORY}")
        depth = before.depth
    reliable = _parse_choice(table.get("reliability"), _RELIABILITY, before.reliable, f"{where}.reliability", mistakes)
    latched = _parse_choice(table.get("durability"), _DURABILITY, before.latched, f"{where}.durability", mistakes)
    return QoS(depth, reliable, latched)


def _parse_choice(word: Any, words: Mapping[str, bool], before: bool, where: str, mistakes: ProfileMistakes) -> bool:
    if word is None:
        return before
    if isinstance(word, str) and word in words:
        return words[word]
    near = nearest_name(word, words) if isinstance(word, str) else None
    meant = f"; did you mean `{near}`?" if near is not None else ""
    mistakes.add(where, f"is {' or '.join(f'`{each}`' for each in words)}{meant}")
    return before


# --- the meaning of a result ------------------------------------------------------------------------------------------

_RESULT_KEYS = ("code", "ok", "minimum", "maximum", "text", "codes")
_LIMITS = ("minimum", "maximum")
_KINDS: dict[str, type | tuple[type, ...]] = {"integer": int, "boolean": bool, "text": str}
"""The types of `ok` for each kind of `code`."""


def parse_result_rule(
    table: Mapping[str, Any], type: str, where: str, types: FieldTypes, mistakes: ProfileMistakes
) -> ResultRule:
    """Read the rule for results. `type`: of the result or response; empty: unknown. Wrong entries go to `mistakes`."""
    mistakes.add_unknown_keys(where, table, _RESULT_KEYS)
    code, code_type = _read_field_path(table, "code", type, where, types, mistakes)
    text, text_type = _read_field_path(table, "text", type, where, types, mistakes)
    if text_type is not None and (text_type.kind != "text" or text_type.is_list):
        mistakes.add(f"{where}.text", f"is the field with the robot's words, and this one is `{text_type}`")
    minimum, maximum = _read_limits(table, where, mistakes)
    has_limits = any(key in table for key in _LIMITS)
    if has_limits and "ok" in table:
        mistakes.add(
            f"{where}.ok",
            "cannot be used with a `minimum` or `maximum`; a rule has values that mean success, or limits",
        )
    if code_type is not None and (code_type.is_list or code_type.kind == "message"):
        mistakes.add(f"{where}.code", f"is a number, a text, or true or false, and this field is `{code_type}`")
        code_type = None
    ok = () if has_limits else _read_ok(table, code_type, where, mistakes)
    if has_limits and code_type is not None and code_type.kind not in ("integer", "float"):
        mistakes.add(f"{where}.code", f"is a number where it has limits, and this field is `{code_type}`")
    codes = table.get("codes", {})
    if not isinstance(codes, dict) or not all(isinstance(each, str) for each in codes.values()):
        mistakes.add(f"{where}.codes", 'says what numbers mean: { 134 = "the robot cannot do this" }')
        codes = {}
    for key in ("ok", "codes", *_LIMITS):
        if key in table and "code" not in table:
            mistakes.add(f"{where}.{key}", "needs `code`: the field of the result that it is about")
    return ResultRule(code, ok, minimum, maximum, text, codes)


def _read_limits(table: Mapping[str, Any], where: str, mistakes: ProfileMistakes) -> tuple[float, float]:
    limits = {"minimum": -inf, "maximum": inf}
    for key in _LIMITS:
        value = table.get(key, limits[key])
        if isinstance(value, bool) or not isinstance(value, int | float) or (key in table and not isfinite(value)):
            mistakes.add(f"{where}.{key}", "is a number")
        else:
            limits[key] = value
    if limits["minimum"] > limits["maximum"]:
        mistakes.add(f"{where}.minimum", "is above `maximum`, so nothing would be a success")
    return limits["minimum"], limits["maximum"]


def _read_ok(
    table: Mapping[str, Any], type: MessageFieldType | None, where: str, mistakes: ProfileMistakes
) -> tuple[int | bool | str, ...]:
    """The values of `code` that mean success."""
    written = table.get("ok", 0)
    values = tuple(written) if isinstance(written, list) else (written,)
    kind = type.kind if type is not None else ""
    if kind == "float":
        mistakes.add(where, "has a `code` with decimals; say from where it is a success: `minimum = 0.5`, or `maximum`")
    elif kind in ("boolean", "text") and "ok" not in table:
        which = "is true or false; say which one is success: `ok = true`"
        mistakes.add(where, f"has a `code` that {which if kind == 'boolean' else 'is a text; say which: `ok = [...]`'}")
    elif not values or not all(_is_ok(value, kind) for value in values):
        what = {"integer": "whole numbers", "boolean": "true or false", "text": "texts"}.get(
            kind, "whole numbers, texts, true or false"
        )
        mistakes.add(f"{where}.ok", f"has the values of `code` that mean success: {what}")
    else:
        return values
    return (0,)


def _is_ok(value: Any, kind: str) -> bool:
    if kind == "integer" and isinstance(value, bool):
        return False
    return isinstance(value, _KINDS.get(kind, (int, str)))


def _read_field_path(
    table: Mapping[str, Any], key: str, type: str, where: str, types: FieldTypes, mistakes: ProfileMistakes
) -> tuple[tuple[str, ...], MessageFieldType | None]:
    """The path of a result's field, and its type if known."""
    path = table.get(key)
    if path is None:
        return (), None
    if not isinstance(path, str) or not all(path.split(".")):
        mistakes.add(f"{where}.{key}", "is a field of the result, such as `result.error_code`")
        return (), None
    names = tuple(path.split("."))
    if not type:
        return names, None
    try:
        return names, types.find(type, names)
    except (ValueError, PortError) as error:
        mistakes.add(f"{where}.{key}", str(error), "missing" if isinstance(error, PortError) else "wrong")
        return names, None


_KEYS: dict[MappingKind, tuple[str, ...]] = {
    "action": ("action", "type", "goal", "values", "error", "deadlines", "qos"),
    "topic": ("topic", "type", "message", "reset", "rate", "unstoppable", "values", "deadlines", "qos"),
    "service": ("service", "type", "request", "values", "error", "deadlines", "unstoppable"),
}
_EXAMPLES: dict[MappingKind, str] = {"action": "pepper/speech", "topic": "pepper/tablet", "service": "pepper/say"}
_TYPES: dict[MappingKind, tuple[str, str]] = {
    "action": ("action", "rise_interfaces/action/Speech"),
    "topic": ("msg", "std_msgs/msg/String"),
    "service": ("srv", "std_srvs/srv/Trigger"),
}
"""The middle part of a ROS type, and an example."""
_ACTION_DEADLINES = ("acceptance", "feedback", "cancel")
"""Deadlines of phases that a service does not have."""
MAX_RATE = 100.0
"""Maximum messages a second."""
_TYPE = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/(?:(?P<kind>[a-z]+)/)?(?P<name>[A-Z][A-Za-z0-9]*)\Z", re.ASCII)


class ActionReader:
    """Reads the carrier of one action, and collects all errors."""

    def __init__(
        self,
        spec: ActionSpec,
        options: RosOptions,
        types: FieldTypes,
        mistakes: ProfileMistakes,
        places: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self._spec = spec
        self._places = places
        self._table = spec.carrier
        self._options = options
        self._types = types
        self._mistakes = mistakes

    def read(self) -> ActionMapping | None:
        """Read the mapping; None: not even its kind is clear."""
        kind = self._read_kind()
        if kind is None:
            return None
        self._mistakes.add_unknown_keys(f"actions.{self._spec.name}.carrier", self._table, _KEYS[kind])
        name, type = self._read_name(kind), self._read_known_type(kind)
        deadlines = parse_deadlines(
            self._read_table("deadlines"), self._options.deadlines, self._path_of("deadlines"), self._mistakes
        )
        compiler = MessageCompiler(self._spec, self._read_values(), self._types, self._mistakes, self._places)
        part, sent, answered = {
            "action": ("goal", "_Goal", "_Result"),
            "topic": ("message", "", ""),
            "service": ("request", "_Request", "_Response"),
        }[kind]
        message = compiler.compile(self._read_table(part), type and f"{type}{sent}", self._path_of(part))
        used = compiler.used_parameters
        mapping = ActionMapping(kind, name, type, deadlines, message)
        if kind == "topic":
            used = used | {"duration", "repetitions"}  # handled here, with or without a field
            mapping = replace(mapping, reset=self._read_reset(type), rate=self._read_rate())
        else:
            of, where = type and f"{type}{answered}", self._path_of("error")
            rule = parse_result_rule(self._read_table("error"), of, where, self._types, self._mistakes)
            mapping = replace(mapping, result_rule=rule)
        if kind == "service":
            for key in self._read_table("deadlines"):
                if key in _ACTION_DEADLINES:
                    self._add_mistake(f"deadlines.{key}", "is of actions; a service has `server` and `result`")
        else:
            qos = parse_qos(self._read_table("qos"), kind, self._path_of("qos"), self._mistakes)
            mapping = replace(mapping, **qos)
            if mapping.rate and mapping.topic_qos.latched:
                self._add_mistake(
                    "rate", "cannot be used with `transient_local`: a base that comes up would begin midway"
                )
        unused = tuple(each for each in self._spec.parameters if each not in used)
        return replace(mapping, unused_parameters=unused, harmless=self._is_harmless(mapping))

    def _is_harmless(self, mapping: ActionMapping) -> bool:
        """Whether the profile declares an unstoppable action as safe. Without a declaration, that is an error."""
        if mapping.kind == "action":
            return False
        known = self._table.get("unstoppable", False)
        if not isinstance(known, bool):
            self._add_mistake("unstoppable", "is true or false")
        elif known and mapping.stoppable:
            self._add_mistake("unstoppable", "cannot be used with `reset`, which stops it")
        elif not known and not mapping.stoppable:
            acknowledge = "`unstoppable = true` where that is no danger"
            if mapping.kind == "topic":
                how = f"nothing is published on {mapping.name} to stop it; write `reset = {{ ... }}`, or {acknowledge}"
            else:
                how = f"a call of {mapping.name} cannot be taken back; use an action of the robot, or {acknowledge}"
            self._mistakes.add(
                self._path_of(mapping.kind),
                f"cannot be stopped: after F9 the robot goes on, because {how}",
                "unstoppable",
            )
        return known is True

    def _read_rate(self) -> float:
        rate = self._table.get("rate")
        if rate is None:
            return 0.0
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0 < rate <= MAX_RATE:
            self._add_mistake("rate", f"is how often in a second it is published: above 0, up to {MAX_RATE:g}")
            return 0.0
        return float(rate)

    def _read_kind(self) -> MappingKind | None:
        there = [kind for kind in _KEYS if kind in self._table]
        if not self._table:
            self._mistakes.add(
                f"actions.{self._spec.name}",
                "has no `carrier`, which says what carries it to the robot; "
                "if the robot cannot do it, leave the action out",
                "missing",
            )
        elif not there:
            where = f"actions.{self._spec.name}.carrier"
            self._mistakes.add(where, "has neither `action`, `topic` nor `service`: the name on ROS")
        elif len(there) > 1:
            self._add_mistake(there[1], f"cannot be used with `{there[0]}`; a carrier is one or the other")
        else:
            return there[0]
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
        """The type on ROS; empty: it is no type, or not available here."""
        type = self._read_type(kind)
        endings = {"action": ("_Goal", "_Result", "_Feedback"), "topic": ("",), "service": ("_Request", "_Response")}
        parts = [f"{type}{ending}" for ending in endings[kind]]
        if type and (missing := next(filter(None, map(self._types.why_unknown, parts)), "")):
            self._mistakes.add(self._path_of("type"), f"cannot be used here: {missing}", "missing")
            return ""
        return type

    def _read_type(self, kind: MappingKind) -> str:
        wanted, example = _TYPES[kind]
        type = self._table.get("type")
        found = _TYPE.match(type) if isinstance(type, str) else None
        if found is not None and found["kind"] == wanted:
            assert isinstance(type, str)
            return type
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
                self._add_mistake(f"values.{name}", f"is not a parameter of {self._spec.name}{known}")
            elif not isinstance(table, dict) or not all(isinstance(each, str | int | float) for each in table.values()):
                self._add_mistake(f"values.{name}", 'translates values: { fear = "scared" }')
            else:
                known_here = listed_names(parameter)
                for key in table:
                    if parameter.type == "name" and not accepts_any_name(parameter) and key not in known_here:
                        self._add_mistake(
                            f"values.{name}.{key}", f"is not a name of `{name}`{did_you_mean(key, known_here)}"
                        )
                result[name] = table
        return result

    def _read_reset(self, type: str) -> MessageSource | None:
        if "reset" not in self._table:
            return None
        # It is sent when the parameters are no longer known, so it is compiled for an action without parameters.
        nobody = replace(self._spec, parameters={})
        compiler = MessageCompiler(nobody, {}, self._types, self._mistakes, {})
        if self._table["reset"] == self._table.get("message"):
            same = "equals `message`, so a stop would tell the robot to do it again"
            self._mistakes.add(self._path_of("reset"), same, "doubtful")
        return compiler.compile(self._read_table("reset"), type, self._path_of("reset"))

    def _read_table(self, key: str) -> dict[str, Any]:
        """Return one of the carrier's tables; empty: it is missing."""
        table = self._table.get(key, {})
        if isinstance(table, dict):
            return table
        self._add_mistake(key, "is a table")
        return {}

    def _path_of(self, key: str) -> str:
        return f"actions.{self._spec.name}.carrier.{key}"

    def _add_mistake(self, key: str, sentence: str) -> None:
        self._mistakes.add(self._path_of(key), sentence)
