"""Actions as data. One format declares the engine's, a robot's and a scenario's actions (docs/reference/robots.md).

Declarations are applied in this order: the core actions, the robot's profile, the scenario.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Literal, get_args

from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.toml_files import TomlTable, is_integer, read_toml
from rise_engine.scenario.model import ActionSpec, Parameter, ParameterType
from rise_engine.scenario.parameters import MESSAGE
from rise_engine.syntax.xml import is_element_name

DeclarationLayer = Literal["core", "profile", "scenario"]

_ACTION_KEYS = (
    "channels",
    "seconds",
    "limit",
    "names",
    "without",
    "substitute",
    "ssml",
    "carrier",
    "help",
    "parameters",
)
_PARAMETER_KEYS = (
    "type",
    "unit",
    "default",
    "required",
    "minimum",
    "maximum",
    "codes",
    "names",
    "help",
    "spoken",
    "place",
)
_TYPES: tuple[str, ...] = get_args(ParameterType)
RESERVED = frozenset({"actionID", "waitForActions", "onFailure", "Variants", "Dialog"})
"""Words of the CRA format that cannot name an action or a parameter."""


@cache
def core_actions() -> Mapping[str, ActionSpec]:
    """The actions that every scenario may use (semantics.md 2.1)."""
    diagnostics = Diagnostics()
    data = (Path(__file__).parents[1] / "core_actions.toml").read_bytes()
    file = read_toml(SourceFile("core_actions.toml", data, data.decode()), diagnostics)
    assert file is not None
    specs = apply_declarations(TomlTable(file, (), file.values, diagnostics), {}, "core")
    assert not diagnostics.errors, diagnostics.sorted()
    return specs


def apply_declarations(
    file: TomlTable, before: Mapping[str, ActionSpec], layer: DeclarationLayer
) -> dict[str, ActionSpec]:
    """Apply the `[actions.*]` tables of a file to the actions of earlier files."""
    specs = dict(before)
    actions = file.subtable("actions", "`actions` is a table: [actions.NAME]")
    if actions is None:
        return specs
    if layer == "profile":  # a robot cannot perform the actions that its profile does not list
        for name, spec in before.items():
            if not spec.engine and name not in actions.values:
                specs[name] = replace(spec, supported=False)
    for name in actions.values:
        table = actions.subtable(name, f"an action is a table: [actions.{name}]")
        if table is not None and _check_name(table, "an action"):
            specs[name] = _read_action(table, specs.get(name), layer)
    _check_substitutes(actions, specs)
    return specs


def read_places(file: TomlTable, before: Mapping[str, dict[str, float | str]]) -> dict[str, dict[str, float | str]]:
    """Apply the `[places.*]` tables of a file to the places of earlier files."""
    places = dict(before)
    tables = file.subtable("places", "`places` is a table: [places.NAME]")
    for name in tables.values if tables is not None else ():
        assert tables is not None
        table = tables.subtable(name, "a place is a table: { x = 1.0, y = 2.0, yaw = 0.5 }")
        if table is None:
            continue
        for key, value in table.values.items():
            if isinstance(value, bool) or not isinstance(value, int | float | str):
                table.report_value("wrong-type", key, f"`{key}` of a place is a number or a text")
        places[name] = dict(table.values)
    return places


def name_places(
    actions: Mapping[str, ActionSpec], places: Mapping[str, dict[str, float | str]]
) -> dict[str, ActionSpec]:
    """Add the places to the names of each parameter for a place."""
    named = dict(actions)
    for action, spec in actions.items():
        parameters = {
            each.name: replace(each, names=tuple(dict.fromkeys((*each.names, *places)))) if each.place else each
            for each in spec.parameters.values()
        }
        if parameters != spec.parameters:
            named[action] = replace(spec, parameters=parameters)
    return named


def _check_substitutes(actions: TomlTable, specs: dict[str, ActionSpec]) -> None:
    able = [spec.name for spec in specs.values() if spec.supported and not spec.substitute and not spec.engine]
    for name in actions.values:
        spec = specs.get(name)
        if spec is None or spec.substitute is None:
            continue
        location = actions.value_location(name, "substitute")
        other = specs.get(spec.substitute)
        if other is None or not other.supported or other.substitute is not None or other.name == name:
            message, near = f"`{spec.substitute}` is not an action of this robot", suggest(spec.substitute, able)
            actions.diagnostics.error("unknown-action", location, message, near)
            continue
        missing = [p.name for p in other.parameters.values() if p.required and p.name not in spec.parameters]
        if missing:
            message = f"`{name}` has no `{missing[0]}`, which `{other.name}` requires"
            actions.diagnostics.error("missing-parameter", location, message)
        specs[name] = replace(spec, channels=other.channels)


def _check_name(table: TomlTable, kind: str) -> bool:
    """Whether a table's name can be an element's name; reports a diagnostic if not."""
    name = table.name
    if name not in RESERVED and name.isidentifier() and (name.isascii() or is_element_name(name)):
        return True
    table.report_key("bad-name", f"{kind} cannot be called `{name}`")
    return False


def _read_action(table: TomlTable, before: ActionSpec | None, layer: DeclarationLayer) -> ActionSpec:
    """Apply one `[actions.NAME]` table to the earlier declaration."""
    base = before or ActionSpec(table.name, {})
    table.report_unknown_keys((*_ACTION_KEYS, "engine") if layer == "core" else _ACTION_KEYS)
    if base.engine:
        table.report_key("wrong-type", f"`{table.name}` runs in the engine and cannot be changed")
        return base
    parameters = _read_parameters(table, base)
    message = parameters.get(MESSAGE)
    if "ssml" in table.values and (message is None or message.type != "text"):
        table.report_key("wrong-type", "`ssml` needs a parameter `message` of the type `text`", "ssml")
    return replace(
        base,
        parameters=parameters,
        channels=table.read_texts("channels", base.channels),
        engine=bool(table.values.get("engine", False)),
        supported=True,
        substitute=table.read("substitute", str, None),
        seconds=_read_seconds(table, "seconds", base.seconds) or base.seconds,
        limit=_read_seconds(table, "limit", base.limit),
        ssml=table.read("ssml", bool, base.ssml),
        carrier={**base.carrier, **table.read("carrier", dict, {})},
        help=table.read("help", str, base.help),
    )


def _read_parameters(action: TomlTable, base: ActionSpec) -> dict[str, Parameter]:
    """Apply the parameters in an action's table to the earlier ones."""
    result = dict(base.parameters)
    parameters = action.read("parameters", dict, {})
    tables = TomlTable(action.file, (*action.path, "parameters"), parameters, action.diagnostics)
    for name in parameters:
        table = tables.subtable(name, f"a parameter is a table: {{ type = ... }} for `{name}`")
        if table is not None and _check_name(table, "a parameter"):
            parameter = _read_parameter(table, result.get(name))
            if parameter is not None:
                result[name] = parameter
    value = result.get("value")
    more, without = action.read_texts("names", ()), action.read_texts("without", ())
    if (more or without) and (value is None or value.type != "name"):
        key = "names" if more else "without"
        action.report_key("wrong-type", f"`{key}` needs a parameter `value` of the type `name`", key)
    elif value is not None:
        left_out, known = frozenset(without), dict.fromkeys((*value.codes, *value.names))
        for index, name in enumerate(without):
            if name not in known:
                message, near = f"there is no name `{name}` to leave out", suggest(name, known)
                action.report_key("unknown-name", message, "without", str(index), suggestion=near)
        result["value"] = replace(
            value,
            codes={name: code for name, code in value.codes.items() if name not in left_out},
            names=tuple(name for name in dict.fromkeys((*value.names, *more)) if name not in left_out),
        )
    return result


