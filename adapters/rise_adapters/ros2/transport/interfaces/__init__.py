"""ROS types without ROS: definitions, type hashes, and bytes."""

from rise_adapters.ros2.transport.interfaces.catalog import RISE_INTERFACES, SHARE_FOLDER, InterfaceCatalog
from rise_adapters.ros2.transport.interfaces.cdr import MessageCodec
from rise_adapters.ros2.transport.interfaces.definitions import InterfaceDefinition, InterfaceField, InterfaceFieldType

__all__ = [
    "RISE_INTERFACES",
    "SHARE_FOLDER",
    "InterfaceCatalog",
    "InterfaceDefinition",
    "InterfaceField",
    "InterfaceFieldType",
    "MessageCodec",
]
