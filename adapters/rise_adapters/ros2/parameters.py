"""A program's own settings as ROS parameters, the same on both transports.

`--ros-args -p name:=value` and `--params-file FILE` become options of the program's command line before that is read
(`parameters_as_options`). So each option is declared, checked and explained in one place. An unknown parameter is
refused with the nearest name, like an unknown option. RISE does not support simulated time and overrides of the quality
of service, and refuses them with a sentence. If a file sets them for all nodes, they are skipped with that sentence as
a note.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

from msgspec import Struct

from rise_adapters.ros2.transport.names import check_namespace
from rise_adapters.ros2.transport.port import Message, PortError, SendReply, Transport
from rise_engine.base.nearest_name import did_you_mean

ParameterValue: TypeAlias = "bool | int | float | str | list[str] | None"
SIM_TIME = "use_sim_time"
_QOS = "qos_overrides."
_FLAGS = ("-p", "--param")
_FILE = "--params-file"
_TYPES = "rcl_interfaces/srv/"


class GivenParameter(Struct, frozen=True):
    """A given parameter."""

    name: str
    value: Any
    """A text, or a list of texts. The option decides its meaning, so that the participant 007 stays 007."""
    for_all_nodes: bool = False
    """Whether a file gives it to all nodes (`/**`). A node that does not know it skips it."""


class ParameterOption(Struct, frozen=True):
    """An option of a command line that can also be given as a parameter."""

    flag: str
    """`--dwell`"""
    switch: bool = False
    """Whether it takes no value."""
    opposite: str = ""
    """For a switch: the flag that turns it off (`--no-record`); empty: omitting the switch turns it off."""
    repeatable: bool = False
    """Whether it can be given several times; the parameter is then a list."""


# --- given parameters -----------------------------------------------------------------------------------------------


def split_parameters(arguments: Sequence[str], node: str) -> tuple[list[GivenParameter], tuple[str, ...]]:
    """Return the parameters for `node` (its name, without namespace) among ROS's arguments, and the other arguments. A
    later parameter overrides an earlier one. Raises PortError."""
    own, namespace = _read_node_and_namespace(arguments, node)
    full = f"{namespace.rstrip('/')}/{own}"
    given: list[GivenParameter] = []
    others: list[str] = []
    rest = iter(arguments)
    for argument in rest:
        if argument not in (*_FLAGS, _FILE):
            others.append(argument)
            continue
        value = next(rest, None)
        if value is None:
            raise PortError(f"--ros-args: something must follow {argument}")
        if argument == _FILE:
            given += _read_file(Path(value), full)
            continue
        name, separator, text = value.partition(":=")
        of_node, _, name = name.rpartition(":")
        if not separator or not name:
            raise PortError(f"--ros-args: {value!r} is not a parameter; one looks like name:=value")
        if of_node in ("", own, full):
            read = _read_yaml(text, f"{argument} {value}")
            given.append(GivenParameter(name, "" if read is None else read))
    return given, tuple(others)


def parameters_as_options(
    arguments: Sequence[str], node: str, options: Mapping[str, ParameterOption], written: Sequence[str] = ()
) -> tuple[list[str], tuple[str, ...]]:
    """Return parameters as options of the command line, and ROS's other arguments. The options go before those
    `written` there, which override them. Raises PortError."""
    given, others = split_parameters(arguments, node)
    chosen: dict[str, Any] = {}
    for each in given:
        name = each.name.replace("-", "_")
        if unfollowed := _why_unfollowed(name, each.value):
            if not each.for_all_nodes:
                raise PortError(f"{unfollowed}; omit it")
            print(f"note: {unfollowed}; it is in a file for all nodes, and is ignored here", file=sys.stderr)
        elif name in options:
            chosen[name] = each.value
        elif not each.for_all_nodes and name != SIM_TIME:
            raise PortError(f"the parameter {each.name} is unknown{did_you_mean(name, [*options, SIM_TIME])}")
    # The last value of an option counts, unless it can be given several times.
    flags = {word.partition("=")[0] for word in written}
    words: list[str] = []
    for name, value in chosen.items():
        made = list(_option_words(name, options[name], value))
        if not (options[name].repeatable and options[name].flag in flags):
            words += made
    return words, others


def _why_unfollowed(name: str, value: Any) -> str:
    """Why this program does not follow a parameter of every ROS node; empty: it does."""
    if name == SIM_TIME and _read_truth(value) is not False:
        return (
            f"the parameter {name} is {value}, and this program does not follow /clock: people take part, and the "
            "record is in their time (`--speed` makes a rehearsal faster)"
        )
    if name.startswith(_QOS):
        return (
            f"the parameter {name}: the quality of service of this program's topics is fixed, because others rely on "
            "it (docs/explanation/ros2.md)"
        )
    return ""


def _option_words(name: str, option: ParameterOption, value: Any) -> Iterator[str]:
    if option.switch:
        truth = _read_truth(value)
        if truth is None:
            raise PortError(f"the parameter {name} is true or false, not {value!r}")
        if flag := option.flag if truth else option.opposite:
            yield flag
        return
    values = value if isinstance(value, list) else [value]
    if isinstance(value, list) and not option.repeatable:
        raise PortError(f"the parameter {name} is one value, not the list {value!r}")
    for each in values:
        if not isinstance(each, str):
            raise PortError(f"the parameter {name} cannot be {each!r}")
        yield f"{option.flag}={each}"


def _read_truth(value: Any) -> bool | None:
    """Read a truth value as in YAML 1.1, which ROS uses."""
    word = value.casefold() if isinstance(value, str) else ""
    return True if word in ("true", "yes", "on", "y") else False if word in ("false", "no", "off", "n") else None


def _read_node_and_namespace(arguments: Sequence[str], node: str) -> tuple[str, str]:
    """The node's name and namespace, by the rules among the arguments."""
    found: dict[str, str] = {}
    rest = iter(arguments)
    for argument in rest:
        if argument in ("-r", "--remap"):
            source, _, target = (next(rest, None) or "").partition(":=")
            of_node, _, name = source.rpartition(":")
            if of_node in ("", node) and name in ("__ns", "__node", "__name"):
                found.setdefault("__node" if name == "__name" else name, target)
    return found.get("__node", node), check_namespace(found.get("__ns", "/"))


