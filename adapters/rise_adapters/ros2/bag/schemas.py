"""The text of a message type with all that it is made of, as bags carry it."""

from __future__ import annotations

from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, InterfaceCatalog

_SEPARATOR = "=" * 80


def message_schema(catalog: InterfaceCatalog, type: str) -> str:
    """The definition of a message of `rise_interfaces`, with its comments, and then those of the types that it needs.

    :param catalog: where definitions come from.
    :param type: `rise_interfaces/msg/Record`.
    :raises PortError: a type is not known.
    """
    parts = [(RISE_INTERFACES / "msg" / f"{type.rpartition('/')[2]}.msg").read_text("utf-8").strip()]
    for nested in _nested(catalog, type):
        fields = "\n".join(f"{_short(str(each.type))} {each.name}" for each in catalog.definition(nested).fields)
        parts.append(f"{_SEPARATOR}\nMSG: {_short(nested)}\n{fields}")
    return "\n".join(parts) + "\n"


def _nested(catalog: InterfaceCatalog, type: str) -> list[str]:
    """Every type that a type contains, each once, what is needed first first."""
    found: dict[str, None] = {}
    pending = [type]
    while pending:
        for field in catalog.definition(pending.pop(0)).fields:
            if field.type.is_nested and field.type.base not in found:
                found[field.type.base] = None
                pending.append(field.type.base)
    return list(found)


def _short(name: str) -> str:
    """As definitions name a type: `std_msgs/Header`."""
    return name.replace("/msg/", "/")
