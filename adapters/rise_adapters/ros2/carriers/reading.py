"""Reading and checking the carriers of a profile."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from msgspec.structs import fields as struct_fields
from msgspec.structs import replace

from rise_adapters.ros2.carriers.carrier import Carrier, CarrierErrors, Deadlines, Options, Verdict
from rise_adapters.ros2.carriers.compile import Compiler, Notes
from rise_adapters.ros2.carriers.fields import Fields, FieldType, Types
from rise_adapters.ros2.carriers.fill import Group
from rise_adapters.ros2.port import FEEDBACK, RELIABLE, STATUS, STATUS_TOPIC, QoS
from rise_engine.nearest_name import nearest, suggestion
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.model import ActionSpec, RobotProfile
from rise_engine.scenario.parameters import accepts_any_name, known_names

DRIVER = "ros2"

_KEYS = {
    "action": ("action", "type", "goal", "values", "error", "deadlines", "qos"),
    "topic": ("topic", "type", "message", "reset", "values", "deadlines", "qos"),
}
_NAME = re.compile(r"(?:~/|/)?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*\Z", re.ASCII)
_TYPE = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/(?:(?P<kind>[a-z]+)/)?(?P<name>[A-Z][A-Za-z0-9]*)\Z", re.ASCII)
_STANDARD = "rise/robot"
"""What the names of the profile `rise` begin with."""
_QOS_KEYS = ("reliability", "durability", "depth")
_RELIABILITY = {"reliable": True, "best_effort": False}
_DURABILITY = {"volatile": False, "transient_local": True}
_DEEPEST = 10_000
"""Messages that may be kept for one topic."""
_ERROR_KEYS = ("code", "ok", "text", "codes")


# --- reading --------------------------------------------------------------------------------------------------------


def read_options(profile: RobotProfile) -> Options:
    """The profile's `[options]`. Raises CarrierErrors."""
    notes = Notes()
    options = _options(profile, notes)
    if notes.sentences:
        raise CarrierErrors(profile.name, notes.sentences)
    return options


def read_carriers(
    profile: RobotProfile, fields: Fields | None = None, *, actions: Collection[str] | None = None
) -> dict[str, Carrier]:
    """By name, the carrier of every action that the robot itself does.

    `fields` is `Transport.fields`; without it, types are taken as they are and everything else is checked. `actions`
    narrows it down to some actions. Raises CarrierErrors with everything that is wrong.
    """
    notes = Notes()
    options = _options(profile, notes)
    types = Types(fields)
    carriers: dict[str, Carrier] = {}
    for name, spec in profile.actions.items():
        if not _is_done_by_itself(spec) or (actions is not None and name not in actions):
            continue
        carrier = _Reading(_written_out(spec, options), options, types, notes).carrier()
        if carrier is not None:
            carriers[name] = carrier
            _check_qos(name, carriers, notes)
    if notes.sentences:
        raise CarrierErrors(profile.name, list(dict.fromkeys(notes.sentences)))
    return carriers


def _check_qos(name: str, carriers: Mapping[str, Carrier], notes: Notes) -> None:
    """Actions that go the same way have one subscription or publisher between them, and it has one quality of service.
    `name`: that of the action that was read last."""
    carrier = carriers[name]
    for other, before in carriers.items():
        if (before.kind, before.name, before.type) == (carrier.kind, carrier.name, carrier.type) and (
            (before.topic_qos, before.feedback_qos, before.status_qos)
            != (carrier.topic_qos, carrier.feedback_qos, carrier.status_qos)
        ):
            where = f"actions.{name}.carrier.qos"
            notes.add(where, f"differs from that of {other}, which goes to {carrier.name} too; give both the same")
            return


def profile_findings(profile: RobotProfile, fields: Fields | None = None) -> list[str]:
    """Everything that is wrong with a profile's options and carriers, as sentences; empty when it can be used."""
    try:
        read_carriers(profile, fields)
    except CarrierErrors as errors:
        return errors.findings
    return []


def written_out(profile: RobotProfile) -> RobotProfile:
    """The profile with every carrier in its action: also those that `options.wrapper` and `options.error` stand for."""
    options = _options(profile, Notes())
    return replace(profile, actions={name: _written_out(spec, options) for name, spec in profile.actions.items()})


