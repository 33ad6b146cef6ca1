"""The ROS types that are known here, without a ROS installation.

A definition is searched in this order: the user's folders; the sourced ROS workspaces (`AMENT_PREFIX_PATH`); the
definitions of this program (`share/`: RISE's own, and the field layouts of robot skills); and the standard packages of
ROS 2 Jazzy, from the library `rosbags`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import rise_adapters.ros2
from rise_adapters.ros2.transport.interfaces import definitions
from rise_adapters.ros2.transport.interfaces.cdr import MessageCodec
from rise_adapters.ros2.transport.interfaces.definitions import (
    InterfaceDefinition,
    InterfaceField,
    InterfaceFieldType,
    file_stems,
    read_definitions,
    split_name,
)
from rise_adapters.ros2.transport.port import PortError
from rise_engine.base.nearest_name import nearest_name

SHARE_FOLDER = Path(rise_adapters.ros2.__file__).parent / "share"
"""The folder of other packages' definitions that come with this program."""
RISE_INTERFACES = next(
    folder
    for folder in (SHARE_FOLDER / "rise_interfaces", Path(rise_adapters.ros2.__file__).parents[2] / "rise_interfaces")
    if folder.is_dir()
)
"""RISE's own package, which colcon builds: in a checkout at its own place, in a wheel beside the others."""
_KINDS = ("msg", "srv", "action")
_STANDARD_ORIGIN = "the standard definitions of ROS 2 Jazzy"


