"""Finding the code behind an outlet (`rise_engine.ports.outlet`), by the entry-point group `rise.outlets`."""

from __future__ import annotations

from rise_engine.base.errors import AdapterError
from rise_engine.base.plugins import find_plugin
from rise_engine.ports.outlet import OutletRunner

OUTLETS = "rise.outlets"


def find_outlet(name: str) -> OutletRunner:
    """The outlet of that name. Raises AdapterError when it is not installed or cannot be loaded."""
    entry = find_plugin(OUTLETS, name)
    if entry is None:
        raise AdapterError(f"there is no outlet {name!r}: no entry point of that name in the group {OUTLETS!r}")
    try:
        runner: OutletRunner = entry.load()
    except Exception as error:  # code of others runs as it is imported
        raise AdapterError(f"the outlet {name!r} ({entry.value}) cannot be loaded: {error}") from error
    return runner
