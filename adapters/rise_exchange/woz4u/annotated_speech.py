"""Converts Pepper's texts in WoZ4U, NAOqi's annotated text, to actions of an act.

    Hello! ^start(animations/Stand/Gestures/Hey_1) I am here. ^wait(animations/Stand/Gestures/Hey_1) \\rspd=50\\ Slowly.

The notation: http://doc.aldebaran.com/2-5/naoqi/audio/alanimatedspeech.html and, for the backslashes, the page of
ALTextToSpeech beside it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html import unescape

from msgspec import Struct

from rise_engine.scenario.model import Parameter
from rise_engine.scenario.parameters import listed_names

_MARK = re.compile(r"\^(\w+)(?:\(([^)]*)\))?|\\+(\w+)(?:=([^\\\s]*))?\\+")
_PLAIN_RATE, _PLAIN_VOLUME = 1.0, 1.0


class MadeAction(Struct):
    """An action of an act while it is made."""

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
        self.left_out: list[str] = []
        """Parts without a counterpart in acts, as written."""
        self._after: list[int] = []
        """The actions that the next words wait for."""
        self._running: dict[str, int] = {}
        """Movements that were started and are not waited for yet, by name."""

    def read(self, text: str) -> list[MadeAction]:
        """The actions of a text; none if it says nothing and moves nothing."""
        text, at, words = " ".join(unescape(text).split()), 0, ""
        for mark in _MARK.finditer(text):
            words += text[at : mark.start()]
            at = mark.end()
            name = (mark[2] or "").strip()
            act = self._movement(mark[1], name) if mark[1] is not None else self._setting(mark[3], mark[4] or "")
            if act is None:
                self.left_out.append(mark[0])
            else:
                self._say(words)
                words = ""
                act()
        self._say(words + text[at:])
        return self.actions

    def _say(self, words: str) -> None:
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
        """The effect of a mark about a movement; None: acts have nothing for it."""

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
        """The effect of a mark about the voice; None: acts have nothing for it."""
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
        """The profile's name for a movement of NAOqi: `hey` for `animations/Stand/Gestures/Hey_1`."""
        last = path.rstrip("/").rpartition("/")[2]
        stem = re.sub(r"_\d+\Z", "", last)
        name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", stem).replace(" ", "_").replace("-", "_").lower()
        if name not in self._known and name not in self.new_animations:
            self.new_animations.append(name)
        return name
