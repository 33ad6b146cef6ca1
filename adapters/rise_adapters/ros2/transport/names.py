"""Resolves written names of topics, services and actions into those on the wire
(https://design.ros2.org/articles/topic_and_service_names.html)."""

from __future__ import annotations

import re
from collections.abc import Iterable

from rise_adapters.ros2.transport.port import PortError

_TOKEN = r"[A-Za-z_][A-Za-z0-9_]*"
_NAME = re.compile(rf"(?:~|/?{_TOKEN})(?:/{_TOKEN})*")
_NODE = re.compile(_TOKEN)


def is_ros_name(name: object) -> bool:
    """Whether this is a valid name of an action, a topic or a service, relative or not."""
    return isinstance(name, str) and name != "~" and _NAME.fullmatch(name) is not None and "__" not in name


def check_node(name: str) -> str:
    """Check the name of a node. Raises PortError."""
    if not _NODE.fullmatch(name):
        raise PortError(
            f"{name!r} cannot be the name of a node: letters, digits and _ only, and no digit at the beginning"
        )
    return name


def check_namespace(name: str) -> str:
    """A namespace with a leading slash and without a final one (except `/` itself). Raises PortError."""
    full = "/" + name.strip("/")
    if full != "/" and not _NAME.fullmatch(full):
        raise PortError(f"{name!r} cannot be a namespace: it is made of names with / between them")
    return full


class NameResolver:
    """Resolves names for one node: `~` and relative names first, then the first matching remapping."""

    def __init__(self, node: str, namespace: str, remaps: Iterable[tuple[str, str]]) -> None:
        """`node` without its namespace; `remaps`: pairs of source and target; the first match counts. Raises
        PortError."""
        self.namespace = check_namespace(namespace)
        self.node = self._join(self.namespace, check_node(node))
        self._remaps: dict[str, str] = {}
        for source, target in remaps:
            self._remaps.setdefault(self._make_absolute(source), self._make_absolute(target))

    def resolve(self, name: str) -> str:
        """The full name. Raises PortError for an invalid name."""
        full = self._make_absolute(name)
        return self._remaps.get(full, full)

    def _make_absolute(self, name: str) -> str:
        if not _NAME.fullmatch(name):
            raise PortError(
                f"{name!r} cannot be a name in ROS: one is made of letters, digits and _, with single / between parts"
            )
        if name.startswith("~"):
            return self.node + name[1:]
        return name if name.startswith("/") else self._join(self.namespace, name)

    @staticmethod
    def _join(namespace: str, name: str) -> str:
        return f"/{name}" if namespace == "/" else f"{namespace}/{name}"