class InterfaceCatalog:
    """Definitions by name, read at their first use, and everything derived from them."""

    def __init__(self, share: Sequence[str | Path] = (), environment: Mapping[str, str] = os.environ) -> None:
        """`share`: folders `.../share` that contain `PACKAGE/{msg,srv,action}`, or folders of single packages. Raises
        PortError if one does not exist."""
        own = [Path(folder).expanduser() for folder in share]
        for folder in own:
            if not folder.is_dir():
                raise PortError(f"the folder of ROS definitions {str(folder)!r} does not exist")
        sourced = [
            Path(prefix, "share") for prefix in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix
        ]
        self.folders: tuple[Path, ...] = (
            *own,
            *(folder for folder in sourced if folder.is_dir()),
            SHARE_FOLDER,
            RISE_INTERFACES,
        )
        """The folders that are searched before the standard definitions."""
        self._definitions: dict[str, InterfaceDefinition] = {}
        self._hashes: dict[str, str] = {}
        self._codecs: dict[str, MessageCodec] = {}

    def definition(self, type: str) -> InterfaceDefinition:
        """The definition of a type. Raises PortError: unknown (with the nearest known name), or an invalid file."""
        known = self._definitions.get(type)
        if known is None:
            self._load(type)
            known = self._definitions.get(type)
        if known is None:
            raise PortError(self._describe_unknown(type))
        return known

    def message_definition(self, type: str) -> InterfaceDefinition:
        """The definition of a message type. Raises PortError, also for a whole service or action."""
        definition = self.definition(type)
        if definition.is_whole:
            first, others = ("Goal", "_Result and _Feedback") if "/action/" in type else ("Request", "_Response")
            raise PortError(f"{type} is not a message; its messages are {type}_{first}, and the same with {others}")
        return definition

    def fields(self, type: str) -> dict[str, str]:
        """As `port.Transport.fields`. This also loads all nested types."""
        definition = self.message_definition(type)
        self._check_fields(definition, definition, (), ())
        return {field.name: str(field.type) for field in definition.fields}

    def type_hash(self, type: str) -> str:
        """As `port.Transport.type_hash`. Raises PortError if the type or a nested one is unknown."""
        if type not in self._hashes:
            self._hashes[type] = definitions.type_hash(type, self.definition)
        return self._hashes[type]

    def codec(self, type: str) -> MessageCodec:
        """The codec between a message and its bytes. Raises PortError like `fields`, and for unsupported types."""
        if type not in self._codecs:
            self.fields(type)
            self._codecs[type] = MessageCodec(type, self.message_definition)
        return self._codecs[type]

    def known_names(self) -> set[str]:
        """All messages, services and actions that have a file (or are standard), without the types that they imply."""
        found = {name for name in _standard_definitions() if "/msg/" in name}
        for folder in self.folders:
            for package in (folder, *sorted(folder.iterdir())):
                for kind in _KINDS:
                    found.update(f"{package.name}/{kind}/{path.stem}" for path in (package / kind).glob(f"*.{kind}"))
        return found

    def _load(self, type: str) -> None:
        package, kind, name = split_name(type)
        for path in self._candidate_files(package, kind, name):
            try:
                text = path.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise PortError(f"{path} cannot be read: {error}") from None
            found = read_definitions(package, kind, path.stem, text, str(path))
            if type in found:
                self._definitions.update(found)
                return
        if type in _standard_definitions():
            self._definitions[type] = _standard_definitions()[type]

    def _candidate_files(self, package: str, kind: str, name: str) -> Iterator[Path]:
        for folder in self._package_folders(package):
            for stem in file_stems(kind, name):
                path = folder / kind / f"{stem}.{kind}"
                if path.is_file():
                    yield path

    def _package_folders(self, package: str) -> Iterator[Path]:
        for folder in self.folders:
            yield from (path for path in (folder / package, folder) if path.name == package and path.is_dir())

    def _check_fields(
        self, whole: InterfaceDefinition, part: InterfaceDefinition, within: tuple[str, ...], path: tuple[str, ...]
    ) -> None:
        """Check the fields of a type. Raises PortError: a nested type is unknown, a type contains itself, or `cdr` does
        not support a field. `within`: the types that contain `part`; `path`: the fields of `whole` on the way to it."""
        if part.name in within:
            raise PortError(f"{part.origin}: {part.name} contains itself, by way of {' in '.join(within)}")
        for field in part.fields:
            here = (*path, field.name)
            if field.type.base == "wstring":
                raise PortError(
                    f"{part.origin}: the field {'.'.join(here)} of {whole.name} is a wstring (a text of wide letters), "
                    "which the transport `dds` cannot carry; make it a string, or use --ros rclpy"
                )
            if field.type.is_nested:
                try:
                    nested = self.definition(field.type.base)
                except PortError as missing:
                    raise PortError(f"{part.origin}: the field {field.name!r}: {missing}") from None
                self._check_fields(whole, nested, (*within, part.name), here)

    def _describe_unknown(self, type: str) -> str:
        package, kind, name = split_name(type)
        names = self.known_names()
        if not any(known.startswith(f"{package}/") for known in names):
            packages = {known.split("/")[0] for known in names}
            near = nearest_name(package, packages)
            hint = f" (did you mean {near}?)" if near else ""
            return (
                f"the type {type} is not known: there are no definitions of the package {package}{hint}. Source the "
                "ROS workspace that has it, or name the folder of its definitions (share)"
            )
        *_, stem = file_stems(kind, name)
        near = nearest_name(f"{package}/{kind}/{stem}", names)
        hint = f". Did you mean {near}?" if near else ""
        where = next(map(str, self._package_folders(package)), _STANDARD_ORIGIN)
        return f"the type {type} is not known: there is no {kind}/{stem}.{kind} in {where}{hint}"


@cache
def _standard_definitions() -> dict[str, InterfaceDefinition]:
    """Jazzy's standard messages; none if `rosbags` is not installed."""
    try:
        from rosbags.typesys.stores import ros2_jazzy  # may be missing, and takes 80 ms
    except ImportError:
        return {}
    return {
        name: _convert_definition(name, fields) for name, (_, fields) in ros2_jazzy.FIELDDEFS.items() if "/msg/" in name
    }


def _convert_definition(name: str, fields: Any) -> InterfaceDefinition:
    return InterfaceDefinition(
        name,
        tuple(
            InterfaceField(field, _convert_field_type(*type))
            for field, type in fields
            if field != definitions.PLACEHOLDER_FIELD
        ),
        _STANDARD_ORIGIN,
    )


def _convert_field_type(node: int, content: Any) -> InterfaceFieldType:
    base, named, array = 1, 2, 3
    if node == base:
        primitive, length = content
        return InterfaceFieldType("uint8" if primitive == "char" else primitive, length)
    if node == named:
        return InterfaceFieldType(content)
    inner, count = content
    element = _convert_field_type(*inner)
    many = "array" if node == array else "bounded" if count else "sequence"
    return InterfaceFieldType(element.base, element.length, many, count)
