"""ROS types without ROS: definitions, type hashes, and bytes."""

from rise_adapters.ros2.types.catalog import SHARE, Types
from rise_adapters.ros2.types.cdr import Codec
from rise_adapters.ros2.types.definitions import Definition, Field, FieldType

__all__ = ["SHARE", "Codec", "Definition", "Field", "FieldType", "Types"]