def _read_parameter(table: TomlTable, before: Parameter | None) -> Parameter | None:
    """Apply one parameter's table to the earlier declaration. Without a valid type, nothing changes."""
    table.report_unknown_keys(_PARAMETER_KEYS)
    type_ = table.read("type", str, before.type if before else None)
    if type_ not in _TYPES:
        location = table.value_location("type") if "type" in table.values else table.key_location()
        table.diagnostics.error("wrong-type", location, f"`type` is one of {', '.join(_TYPES)}")
        return before
    base = before or Parameter(table.name, "text")
    codes = table.read("codes", dict, base.codes)
    if not all(is_integer(code) for code in codes.values()):
        table.report_key("wrong-type", "`codes` gives each name a whole number", "codes")
        codes = base.codes
    return Parameter(
        name=base.name,
        type=type_,
        unit=table.read("unit", str, base.unit),
        default=table.values.get("default", base.default),
        required=table.read("required", bool, base.required),
        minimum=table.read_number("minimum", base.minimum),
        maximum=table.read_number("maximum", base.maximum),
        codes=codes,
        names=table.read_texts("names", base.names),
        help=table.read("help", str, base.help),
        spoken=_read_of_type("spoken", "text", table, type_, base.spoken),
        place=_read_of_type("place", "name", table, type_, base.place),
    )


def _read_of_type(key: str, needed: str, table: TomlTable, type_: str, before: bool) -> bool:
    """Read a flag that only parameters of the type `needed` can have."""
    found: bool = table.read(key, bool, before)
    if found and type_ != needed and key in table.values:
        table.report_value("wrong-type", key, f"only a parameter of the type `{needed}` can be `{key}`")
    return found and type_ == needed


def _read_seconds(table: TomlTable, key: str, usual: float | None) -> float | None:
    value = table.read_number(key, usual)
    if value is None or 0 < value <= MAX_SECONDS:
        return value
    message = f"`{key}` is a number of seconds above 0 and up to {MAX_SECONDS:.0f} (24 hours)"
    table.report_value("out-of-range", key, message)
    return usual
