"""Reads a WoZ4U configuration: one YAML file with lists of items, each a button (https://github.com/frietz58/WoZ4U)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec import Struct

from rise_engine.base.errors import ExchangeError
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation

SECTIONS: dict[str, tuple[str, ...]] = {
    "animated_speech": ("string",),
    "gestures": ("gesture",),
    "tablet_items": ("file_name",),
    "audio_files": ("location",),
    "colors": ("red", "green", "blue"),
}
"""The lists that become acts, and the required keys of their items besides `title`."""
EYE_MOVEMENTS = {"rasta_anim": "rasta", "random_anim": "random", "rotate_anim": "rotate"}
_NUMBERS = frozenset({"red", "green", "blue"})
MAX_CHARACTERS = 300_000
"""The most characters of a configuration, enough for thousands of buttons."""
_MAX_DEPTH = 20


class WozItem(Struct, frozen=True):
    """A button of WoZ4U."""

    section: str
    title: str
    values: dict[str, Any]
    keys: tuple[str, ...]
    """The keys that are pressed together for it: `("ctrl", "1")`; empty: none."""
    is_default: bool
    """Whether it is shown when WoZ4U connects to the robot."""
    line: int


class WozFile(Struct, frozen=True):
    """The parts of a configuration that make up a study."""

    items: tuple[WozItem, ...]
    rate: float
    """The speed of the voice; 1 is normal."""
    volume: float
    tablet_folder: str
    left_out: tuple[str, ...]
    """Top-level keys about the robot or about WoZ4U itself."""


def read_woz4u(text: str, name: str, diagnostics: Diagnostics) -> WozFile:
    """Read a configuration. Mistakes in an item become diagnostics at its line.

    :param text: the YAML.
    :param name: the file's name, for diagnostics.
    :raises ExchangeError: it is not YAML, has none of WoZ4U's lists, or `ruamel.yaml` is not installed.
    """
    values = _read_yaml(text, name)
    if not isinstance(values, dict) or not {*SECTIONS, *EYE_MOVEMENTS} & values.keys():
        listed = ", ".join(SECTIONS)
        raise ExchangeError(f"{name} is no configuration of WoZ4U: it has none of the lists {listed}")
    reader = _ConfigurationReader(name, diagnostics)
    items = [item for section in SECTIONS for item in reader.items(section, values)]
    items += reader.eye_movements(values)
    known = {*SECTIONS, *EYE_MOVEMENTS, "volume", "voice_speed", "tablet_root_location"}
    return WozFile(
        tuple(items),
        reader.number(values, "voice_speed", 100.0, 50.0, 400.0) / 100,
        reader.number(values, "volume", 1.0, 0.0, 1.0),
        str(values.get("tablet_root_location") or ""),
        tuple(str(key) for key in values if key not in known),
    )


def _read_yaml(text: str, name: str) -> Any:
    try:
        from ruamel.yaml import YAML  # in the extra `tables`
        from ruamel.yaml.error import YAMLError
        from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent
        from ruamel.yaml.parser import RoundTripParser
    except ImportError:
        raise ExchangeError('YAML needs ruamel.yaml: pip install "rise-tui[tables]"') from None
    if len(text) > MAX_CHARACTERS:
        raise ExchangeError(f"{name} is longer than {MAX_CHARACTERS:,} characters; make two files of it")

    class ShallowParser(RoundTripParser):
        """Stops at values nested deeper than in any configuration: reading time grows with the square of the depth."""

        depth = 0

        def get_event(self) -> Any:
            event = super().get_event()
            self.depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            if self.depth > _MAX_DEPTH or isinstance(event, AliasEvent):
                where = f"{name}:{event.start_mark.line + 1}:{event.start_mark.column + 1}"
                if isinstance(event, AliasEvent):
                    raise ExchangeError(f"{where}: `*` means a value from elsewhere; write the value itself here")
                raise ExchangeError(f"{where}: values are nested more than {_MAX_DEPTH} deep, as in no configuration")
            return event

    try:
        yaml = YAML(typ="rt", pure=True)
        yaml.Parser = ShallowParser
        return yaml.load(text)
    except ExchangeError:
        raise
    except (YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f":{mark.line + 1}:{mark.column + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "values are nested too deeply, or one is none that there is"
        raise ExchangeError(f"{name}{where}: this is not YAML: {problem}") from None


class _ConfigurationReader:
    def __init__(self, name: str, diagnostics: Diagnostics) -> None:
        self.name = name
        self.diagnostics = diagnostics

    def report(self, line: int, message: str) -> None:
        self.diagnostics.error("woz4u", SourceLocation(self.name, line), message)

    def items(self, section: str, values: Any) -> Iterator[WozItem]:
        """The items of a list; reports each entry that is not an item."""
        listed = values.get(section)
        if listed is None:
            return
        if not isinstance(listed, list):
            self.report(_line_of_key(values, section), f"`{section}` is a list of items")
            return
        for number, item in enumerate(listed):
            line = values[section].lc.item(number)[0] + 1
            if not isinstance(item, dict):
                self.report(line, f"an item of `{section}` has a `title` and more, each on its line")
                continue
            missing = [key for key in ("title", *SECTIONS[section]) if not _is_given(item.get(key))]
            if missing:
                self.report(line, f"this item of `{section}` has no {' and no '.join(f'`{key}`' for key in missing)}")
                continue
            wrong = [key for key in _NUMBERS & {*SECTIONS[section]} if not _is_share(item[key])]
            if wrong:
                self.report(_line_of_key(item, wrong[0]), f"`{wrong[0]}` is a number from 0 to 1")
                continue
            is_default = bool(item.get("is_default") or item.get("is_default_img"))
            yield WozItem(section, str(item["title"]).strip(), dict(item), self.keys(item, line), is_default, line)

    def eye_movements(self, values: dict[str, Any]) -> Iterator[WozItem]:
        for key, movement in EYE_MOVEMENTS.items():
            item = values.get(key)
            if item is None:
                continue
            line = _line_of_key(values, key)
            if not isinstance(item, dict) or not isinstance(item.get("duration", 1), int | float):
                self.report(line, f"`{key}` has a `duration`, in seconds")
                continue
            given = {"movement": movement, "duration": item.get("duration", 1)}
            yield WozItem("eyes", f"Eyes {movement}", given, self.keys(item, line), False, line)

    def keys(self, item: dict[str, Any], line: int) -> tuple[str, ...]:
        """The keys of an item, which may be a single one, and numbers."""
        keys = item.get("key_comb") or []
        keys = keys if isinstance(keys, list) else [keys]
        if all(isinstance(key, str | int) for key in keys):
            return tuple(str(key) for key in keys)
        self.report(line, "`key_comb` is a list of keys")
        return ()

    def number(self, values: dict[str, Any], key: str, usual: float, least: float, most: float) -> float:
        value = values.get(key, usual)
        if isinstance(value, int | float) and not isinstance(value, bool) and least <= value <= most:
            return float(value)
        self.report(_line_of_key(values, key), f"`{key}` is a number from {least:g} to {most:g}")
        return usual


def _line_of_key(values: Any, key: str) -> int:
    line: int = values.lc.key(key)[0]
    return line + 1


def _is_given(value: Any) -> bool:
    return value is not None and str(value).strip() != ""


def _is_share(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value <= 1
