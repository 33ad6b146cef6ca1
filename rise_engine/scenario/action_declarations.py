"""Actions as data: the engine's own, a robot's and a scenario's are declared in one format (docs/reference/robots.md).

A declaration is laid over what came before: the core actions, then the robot's profile, then the scenario.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

from msgspec.structs import replace

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.model import ActionSpec, Parameter, ParameterType
from rise_engine.scenario.source_files import SourceFile
from rise_engine.scenario.toml_locations import TomlFile, TomlTable, read_toml
from rise_engine.scenario.xml import is_element_name

DeclarationLayer = Literal["core", "profile", "scenario"]

_ACTION_KEYS = (
    "channels",
    "seconds",
    "limit",
    "names",
    "without",
    "substitute",
    "carrier",
    "help",
    "parameters",
)
_PARAMETER_KEYS = ("type", "unit", "default", "required", "minimum", "maximum", "codes", "names", "help")
_TYPES: tuple[str, ...] = get_args(ParameterType)
RESERVED = frozenset({"actionID", "waitForActions", "onFailure", "Variants", "Dialog"})
"""Words of the CRA format that no action or parameter can be called."""


@cache
def core_actions() -> Mapping[str, ActionSpec]:
    """The actions that every scenario may use (semantics.md 2.1)."""
    diagnostics = Diagnostics()
    data = Path(__file__).with_name("core_actions.toml").read_bytes()
    file = read_toml(SourceFile("core_actions.toml", data, data.decode()), diagnostics)
    assert file is not None
    specs = apply_declarations(file, {}, "core", diagnostics)
    assert not diagnostics.errors, diagnostics.sorted()
    return specs


def apply_declarations(
    file: TomlFile, before: Mapping[str, ActionSpec], layer: DeclarationLayer, diagnostics: Diagnostics
) -> dict[str, ActionSpec]:
    """The actions after the `[actions.*]` tables of a file have been laid over those known before."""
    specs = dict(before)
    actions = file.values.get("actions", {})
    if not isinstance(actions, dict):
        diagnostics.error("wrong-type", file.key_location("actions"), "`actions` is a table: [actions.NAME]")
        return specs
    if layer == "profile":  # what a profile does not list its robot cannot do
        specs = {
            name: spec if spec.engine or name in actions else replace(spec, supported=False)
            for name, spec in specs.items()
        }
    for name, values in actions.items():
        table = TomlTable(file, ("actions", name), values)
        if not isinstance(values, dict):
            diagnostics.error(
                "wrong-type", file.key_location("actions", name), f"an action is a table: [actions.{name}]"
            )
        elif name in RESERVED or not _can_be_element_name(name):
            diagnostics.error("bad-name", file.key_location("actions", name), f"an action cannot be called `{name}`")
        else:
            specs[name] = _Declaration(table, specs.get(name), layer, diagnostics).spec()
    _check_substitutes(file, specs, diagnostics)
    return specs


def _check_substitutes(file: TomlFile, specs: dict[str, ActionSpec], diagnostics: Diagnostics) -> None:
    able: list[str] | None = None
    for name in file.values.get("actions", {}):
        spec = specs.get(name)
        if spec is None or spec.substitute is None:
            continue
        location = file.value_location("actions", name, "substitute")
        other = specs.get(spec.substitute)
        if other is None or not other.supported or other.substitute is not None or other.name == name:
            if able is None:
                able = [
                    each.name for each in specs.values() if each.supported and not each.substitute and not each.engine
                ]
            diagnostics.error(
                "unknown-action",
                location,
                f"`{spec.substitute}` is not an action of this robot{did_you_mean(spec.substitute, able)}",
            )
            continue
        missing = [p.name for p in other.parameters.values() if p.required and p.name not in spec.parameters]
        if missing:
            diagnostics.error(
                "missing-parameter", location, f"`{name}` has no `{missing[0]}`, which `{other.name}` cannot do without"
            )
        specs[name] = replace(spec, channels=other.channels)


class _Declaration:
    """One `[actions.NAME]` table on top of what is known of that action."""

    def __init__(
        self, table: TomlTable, before: ActionSpec | None, layer: DeclarationLayer, diagnostics: Diagnostics
    ) -> None:
        self.table = table
        self.before = before
        self.layer = layer
        self.diagnostics = diagnostics

    def spec(self) -> ActionSpec:
        before = self.before
        name = self.table.path[-1]
        base = before or ActionSpec(name, {})
        keys = (*_ACTION_KEYS, "engine") if self.layer == "core" else _ACTION_KEYS
        report_unknown_keys(self.table, keys, self.diagnostics)
        if base.engine:
            self.diagnostics.error(
                "wrong-type", self.table.key_location(), f"`{name}` runs in the engine and cannot be changed"
            )
            return base
        return replace(
            base,
            parameters=self.parameters(base),
            channels=self.texts("channels", base.channels),
            engine=bool(self.table.values.get("engine", False)),
            supported=True,
            substitute=self.of_type("substitute", str, None),
            seconds=self.positive("seconds", base.seconds) or base.seconds,
            limit=self.positive("limit", base.limit),
            carrier={**base.carrier, **(self.of_type("carrier", dict, None) or {})},
            help=self.of_type("help", str, base.help),
        )

    def parameters(self, base: ActionSpec) -> dict[str, Parameter]:
        result = dict(base.parameters)
        for name, values in (self.of_type("parameters", dict, None) or {}).items():
            table = TomlTable(self.table.file, (*self.table.path, "parameters", name), values)
            if not isinstance(values, dict):
                self.diagnostics.error(
                    "wrong-type", table.key_location(), f"a parameter is a table: {{ type = ... }} for `{name}`"
                )
            elif name in RESERVED or not _can_be_element_name(name):
                self.diagnostics.error("bad-name", table.key_location(), f"a parameter cannot be called `{name}`")
            else:
                parameter = _Declaration(table, None, self.layer, self.diagnostics).parameter(result.get(name))
                if parameter is not None:
                    result[name] = parameter
        value = result.get("value")
        more, without = self.texts("names", ()), self.texts("without", ())
        if (more or without) and (value is None or value.type != "name"):
            key = "names" if more else "without"
            self.diagnostics.error(
                "wrong-type", self.table.key_location(key), f"`{key}` needs a parameter `value` of the type `name`"
            )
        elif value is not None:
            left_out, known = frozenset(without), {*value.codes, *value.names}
            for index, name in enumerate(without):
                if name not in known:
                    self.diagnostics.error(
                        "unknown-name",
                        self.table.key_location("without", str(index)),
                        f"there is no name `{name}` to leave out{did_you_mean(name, (*value.codes, *value.names))}",
                    )
            result["value"] = replace(
                value,
                codes={name: code for name, code in value.codes.items() if name not in left_out},
                names=tuple(name for name in dict.fromkeys((*value.names, *more)) if name not in left_out),
            )
        return result

    def parameter(self, before: Parameter | None) -> Parameter | None:
        report_unknown_keys(self.table, _PARAMETER_KEYS, self.diagnostics)
        type_ = self.of_type("type", str, before.type if before else None)
        if type_ not in _TYPES:
            location = self.table.value_location("type") if "type" in self.table.values else self.table.key_location()
            self.diagnostics.error("wrong-type", location, f"`type` is one of {', '.join(_TYPES)}")
            return before
        base = before or Parameter(self.table.path[-1], "text")
        codes = self.of_type("codes", dict, None)
        if codes is not None and not all(_is_integer(code) for code in codes.values()):
            self.diagnostics.error(
                "wrong-type", self.table.key_location("codes"), "`codes` gives each name a whole number"
            )
            codes = None
        return Parameter(
            name=base.name,
            type=type_,
            unit=self.of_type("unit", str, base.unit),
            default=self.table.values.get("default", base.default),
            required=self.of_type("required", bool, base.required),
            minimum=self.number("minimum", base.minimum),
            maximum=self.number("maximum", base.maximum),
            codes=base.codes if codes is None else codes,
            names=self.texts("names", base.names),
            help=self.of_type("help", str, base.help),
        )

    def of_type(self, key: str, type_: type, otherwise: Any) -> Any:
        if key not in self.table.values:
            return otherwise
        value = self.table.values[key]
        if isinstance(value, type_):
            return value
        kind = {str: "a text", bool: "true or false", dict: "a table"}[type_]
        self.diagnostics.error("wrong-type", self.table.value_location(key), f"`{key}` is {kind}")
        return otherwise

    def texts(self, key: str, otherwise: tuple[str, ...]) -> tuple[str, ...]:
        if key not in self.table.values:
            return otherwise
        value = self.table.values[key]
        if isinstance(value, list) and all(isinstance(item, str) and item for item in value):
            return tuple(value)
        self.diagnostics.error(
            "wrong-type", self.table.value_location(key), f'`{key}` is a list of texts: ["...", "..."]'
        )
        return otherwise

    def number(self, key: str, otherwise: float | None) -> float | None:
        value = self.table.values.get(key, otherwise)
        if value is None or _is_number(value):
            return value
        self.diagnostics.error("wrong-type", self.table.value_location(key), f"`{key}` is a number")
        return otherwise

    def positive(self, key: str, otherwise: float | None) -> float | None:
        value = self.number(key, otherwise)
        if value is not None and not 0 < value <= MAX_SECONDS:
            message = f"`{key}` is a number of seconds above 0 and up to {MAX_SECONDS:.0f} (24 hours)"
            self.diagnostics.error("out-of-range", self.table.value_location(key), message)
            return otherwise
        return value


def report_unknown_keys(table: TomlTable, known: tuple[str, ...], diagnostics: Diagnostics) -> None:
    """A finding for each key of a table that nobody reads."""
    for key in table.values:
        if key not in known:
            diagnostics.error("unknown-key", table.key_location(key), f"unknown key `{key}`{did_you_mean(key, known)}")


def _can_be_element_name(name: str) -> bool:
    """Whether a name can be that of an element."""
    return name.isidentifier() and (name.isascii() or is_element_name(name))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
