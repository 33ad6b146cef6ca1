"""What a rename makes of names, wherever they stand."""

from __future__ import annotations

from collections.abc import Iterable

from rise_engine.author.edit.edits import NameKind
from rise_engine.expression.key_places import KeyPlace
from rise_engine.scenario.model import normal_topic


class Renaming:
    """What a rename makes of names of every kind: an act's new name is that of the events of its end, too."""

    def __init__(self, kind: NameKind, owner: str, old: str, new: str, events: dict[str, str]) -> None:
        """
        :param kind: what is renamed.
        :param owner: of a state its rule, of an action its act; otherwise empty.
        :param old: the name alone, without the owner and without slash.
        :param new: the new one.
        :param events: events that are called otherwise because of it: old name, new name, without slash.
        """
        self.kind, self.owner, self.old, self.new = kind, owner, old, new
        self.events = events

    def act(self, name: str) -> str:
        return self.new if self.kind == "act" and name == self.old else name

    def rule(self, name: str) -> str:
        return self.new if self.kind == "rule" and name == self.old else name

    def state(self, rule: str, name: str) -> str:
        return self.new if self.kind == "state" and (rule, name) == (self.owner, self.old) else name

    def event(self, written: str) -> str:
        """An event; also the end of an act as records have it, `ended R_Yes succeeded`, which tests may expect."""
        topic, end = normal_topic(written), f"ended {self.old} "
        if self.kind == "act" and topic.startswith(end) and " " not in topic.removeprefix(end):
            return written.replace(end, f"ended {self.new} ", 1)
        return written.replace(topic, self.events[topic]) if topic in self.events else written

    def key(self, written: str) -> str:
        """A memory key, and one that begins with it: `person.name`, if `person` is renamed."""
        renamed = renamed_key(written, self.old, self.new) if self.kind == "key" else None
        return written if renamed is None else renamed

    def keys_in(self, text: str, places: Iterable[KeyPlace]) -> str:
        """A text with these keys in it."""
        return rename_in(text, places, self.old, self.new) if self.kind == "key" else text


def renamed_key(written: str, old: str, new: str) -> str | None:
    """What a key is called where `old` is called `new`: `person.name` too, if `person` is. None: it is another one."""
    if written == old:
        return new
    return new + written[len(old) :] if written.startswith(f"{old}.") else None


def rename_in(text: str, places: Iterable[KeyPlace], old: str, new: str) -> str:
    """A text with a key renamed at these places of keys."""
    for place in sorted(places, key=lambda each: each.start, reverse=True):
        renamed, end = renamed_key(place.key, old, new), place.start + len(place.key)
        if renamed is not None and text[place.start : end] == place.key:
            text = text[: place.start] + renamed + text[end:]
    return text
