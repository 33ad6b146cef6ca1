"""Whose software carries ROS 2: middleware by the numbers that DDS gives its vendors, with which the id of every
endpoint begins (https://www.dds-foundation.org/dds-rtps-vendor-and-product-ids/).

Messages on topics cross from one vendor's software to another's. Services, and with them actions, do not cross between
Cyclone DDS and others: it writes whose request it is into the message, others into what goes with the message. Two
programs then see each other, each believes that all is well, and no request is ever understood.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

CYCLONE, FAST, CONNEXT = "0110", "010f", "0101"

_KNOWN = {
    CYCLONE: ("Cyclone DDS", "rmw_cyclonedds_cpp"),
    FAST: ("eProsima Fast DDS", "rmw_fastrtps_cpp"),
    CONNEXT: ("RTI Connext DDS", "rmw_connextdds"),
    "0103": ("OpenSplice", ""),
    "0112": ("RustDDS", ""),
    "0114": ("GurumDDS", "rmw_gurumdds_cpp"),
}
_MORE = {"rmw_fastrtps_dynamic_cpp": FAST}

Crossing: TypeAlias = Literal["yes", "no", "unknown"]


def vendor_name(vendor: str) -> str:
    """For a person: `eProsima Fast DDS (rmw_fastrtps_cpp)`."""
    if vendor not in _KNOWN:
        return f"DDS software of another vendor (number {vendor})"
    name, rmw = _KNOWN[vendor]
    return f"{name} ({rmw})" if rmw else name


def rmw_of_vendor(vendor: str) -> str:
    """What RMW_IMPLEMENTATION is for it; empty when that is not known."""
    return _KNOWN.get(vendor, ("", ""))[1]


def vendor_of_rmw(identifier: str) -> str:
    """The vendor of an RMW_IMPLEMENTATION; empty when it is not one of these (Zenoh is no DDS)."""
    known = {rmw: vendor for vendor, (_, rmw) in _KNOWN.items() if rmw} | _MORE
    return known.get(identifier, "")


def services_cross(one: str, other: str) -> Crossing:
    """Whether a service of one vendor can be used over another's software."""
    if not one or not other or one == other:
        return "yes"
    if CYCLONE in (one, other) and CONNEXT not in (one, other):  # Connext can be told to write as Cyclone does
        return "no"
    return "unknown"
