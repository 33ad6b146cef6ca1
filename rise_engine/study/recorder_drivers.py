"""Finding the code behind a recorder, by the entry-point group `rise.recorders`; none is imported by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.ports.recorder import Recorder, RecorderError, RecorderOpener
from rise_engine.scenario.model import Json

RECORDERS = "rise.recorders"


def recorder_drivers() -> tuple[str, ...]:
    """What `by` can name here: the installed drivers, in order."""
    return tuple(sorted(installed_plugins(RECORDERS).names))


def open_recorder(driver: str, name: str, options: Mapping[str, Json]) -> Recorder:
    """The recorder of that driver, which has only looked at its options.

    :param driver: as `by` names it.
    :param name: what the recorder is called.
    :param options: as study.toml has them.
    :raises RecorderError: it is not installed, cannot be loaded, or finds fault with an option (a line for each).
    """
    entry = find_plugin(RECORDERS, driver)
    if entry is None:
        raise RecorderError(
            f"there is no recorder {driver!r} here; there are {', '.join(recorder_drivers()) or 'none'}"
        )
    try:
        opener = cast(RecorderOpener, entry.load())
    except Exception as error:  # code of others runs as it is imported
        raise RecorderError(f"the recorder {driver!r} ({entry.value}) cannot be loaded: {error}") from error
    return opener(name, options)