def _options(profile: RobotProfile, notes: Notes) -> Options:
    known = [field.name for field in struct_fields(Options)]
    for key in profile.options:
        if key not in known:
            notes.add(f"options.{key}", f"does not exist for the driver `{DRIVER}`{suggestion(key, known)}")
    frame = profile.options.get("frame", Options().frame)
    if not isinstance(frame, str) or not frame.strip():
        notes.add("options.frame", "is the name of a coordinate frame, a text")
        frame = Options().frame
    deadlines = _deadlines(profile.options.get("deadlines", {}), Deadlines(), "options.deadlines", notes)
    share = profile.options.get("share", [])
    if not isinstance(share, list) or not all(isinstance(each, str) and each for each in share):
        notes.add("options.share", 'is a list of folders: ["/opt/robot/share"]')
        share = []
    folders = [os.path.expandvars(os.path.expanduser(each)) for each in share]  # noqa: PTH111  # no Path needed
    for each in folders:
        if not Path(each).is_absolute():
            notes.add("options.share", f"has `{each}`; give the whole path, from `/` or `~`")
    error = profile.options.get("error", {})
    if not isinstance(error, dict):
        notes.add("options.error", 'is a table: { code = "result.error_code" }')
        error = {}
    wrapper = profile.options.get("wrapper", "")
    if wrapper and not _is_name(wrapper):
        notes.add("options.wrapper", "is a ROS name such as `pepper`: letters, digits and `_`, parts divided by `/`")
        wrapper = ""
    return Options(frame, deadlines, error, wrapper, tuple(folders))


@cache
def _standard_carriers() -> Mapping[str, Mapping[str, Any]]:
    """The carriers of the profile `rise`, which a wrapper in the manner of RISE offers under a name of its own."""
    profile = tomllib.loads(resources.files("rise_adapters.robots").joinpath("rise.toml").read_text("utf-8"))
    return {name: table["carrier"] for name, table in profile["actions"].items()}


def _written_out(spec: ActionSpec, options: Options) -> ActionSpec:
    """The action with its carrier, also when that is its wrapper's; without one if there is none."""
    carrier = spec.carrier
    standard = _standard_carriers().get(spec.name)
    if not carrier and options.wrapper and standard is not None and _is_done_by_itself(spec):
        carrier = {**standard, "action": standard["action"].replace(_STANDARD, options.wrapper, 1)}
    if "action" in carrier and "error" not in carrier and options.error:
        carrier = {**carrier, "error": options.error}
    return replace(spec, carrier=carrier)


def _is_done_by_itself(spec: ActionSpec) -> bool:
    return spec.supported and not spec.engine and spec.substitute is None


def _is_name(name: Any) -> bool:
    return isinstance(name, str) and _NAME.match(name) is not None and "__" not in name


def _deadlines(table: Any, before: Deadlines, where: str, notes: Notes) -> Deadlines:
    if not isinstance(table, dict):
        notes.add(where, "is a table of seconds: { acceptance = 2 }")
        return before
    known = [field.name for field in struct_fields(Deadlines)]
    found: dict[str, float] = {}
    for key, value in table.items():
        may_be_zero = key in ("feedback", "result")
        if key not in known:
            notes.add(f"{where}.{key}", f"does not exist{suggestion(key, known)}")
        elif isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= MAX_SECONDS:
            notes.add(f"{where}.{key}", f"is a number of seconds, up to {MAX_SECONDS:.0f} (24 hours)")
        elif not value and not may_be_zero:
            notes.add(f"{where}.{key}", "is a number of seconds above 0")
        else:
            found[key] = float(value)
    return replace(before, **found)


