"""The vendors of DDS software, by the numbers with which the id of every endpoint begins
(https://www.dds-foundation.org/dds-rtps-vendor-and-product-ids/).

Topics work between vendors. Services, and with them actions, do not work between Cyclone DDS and others: Cyclone writes
the client of a request into the message, others send it beside the message. Two such programs see each other and report
no error, but understand no request.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

CYCLONE, FAST, CONNEXT = "0110", "010f", "0101"

_VENDORS = {
    CYCLONE: ("Cyclone DDS", "rmw_cyclonedds_cpp"),
    FAST: ("eProsima Fast DDS", "rmw_fastrtps_cpp"),
    CONNEXT: ("RTI Connext DDS", "rmw_connextdds"),
    "0103": ("OpenSplice", ""),
    "0112": ("RustDDS", ""),
    "0114": ("GurumDDS", "rmw_gurumdds_cpp"),
}
_OTHER_RMW = {"rmw_fastrtps_dynamic_cpp": FAST}

Crossing: TypeAlias = Literal["yes", "no", "unknown"]


def vendor_name(vendor: str) -> str:
    """A vendor for a person: `eProsima Fast DDS (rmw_fastrtps_cpp)`."""
    if vendor not in _VENDORS:
        return f"DDS software of another vendor (number {vendor})"
    name, rmw = _VENDORS[vendor]
    return f"{name} ({rmw})" if rmw else name


def rmw_of_vendor(vendor: str) -> str:
    """The vendor's RMW_IMPLEMENTATION; empty: unknown."""
    return _VENDORS.get(vendor, ("", ""))[1]


def vendor_of_rmw(identifier: str) -> str:
    """The vendor of an RMW_IMPLEMENTATION; empty: none (Zenoh is not DDS)."""
    known = {rmw: vendor for vendor, (_, rmw) in _VENDORS.items() if rmw} | _OTHER_RMW
    return known.get(identifier, "")


def services_cross(one: str, other: str) -> Crossing:
    """Whether a service of one vendor works with another's software."""
    if not one or not other or one == other:
        return "yes"
    if CYCLONE in (one, other) and CONNEXT not in (one, other):  # Connext can be set to write like Cyclone
        return "no"
    return "unknown"
