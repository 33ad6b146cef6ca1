"""A stream of the Lab Streaming Layer, by pylsl (extra `lsl`)."""

from __future__ import annotations

import configparser
import os
import socket
import sys
import time
from asyncio import Event
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from rise_engine.base.errors import AdapterError
from rise_engine.ports.outlet import OutletPlan
from rise_engine.run.recording.marker_feed import MarkerFeed, MarkerStream

CONFIG_PLACES = ("lsl_api.cfg", "~/lsl_api/lsl_api.cfg", "/etc/lsl_api/lsl_api.cfg")
"""The places of a lab's settings for the library, after the variable `LSLAPICFG`
(https://labstreaminglayer.readthedocs.io/info/lslapicfg.html)."""
KEPT_SECTIONS = ("lab", "ports", "tuning")
"""The lab's sections that stay. With another session id, the lab's programs would not see the stream."""
CLOCK_READINGS = 20
"""Number of comparisons of the two clocks. The fastest one counts."""


async def send_markers(plan: OutletPlan, finish: Event) -> None:
    """Send a session's markers (`rise_engine.ports.outlet.OutletRunner`).

    Call it once in a process, because the library reads its settings only once. Raises AdapterError, and EngineGone if
    there is no such session, or its engine goes without an end.
    """
    pylsl = _load_library()

    def open_stream(stream: MarkerStream) -> LslOutlet:
        try:
            pylsl.set_config_content(library_settings(plan.scope))
            return LslOutlet(pylsl, stream, only_here=plan.scope == "machine")
        except (AttributeError, RuntimeError, OSError, ValueError) as error:  # an old library lacks this setting
            raise AdapterError(f"the Lab Streaming Layer does not start: {error}") from error

    await MarkerFeed(plan, open_stream).run(finish)


class LslOutlet:
    """One outlet of one string channel without a rate, the usual form for markers
    (`rise_engine.run.recording.marker_feed.MarkerOutlet`)."""

    def __init__(self, pylsl: Any, stream: MarkerStream, *, only_here: bool) -> None:
        """`only_here`: accept connections only from this computer, if the system supports this."""
        info = pylsl.StreamInfo(
            stream.name, stream.type, 1, pylsl.IRREGULAR_RATE, pylsl.cf_string, source_id=stream.source_id
        )
        for name, value in stream.description.items():
            info.desc().append_child_value(name, value)
        self._offset = clock_offset(pylsl.local_clock)
        self._outlet = pylsl.StreamOutlet(info)
        self.is_bound = only_here and bind_to_loopback()
        """Whether other computers cannot connect, even if they know the port."""

    def send(self, text: str, at: float) -> None:
        self._outlet.push_sample([text], at + self._offset)

    def has_consumers(self) -> bool:
        return bool(self._outlet.have_consumers())

    def close(self) -> None:
        del self._outlet  # pylsl closes a stream this way


def library_settings(scope: str) -> str:
    """The library's settings for a stream of that scope: the lab's own, except for the stream's visibility."""
    settings = configparser.ConfigParser(strict=False, interpolation=None)
    settings.optionxform = str  # type: ignore[assignment,method-assign]  # its names have capitals
    places = [os.environ.get("LSLAPICFG", ""), *CONFIG_PLACES]
    found = next((path for place in places if place and (path := Path(place).expanduser()).is_file()), None)
    if found is not None:
        with suppress(OSError, ValueError, configparser.Error):
            settings.read_string(found.read_text("utf-8"))
    for section in settings.sections():
        if section not in KEPT_SECTIONS:
            settings.remove_section(section)
    ours: dict[str, dict[str, str]] = {"multicast": {"ResolveScope": scope}, "log": {"level": "-1"}}
    if scope == "machine":  # otherwise it also listens on every network
        ours["ports"] = {"IPv6": "disable"}
    for section, values in ours.items():
        if not settings.has_section(section):
            settings.add_section(section)
        for name, value in values.items():
            settings.set(section, name, value)
    lines = [
        line
        for section in settings.sections()
        for line in (f"[{section}]", *(f"{name} = {value}" for name, value in settings.items(section)))
    ]
    return "\n".join(lines) + "\n"


def clock_offset(local_clock: Any) -> float:
    """Seconds from this computer's monotonic clock to the library's. On Linux they are the same clock: 0."""
    looks = []
    for _ in range(CLOCK_READINGS):
        before = time.monotonic()
        theirs = local_clock()
        looks.append((time.monotonic() - before, before, theirs))
    width, before, theirs = min(looks)
    offset: float = theirs - before
    return 0.0 if 0.0 <= offset <= width else offset - width / 2


def bind_to_loopback() -> bool:
    """Restrict this process's open ports to the loopback. False if the system cannot.

    The library's scope `machine` limits only the announcement of a stream; its ports are open to every network.
    """
    if not sys.platform.startswith("linux"):
        return False
    found = False
    for descriptor in Path("/proc/self/fd").iterdir():
        with suppress(OSError, ValueError):  # not a socket, or closed meanwhile
            opened = socket.socket(fileno=int(descriptor.name))
            try:
                if opened.family in (socket.AF_INET, socket.AF_INET6):
                    opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo\0")
                    found = True
            finally:
                opened.detach()  # the library owns it, and it stays open
    return found


def _load_library() -> ModuleType:
    try:
        pylsl = import_module("pylsl")  # an extra; the import loads its library
    except ImportError:
        raise AdapterError('markers for the Lab Streaming Layer need pylsl: pip install "rise-tui[lsl]"') from None
    except (RuntimeError, OSError) as error:
        raise AdapterError(
            "pylsl is installed without its library, as on Linux for ARM: install liblsl "
            f"(https://github.com/sccn/liblsl/releases) and set PYLSL_LIB to its path ({error})"
        ) from None
    return pylsl
