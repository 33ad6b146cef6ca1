"""Reads a WoZ4U configuration: one YAML file with lists of items, each a button (https://github.com/frietz58/WoZ4U).

Pepper's texts, in NAOqi's annotated form, become actions of an act:

    Hello! ^start(animations/Stand/Gestures/Hey_1) I am here. ^wait(animations/Stand/Gestures/Hey_1) \\rspd=50\\ Slowly.

The notation: http://doc.aldebaran.com/2-5/naoqi/audio/alanimatedspeech.html and, for the backslashes, the page of
ALTextToSpeech beside it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from html import unescape
from typing import Any

from msgspec import Struct

from rise_engine.base.errors import ExchangeError
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Parameter, SourceLocation
from rise_engine.scenario.parameters import listed_names

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
"""Maximum number of characters of a configuration, enough for thousands of buttons."""
_MAX_DEPTH = 20


class WozItem(Struct, frozen=True):
    """A button of WoZ4U."""

    section: str
    title: str
    values: dict[str, Any]
    keys: tuple[str, ...]
    """Its keys, which are pressed together: `("ctrl", "1")`; empty: none."""
    is_default: bool
    """Whether it is shown when WoZ4U connects to the robot."""
    line: int


class WozFile(Struct, frozen=True):
    """The parts of a configuration for a study."""

    items: tuple[WozItem, ...]
    rate: float
    """The speed of the voice; 1 is normal."""
    volume: float
    tablet_folder: str
    omitted: tuple[str, ...]
    """Top-level keys about the robot or about WoZ4U itself."""


def read_woz4u(text: str, name: str, diagnostics: Diagnostics) -> WozFile:
    """Read a configuration. Errors in an item become diagnostics at its line.

    :param text: the YAML.
    :param name: the file's name, for diagnostics.
    :raises ExchangeError: it is not YAML, has none of WoZ4U's lists, or `ruamel.yaml` is not installed.
    """
    values = _read_yaml(text, name)
    if not isinstance(values, dict) or not {*SECTIONS, *EYE_MOVEMENTS} & values.keys():
        listed = ", ".join(SECTIONS)
        raise ExchangeError(f"{name} is not a configuration of WoZ4U: it has none of the lists {listed}")
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
        """Stops at values that are nested too deeply, because reading time grows with the square of the depth."""

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
        problem = getattr(error, "problem", None) or "values are nested too deeply, or one is not valid"
        raise ExchangeError(f"{name}{where}: this is not YAML: {problem}") from None


class _ConfigurationReader:
    def __init__(self, name: str, diagnostics: Diagnostics) -> None:
        self.name = name
        self.diagnostics = diagnostics

    def report(self, line: int, message: str) -> None:
        self.diagnostics.error("woz4u", SourceLocation(self.name, line), message)

    def items(self, section: str, values: Any) -> Iterator[WozItem]:
        """Yield the items of a list. Reports each entry that is no item."""
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
        """Return the keys of an item: one or several, texts or numbers."""
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


_MARK = re.compile(r"\^(\w+)(?:\(([^)]*)\))?|\\+(\w+)(?:=([^\\\s]*))?\\+")
_PLAIN_RATE, _PLAIN_VOLUME = 1.0, 1.0


class MadeAction(Struct):
    """An unfinished action of an act."""

    type: str
    parameters: dict[str, str]
    wait_for: list[int]
    """Numbers of actions, from 1."""
    comment: str = ""


class SpeechReader:
    """Makes actions from one annotated text."""

    def __init__(self, animations: Parameter | None, rate: float = _PLAIN_RATE, volume: float = _PLAIN_VOLUME) -> None:
        """
        :param animations: the parameter of the robot's `Animation`, with the known names.
        :param rate: the speed of all speech; 1 is normal.
        :param volume: the volume of all speech; 1 is the robot's own volume.
        """
        self._known = listed_names(animations) if animations is not None else []
        self._usual = (rate, volume)
        self._rate, self._volume = self._usual
        self.actions: list[MadeAction] = []
        self.new_animations: list[str] = []
        """Names that the robot's profile does not list."""
        self.omitted: list[str] = []
        """Parts without a counterpart in acts, as written."""
        self._after: list[int] = []
        """The actions that the next words wait for."""
        self._running: dict[str, int] = {}
        """Started movements that nothing waits for yet, by name."""

    def read(self, text: str) -> list[MadeAction]:
        """Return the actions of a text; empty: it has no speech and no movement."""
        text, at, words = " ".join(unescape(text).split()), 0, ""
        for mark in _MARK.finditer(text):
            words += text[at : mark.start()]
            at = mark.end()
            name = (mark[2] or "").strip()
            act = self._movement(mark[1], name) if mark[1] is not None else self._setting(mark[3], mark[4] or "")
            if act is None:
                self.omitted.append(mark[0])
            else:
                self._add_speech(words)
                words = ""
                act()
        self._add_speech(words + text[at:])
        return self.actions

    def _add_speech(self, words: str) -> None:
        words = " ".join(words.split())
        if not any(character.isalnum() for character in words):
            return
        parameters = {"message": words.replace("{", "{{").replace("}", "}}")}
        for name, value in (("rate", self._rate), ("volume", self._volume)):
            if value != 1.0:
                parameters[name] = f"{value:g}"
        self._add(MadeAction("Speech", parameters, self._after))
        self._after = [len(self.actions)]

    def _add(self, action: MadeAction) -> int:
        self.actions.append(action)
        return len(self.actions)

    def _movement(self, word: str, name: str) -> Callable[[], None] | None:
        """Return the effect of a mark about a movement; None: acts have no counterpart."""

        def begin() -> None:
            number = self._add(MadeAction("Animation", {"value": self.animation(name)}, list(self._after), name))
            if word == "run":  # the next words wait for its end
                self._after = [number]
            else:
                self._running[name] = number

        def wait() -> None:
            self._after = sorted({*self._after, self._running.pop(name)})

        if word in ("start", "run") and name:
            return begin
        return wait if word == "wait" and name in self._running else None

    def _setting(self, word: str, value: str) -> Callable[[], None] | None:
        """Return the effect of a mark about the voice; None: acts have no counterpart."""
        number = float(value) if re.fullmatch(r"\d+(\.\d+)?", value) else None

        def reset() -> None:
            self._rate, self._volume = self._usual

        def pause() -> None:
            self._after = [self._add(MadeAction("Wait", {"duration": f"{number:g}"}, self._after))]

        def set_rate() -> None:
            self._rate = min(max(self._usual[0] * (number or 0) / 100, 0.1), 10.0)

        def set_volume() -> None:
            self._volume = self._usual[1] * (number or 0) / 100

        if word == "rst":
            return reset
        return {"pau": pause, "rspd": set_rate, "vol": set_volume}.get(word) if number is not None else None

    def animation(self, path: str) -> str:
        """Return the profile's name for a movement of NAOqi: `hey` for `animations/Stand/Gestures/Hey_1`."""
        last = path.rstrip("/").rpartition("/")[2]
        stem = re.sub(r"_\d+\Z", "", last)
        name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", stem).replace(" ", "_").replace("-", "_").lower()
        if name not in self._known and name not in self.new_animations:
            self.new_animations.append(name)
        return name
