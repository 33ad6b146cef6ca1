"""Reads and checks a profile's statements about ROS: its options, and the mapping of each action."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from typing import Any

from msgspec.structs import replace

from rise_adapters.ros2.mapping.action_mapping import ActionMapping, RosOptions
from rise_adapters.ros2.mapping.action_reader import ActionReader
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.field_types import FieldTypes, ReadFields
from rise_adapters.ros2.mapping.options import parse_options
from rise_adapters.ros2.transport.port import PortError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.ports.bridge import ProfileFinding
from rise_engine.scenario.model import ActionSpec, RobotProfile

_STANDARD = "rise/robot"
"""The prefix of the names in the profile `rise`."""


def read_options(profile: RobotProfile) -> RosOptions:
    """Read the profile's `[options]`. Raises PortError."""
    mistakes = ProfileMistakes(profile.name)
    options = parse_options(profile, mistakes)
    if mistakes.refusals:
        raise PortError(*(each.sentence for each in mistakes.refusals))
    return options


def read_mappings(
    profile: RobotProfile, fields: ReadFields | None = None, *, actions: Collection[str] | None = None
) -> dict[str, ActionMapping]:
    """Read the mapping of every action that the robot itself carries out, by name.

    `fields` is `Transport.fields`; without it, types are not checked, but everything else is. `actions`: only these
    actions. Raises PortError with all errors.
    """
    mappings, mistakes = _read(profile, fields, actions)
    if mistakes.refusals:
        raise PortError(*(each.sentence for each in mistakes.refusals))
    return mappings


def mapping_findings(profile: RobotProfile, fields: ReadFields | None = None) -> list[ProfileFinding]:
    """All diagnostics about a profile's statements on ROS."""
    return _read(profile, fields, None)[1].found


def mapping_problems(profile: RobotProfile, fields: ReadFields | None = None) -> list[str]:
    """The reasons that prevent a session, in sentences; empty: the profile can be used."""
    return [each.sentence for each in _read(profile, fields, None)[1].refusals]


def _read(
    profile: RobotProfile, fields: ReadFields | None, actions: Collection[str] | None
) -> tuple[dict[str, ActionMapping], ProfileMistakes]:
    mistakes = ProfileMistakes(profile.name)
    types = FieldTypes(fields)
    options = parse_options(profile, mistakes, types)
    mappings: dict[str, ActionMapping] = {}
    for name, spec in profile.actions.items():
        if not _is_done_by_itself(spec) or (actions is not None and name not in actions):
            continue
        mapping = ActionReader(_write_out_carrier(spec, options), options, types, mistakes, profile.places).read()
        if mapping is not None:
            mappings[name] = mapping
            _check_shared(name, mappings, profile.actions, mistakes)
    _check_places(profile, mistakes)
    return mappings, mistakes


def with_all_carriers(profile: RobotProfile) -> RobotProfile:
    """Return the profile with a carrier in every action, including those from `options.wrapper` and `options.error`."""
    options = parse_options(profile, ProfileMistakes(profile.name))
    return replace(profile, actions={name: _write_out_carrier(spec, options) for name, spec in profile.actions.items()})


def _check_places(profile: RobotProfile, mistakes: ProfileMistakes) -> None:
    """Report the keys of places that no carrier uses, if any carrier uses places: they may be typing errors."""
    taken = mistakes.place_keys
    for name, place in profile.places.items() if taken else ():
        for key in place:
            if key not in taken:
                mistakes.add(f"places.{name}.{key}", f"is used by no carrier{did_you_mean(key, taken)}", "doubtful")


def _check_shared(
    name: str, mappings: Mapping[str, ActionMapping], specs: Mapping[str, ActionSpec], mistakes: ProfileMistakes
) -> None:
    """Check that actions with the same route request the same quality of service and the same reset. They share a
    subscription or publisher, and only the last message on a topic is taken back. `name`: the last action."""
    mapping = mappings[name]
    for other, before in mappings.items():
        if other == name or before.route != mapping.route:
            continue
        qos = [(each.topic_qos, each.feedback_qos, each.status_qos) for each in (before, mapping)]
        resets = [specs[each].carrier.get("reset") for each in (other, name)]
        for key, (theirs, own) in (("qos", qos), ("reset", resets)):
            if theirs != own:
                where = f"actions.{name}.carrier.{key}"
                mistakes.add(
                    where, f"differs from that of {other}, which goes to {mapping.name} too; give both the same"
                )
        return


@cache
def _standard_carriers() -> Mapping[str, Mapping[str, Any]]:
    """The carriers of the profile `rise`, which a wrapper in RISE's style offers under its own name."""
    profile = tomllib.loads(resources.files("rise_adapters.robots").joinpath("rise.toml").read_text("utf-8"))
    return {name: table["carrier"] for name, table in profile["actions"].items()}


def _write_out_carrier(spec: ActionSpec, options: RosOptions) -> ActionSpec:
    """Return the action with its carrier, perhaps from its wrapper; unchanged without one."""
    carrier = spec.carrier
    standard = _standard_carriers().get(spec.name)
    if not carrier and options.wrapper and standard is not None and _is_done_by_itself(spec):
        carrier = {**standard, "action": standard["action"].replace(_STANDARD, options.wrapper, 1)}
    if carrier.keys() & {"action", "service"} and "error" not in carrier and options.error:
        carrier = {**carrier, "error": options.error}
    return replace(spec, carrier=carrier)


def _is_done_by_itself(spec: ActionSpec) -> bool:
    return spec.supported and not spec.engine and spec.substitute is None