class _Reading:
    """The carrier of one action."""

    def __init__(self, spec: ActionSpec, options: Options, types: Types, notes: Notes) -> None:
        self.spec = spec
        self.table = spec.carrier
        self.options = options
        self.types = types
        self.notes = notes

    def carrier(self) -> Carrier | None:
        kind = self.kind()
        if kind is None:
            return None
        for key in self.table:
            if key not in _KEYS[kind]:
                self.note(key, f"does not exist{suggestion(key, _KEYS[kind])}")
        name, type = self.name(kind), self.type(kind)
        deadlines = _deadlines(self.part("deadlines"), self.options.deadlines, self.where("deadlines"), self.notes)
        part = "goal" if kind == "action" else "message"
        sent = f"{type}_Goal" if type and kind == "action" else type
        whole = [sent, f"{type}_Result", f"{type}_Feedback"] if kind == "action" else [sent]
        if sent and (missing := next(filter(None, map(self.types.missing, whole)), "")):
            self.note("type", f"cannot be used here: {missing}")
            sent = type = ""
        compiler = Compiler(self.spec, self.values(), self.types, self.notes)
        message = compiler.message(self.part(part), sent, self.where(part))
        used = compiler.used
        if kind == "topic":  # its time is kept here, whether it has a field for it or not
            used = used | {"duration", "repetitions"}
        return Carrier(
            kind,
            name,
            type,
            deadlines,
            message,
            self.reset(type) if kind == "topic" else None,
            self.verdict(type) if kind == "action" else None,
            tuple(each for each in self.spec.parameters if each not in used),
            self.qos(kind),
        )

    def kind(self) -> Literal["action", "topic"] | None:
        if not self.table:
            self.notes.sentences.append(
                f"`actions.{self.spec.name}` has no `carrier`, which says what carries it to the robot; "
                f"if the robot cannot do it, leave the action out"
            )
        elif "action" in self.table and "topic" in self.table:
            self.note("topic", "stands beside `action`; a carrier is one or the other")
        elif "action" in self.table:
            return "action"
        elif "topic" in self.table:
            return "topic"
        else:
            self.notes.add(f"actions.{self.spec.name}.carrier", "has neither `action` nor `topic`: the name on ROS")
        return None

    def name(self, kind: str) -> str:
        name = self.table[kind]
        if _is_name(name):
            return str(name)
        self.note(kind, f"is a ROS name such as `{self.example(kind)}`: letters, digits and `_`, parts divided by `/`")
        return "unknown"

    def example(self, kind: str) -> str:
        return "pepper/speech" if kind == "action" else "pepper/tablet"

    def type(self, kind: str) -> str:
        """The type on ROS; empty when it is none."""
        wanted = "action" if kind == "action" else "msg"
        type = self.table.get("type")
        found = _TYPE.match(type) if isinstance(type, str) else None
        if found is not None and found["kind"] == wanted:
            assert isinstance(type, str)
            return type
        example = "rise_interfaces/action/Speech" if wanted == "action" else "std_msgs/msg/String"
        what = f"is the type of the {kind} on ROS, such as `{example}`"
        if "type" not in self.table:
            self.notes.add(f"actions.{self.spec.name}.carrier", f"has no `type`; it {what}")
        elif found is not None:
            self.note("type", f"{what}; did you mean `{found['package']}/{wanted}/{found['name']}`?")
        else:
            self.note("type", what)
        return ""

    def values(self) -> dict[str, dict[str, Any]]:
        result: dict[str, dict[str, Any]] = {}
        for name, table in self.part("values").items():
            parameter = self.spec.parameters.get(name)
            if parameter is None:
                known = suggestion(name, self.spec.parameters)
                self.note(f"values.{name}", f"is no parameter of {self.spec.name}{known}")
            elif not isinstance(table, dict) or not all(isinstance(each, str | int | float) for each in table.values()):
                self.note(f"values.{name}", 'translates values: { fear = "scared" }')
            else:
                known_here = known_names(parameter)
                for key in table:
                    if parameter.type == "name" and not accepts_any_name(parameter) and key not in known_here:
                        self.note(f"values.{name}.{key}", f"is no name of `{name}`{suggestion(key, known_here)}")
                result[name] = table
        return result

    def reset(self, type: str) -> Group | None:
        if "reset" not in self.table:
            return None
        # When it is sent nobody knows the parameters any more: an action without any.
        nobody = replace(self.spec, parameters={})
        return Compiler(nobody, {}, self.types, self.notes).message(self.part("reset"), type, self.where("reset"))

    def qos(self, kind: str) -> dict[str, QoS]:
        """The quality of service of what a carrier publishes, or listens to."""
        table = self.part("qos")
        if kind == "topic":
            return {"topic": self.quality(table, RELIABLE, "qos")}
        usual = {FEEDBACK: RELIABLE, STATUS_TOPIC: STATUS}
        for key in table:
            if key in _QOS_KEYS:
                self.note(f"qos.{key}", f"stands in `qos.{FEEDBACK}` or `qos.{STATUS_TOPIC}`: goals have no other")
            elif key not in usual:
                self.note(f"qos.{key}", f"does not exist{suggestion(key, usual)}")
        return {key: self.quality(table.get(key, {}), before, f"qos.{key}") for key, before in usual.items()}

    def quality(self, table: Any, before: QoS, where: str) -> QoS:
        if not isinstance(table, dict):
            self.note(where, 'is a table: { reliability = "best_effort" }')
            return before
        for key in table:
            if key not in _QOS_KEYS:
                self.note(f"{where}.{key}", f"does not exist{suggestion(key, _QOS_KEYS)}")
        depth = table.get("depth", before.depth)
        if isinstance(depth, bool) or not isinstance(depth, int) or not 1 <= depth <= _DEEPEST:
            self.note(f"{where}.depth", f"is a whole number of messages from 1 to {_DEEPEST}")
            depth = before.depth
        return QoS(
            depth,
            self.word(table, "reliability", _RELIABILITY, before.reliable, where),
            self.word(table, "durability", _DURABILITY, before.latched, where),
        )

    def word(self, table: Mapping[str, Any], key: str, words: Mapping[str, bool], before: bool, where: str) -> bool:
        word = table.get(key)
        if word is None:
            return before
        if isinstance(word, str) and word in words:
            return words[word]
        near = nearest(word, words) if isinstance(word, str) else None
        meant = f"; did you mean `{near}`?" if near is not None else ""
        self.note(f"{where}.{key}", f"is {' or '.join(f'`{each}`' for each in words)}{meant}")
        return before

    def verdict(self, type: str) -> Verdict:
        table = self.part("error")
        for key in table:
            if key not in _ERROR_KEYS:
                self.note(f"error.{key}", f"does not exist{suggestion(key, _ERROR_KEYS)}")
        code, code_type = self.path(table, "code", type)
        text, text_type = self.path(table, "text", type)
        if text_type is not None and (text_type.kind != "text" or text_type.many):
            self.note("error.text", f"is the field with the robot's words, and this one is `{text_type}`")
        ok = table.get("ok", 0)
        if code_type is not None and (code_type.many or code_type.kind not in ("integer", "boolean")):
            self.note("error.code", f"is a whole number or true or false, and this field is `{code_type}`")
        elif code_type is not None and code_type.kind == "boolean" and not isinstance(ok, bool):
            self.note("error", "has a `code` that is true or false; say which one is success: `ok = true`")
        elif not isinstance(ok, int) or (code_type is not None and code_type.kind == "integer" and ok is True):
            self.note("error.ok", "is the value of `code` that means success: a whole number, true or false")
            ok = 0
        codes = table.get("codes", {})
        if not isinstance(codes, dict) or not all(isinstance(each, str) for each in codes.values()):
            self.note("error.codes", 'says what numbers mean: { 134 = "the robot cannot do this" }')
            codes = {}
        for key in ("ok", "codes"):
            if key in table and "code" not in table:
                self.note(f"error.{key}", "needs `code`: the field of the result that it is about")
        return Verdict(code, ok, text, codes)

    def path(self, table: Mapping[str, Any], key: str, type: str) -> tuple[tuple[str, ...], FieldType | None]:
        """A field of the result, and its type where that is known."""
        path = table.get(key)
        if path is None:
            return (), None
        if not isinstance(path, str) or not all(path.split(".")):
            self.note(f"error.{key}", "is a field of the result, such as `result.error_code`")
            return (), None
        names = tuple(path.split("."))
        if not type:
            return names, None
        inside = FieldType(f"{type}_Result")
        for name in names:
            fields = self.types.of(inside.name)
            if fields is None:
                if missing := self.types.missing(inside.name):
                    self.note(f"error.{key}", f"cannot be checked: {missing}")
                return names, None
            if name not in fields:
                self.note(
                    f"error.{key}", f"names `{name}`, which is no field of {inside.name}{suggestion(name, fields)}"
                )
                return names, None
            inside = fields[name]
        return names, inside

    def part(self, key: str) -> dict[str, Any]:
        """One of the carrier's tables; empty when it is not there."""
        table = self.table.get(key, {})
        if isinstance(table, dict):
            return table
        self.note(key, "is a table")
        return {}

    def where(self, key: str) -> str:
        return f"actions.{self.spec.name}.carrier.{key}"

    def note(self, key: str, sentence: str) -> None:
        self.notes.add(self.where(key), sentence)