def _read_file(path: Path, full: str) -> Iterator[GivenParameter]:
    try:
        read = _read_yaml(path.read_text("utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise PortError(f"--params-file {path} cannot be read: {error}") from None
    if not read:
        return
    found = list(_find_sections(read, "", str(path)))
    # A section for this node overrides a section for all nodes.
    for pattern, section in sorted(found, key=lambda each: "*" not in each[0]):
        if _matches_node(pattern, full):
            for name, value in _flatten(section, ""):
                yield GivenParameter(name, value, for_all_nodes="*" in pattern)


def _find_sections(table: Any, where: str, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(table, dict):
        raise PortError(
            f"--params-file {path}: a node's name has `ros__parameters:` below it, and that has the node's parameters"
        )
    for key, value in table.items():
        if key == "ros__parameters":
            if value and not isinstance(value, dict):
                raise PortError(f"--params-file {path}: ros__parameters has names with values below it")
            yield where, value or {}
        else:
            yield from _find_sections(value, f"{where}/{str(key).strip('/')}", path)


def _matches_node(pattern: str, full: str) -> bool:
    """Whether a pattern matches a node: `*` is one part of a name, `**` any number of parts."""
    parts = ["(/[^/]+)*" if part == "**" else "/[^/]+" if part == "*" else re.escape(f"/{part}")
             for part in pattern.strip("/").split("/")]  # fmt: skip
    return re.fullmatch("".join(parts), full) is not None


def _flatten(table: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _read_yaml(text: str, where: str) -> Any:
    """Read a YAML text, with texts for all values except lists and tables, by the reader of ROS or of the extra
    `dds`."""
    try:
        try:
            yaml = import_module("yaml")
            return yaml.load(text, Loader=yaml.BaseLoader)
        except ModuleNotFoundError:
            return import_module("ruamel.yaml").YAML(typ="base", pure=True).load(text)
    except ModuleNotFoundError:
        raise PortError("parameters need a reader of YAML: pip install 'rise-tui[dds]', or source ROS") from None
    except Exception as error:  # both readers raise many kinds
        raise PortError(f"--ros-args: {where} is not YAML: {' '.join(str(error).split())}") from None


# --- readable parameters --------------------------------------------------------------------------------------------


class ReadableParameter(Struct, frozen=True):
    """A parameter that other nodes can read."""

    value: ParameterValue
    description: str = ""


NO_SIM_TIME = {SIM_TIME: ReadableParameter(False, "always false: people take part, and the record is in their time")}
"""Every ROS node has this parameter."""


class ParameterServices:
    """Answers `ros2 param` for one node."""

    def __init__(self, transport: Transport, settings: Callable[[], Mapping[str, ReadableParameter]]) -> None:
        """`settings` is called at each request. Raises PortError."""
        self._read_own = settings
        for name, type, take_request in (
            ("list_parameters", "ListParameters", self._list),
            ("get_parameters", "GetParameters", self._get),
            ("get_parameter_types", "GetParameterTypes", self._get_types),
            ("describe_parameters", "DescribeParameters", self._describe),
            ("set_parameters", "SetParameters", self._set),
            ("set_parameters_atomically", "SetParametersAtomically", self._set_atomically),
        ):
            transport.serve(f"~/{name}", f"{_TYPES}{type}", take_request)

    def _read_all(self) -> dict[str, ReadableParameter]:
        return {**self._read_own(), **NO_SIM_TIME}

    def _read_values(self, names: list[str]) -> list[ParameterValue]:
        settings = self._read_all()
        return [settings[name].value if name in settings else None for name in names]

    def _list(self, request: Message, reply: SendReply) -> None:
        wanted = request["prefixes"]
        names = [
            name
            for name in sorted(self._read_all())
            if not wanted or any(name == prefix or name.startswith(f"{prefix}.") for prefix in wanted)
        ]
        reply({"result": {"names": names}})

    def _get(self, request: Message, reply: SendReply) -> None:
        reply({"values": [parameter_value(value) for value in self._read_values(request["names"])]})

    def _get_types(self, request: Message, reply: SendReply) -> None:
        reply({"types": bytes(map(parameter_type, self._read_values(request["names"])))})

    def _describe(self, request: Message, reply: SendReply) -> None:
        settings = self._read_all()
        described: list[Message] = [{"name": name} for name in request["names"]]
        for each in described:
            if (known := settings.get(each["name"])) is not None:
                each.update(type=parameter_type(known.value), description=known.description, read_only=True)
        reply({"descriptors": described})

    def _set(self, request: Message, reply: SendReply) -> None:
        reply({"results": [self._refuse(each["name"]) for each in request["parameters"]]})

    def _set_atomically(self, request: Message, reply: SendReply) -> None:
        names = [each["name"] for each in request["parameters"]]
        reply({"result": self._refuse(names[0]) if names else {"successful": True}})

    def _refuse(self, name: str) -> Message:
        settings = self._read_all()
        if name not in settings:
            reason = f"there is no parameter {name}{did_you_mean(name, settings)}"
        else:
            reason = f"{name} is read when the program starts: --ros-args -p {name}:=..."
        return {"successful": False, "reason": reason}


_TYPE_AND_FIELD = {
    bool: (1, "bool_value"),
    int: (2, "integer_value"),
    float: (3, "double_value"),
    str: (4, "string_value"),
    list: (9, "string_array_value"),
}
"""The ParameterType of a Python value, and the field of a ParameterValue that contains it."""


def parameter_type(value: ParameterValue) -> int:
    """The number of rcl_interfaces/msg/ParameterType; 0: not set."""
    return _TYPE_AND_FIELD.get(type(value), (0, ""))[0]


def parameter_value(value: ParameterValue) -> Message:
    """The value as a rcl_interfaces/msg/ParameterValue."""
    kind, field = _TYPE_AND_FIELD.get(type(value), (0, ""))
    return {"type": kind, field: value} if kind else {}
