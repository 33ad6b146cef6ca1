"""Hides the values of private memory keys in records for others: `{person_name}` replaces them.

There are two ways. By structure: the key's own records, conditions that read it, and actions that an act fills with it,
which are shown as in the act. By value: any text that contains a former value of the key, or a name from it. A number
is only found as a separate word.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import msgspec

from rise_engine.base.words import word_pattern
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.kernel.records import AnyRecord, MemoryRecord
from rise_engine.kernel.speech import SAY
from rise_engine.scenario.model import ActionCall, Scenario
from rise_engine.scenario.speech.template import spoken_text

MIN_LETTERS_WITHIN = 3
"""Minimum number of letters of a value that is also found within longer words (`Anna` in `Annas`)."""
MIN_DIGITS_WITHIN = 5
"""The same for values without letters: a telephone number is recognisable anywhere, `34` is not."""
_VALUE_FIELDS = frozenset({"value", "old"})
_UNSPACED = "\u2e80"
"""The first character of the scripts without spaces between words."""
NAMES_FIELDS = frozenset(
    {
        *("kind", "seq", "t", "wall", "status", "id", "function", "calling_type", "source", "position", "ref", "task"),
        *("cause", "via"),
        *("act", "action", "type", "sent_as", "name", "state", "previous", "priority", "rule", "taken_by", "key"),
        *("deleted", "created", "by", "holder", "mark"),
        *("scenario", "scenario_hash", "mode", "robot", "seed", "versions"),
        *("participant", "condition", "study", "study_hash", "slot", "run", "attempt", "purpose", "factors"),
        "result",
    }
)
"""Fields of records with names from the scenario, the study or the program, not texts."""
_QUOTED = re.compile(r"`[^`]*`|'[^']*'")
_NAME = re.compile(r"[^\W\d_][^\W_]*(?:[-'’][^\W_]+)*")

Kind = TypeVar("Kind", bound=AnyRecord)


class PrivateValues:
    """Collects the values that private keys have had, and hides them in records."""

    def __init__(self, scenario: Scenario, private: Iterable[str] = ()) -> None:
        """`private`: private keys in addition to the scenario's."""
        self._scenario = scenario
        self.keys = scenario.private | frozenset(private)
        self._slots = {key: f"{{{key}}}" for key in self.keys}
        self._values: dict[str, str] = {}
        self._pattern: re.Pattern[str] | None = None
        self._order: list[str] = []
        for key in sorted(self.keys & scenario.memory.keys()):
            self._note_value(key, scenario.memory[key])

    def note(self, record: AnyRecord) -> None:
        """Collect the values of a private key from a record."""
        if self.keys and isinstance(record, MemoryRecord):
            self.note_memory(record.key, record.value)
            self.note_memory(record.key, record.old)

    def note_memory(self, key: str, value: Any) -> None:
        """Collect the value of a memory key if the key is private."""
        if (head := _head(key)) in self.keys:
            self._note_value(head, value)

    def read(self, key: str, value: Any) -> Any:
        """Return the value of a memory key as others may see it."""
        return self.hide_value(self._read_value(key, value))

    def hide(self, record: Kind) -> Kind:
        """Return a record as others may see it; the same object if nothing is hidden."""
        if not self.keys:
            return record
        self.note(record)
        values: dict[str, Any] = msgspec.to_builtins(record)
        hidden = self.hide_fields(values)
        return record if hidden == values else msgspec.convert(hidden, type(record))

    def hide_fields(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a record as others may see them."""
        if not self.keys:
            return values
        match values["kind"]:
            case "memory" if (key := _head(values["key"])) in self.keys:
                slot = self._slots[key]
                return {**values, **{name: slot for name in ("value", "old") if values[name] is not None}}
            case "condition":
                values = {
                    **values,
                    "values": {name: self._read_value(name, each) for name, each in values["values"].items()},
                }
            case "action":
                values = {**values, "parameters": self._parameters(values)}
            case "task" if values["function"] == "assignValue":
                values = self._assignment(values)
            case "note" if values["source"] == "engine":
                values = {**values, "text": _QUOTED.sub(self._quoted, values["text"])}
        return {name: self._hide_field(name, each) for name, each in values.items()}

    def hide_value(self, value: Any) -> Any:
        """Replace the values of private keys in the texts of a JSON value by their keys."""
        return self.replace_values(value, lambda slot, found: slot)

    def replace_values(self, value: Any, stand_in: Callable[[str, str | int | float], Any]) -> Any:
        """Replace the values of private keys in a JSON value.

        :param value: a JSON value.
        :param stand_in: maps the key as `{person_name}` and the found text or number to a value of the same type.
        """
        if self._values and isinstance(value, str):
            if self._pattern is None:
                self._pattern = self._make_pattern()
            return self._pattern.sub(
                lambda found: str(stand_in(self._order[(found.lastindex or 1) - 1], found[0])), value
            )
        if isinstance(value, int | float) and not isinstance(value, bool):
            text = spoken_text(value)
            known = len(text) >= MIN_DIGITS_WITHIN and text in self._values
            return stand_in(self._values[text], value) if known else value
        if isinstance(value, list | tuple):
            return [self.replace_values(each, stand_in) for each in value]
        if isinstance(value, dict):
            return {
                self.replace_values(key, stand_in): self.replace_values(each, stand_in) for key, each in value.items()
            }
        return value

    def is_hidden(self, key: str) -> bool:
        """Whether a memory key is private, or is a part of a private key."""
        return _head(key) in self.keys

    def _hide_field(self, name: str, value: Any) -> Any:
        """Hide values in a record's field. A number outside memory values is a time or a count and stays."""
        if name == "key" and _head(value) not in self._scenario.known_keys:
            return self.hide_value(value)  # a key that was made while the session ran, perhaps from a value
        if name in NAMES_FIELDS or (isinstance(value, int | float) and name not in _VALUE_FIELDS):
            return value
        return self.hide_value(value)

    # --- by structure ---

    def _read_value(self, name: str, value: Any) -> Any:
        return self._slots[head] if value is not None and (head := _head(name)) in self.keys else value

    def _parameters(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return an action's parameters, with those that a private key fills as they are in the act."""
        parameters: dict[str, Any] = values["parameters"]
        act = self._scenario.acts.get(values["act"]) if values["act"] != SAY else None
        action = next((each for each in act.actions if each.id == values["action"]), None) if act is not None else None
        if action is None:
            return parameters
        calls = [call for call in action.calls if call.type == values["type"] and self._fills(call)]
        if not calls:
            return parameters
        call = next((each for each in calls if _could_be(each, parameters)), calls[0])
        return {
            name: call.parameters[name].text
            if name in call.parameters and any(self.is_hidden(slot.key) for slot in call.parameters[name].slots)
            else value
            for name, value in parameters.items()
        }

    def _fills(self, call: ActionCall) -> bool:
        return any(self.is_hidden(slot.key) for each in call.parameters.values() for slot in each.slots)

    def _assignment(self, values: dict[str, Any]) -> dict[str, Any]:
        """Hide the values in `person_name = "Anna"`, also if the assignment could not be read and set no value."""
        behavior: str = values["behavior"]
        named = [key for key in sorted(self.keys) if re.search(rf"(?<![\w.]){re.escape(key)}(?!\w)", behavior)]
        if not named:
            return values
        try:
            assignments = Assignment.parse_all(behavior)
        except ExpressionError:
            hidden = "; ".join(f"{key} = {self._slots[key]}" for key in named)
            return {**values, "behavior": hidden, "reason": "it could not be read" if values["reason"] else ""}
        written = [
            f"{each.key} = {self._slots[_head(each.key)]}" if _head(each.key) in self.keys else each.text
            for each in assignments
        ]
        reason = _QUOTED.sub("`…`", values["reason"])
        return {**values, "behavior": "; ".join(written), "reason": reason}

    def _quoted(self, found: re.Match[str]) -> str:
        """Hide quotes in the engine's notes: they may be values typed before the program knew that they are private."""
        return found[0] if found[0][1:-1] in self._scenario.known_keys else "`…`"

    # --- by value ---

    def _note_value(self, key: str, value: Any) -> None:
        for text in _texts(value):
            text = " ".join(text.split())
            names = [each for each in _NAME.findall(text) if each[0].isupper() and len(each) >= MIN_LETTERS_WITHIN]
            for each in (text, *names):
                if len(each) > 1 and any(map(str.isalnum, each)) and each not in self._values:
                    self._values[each] = self._slots[key]
                    self._pattern = None

    def _make_pattern(self) -> re.Pattern[str]:
        ordered = sorted(self._values, key=len, reverse=True)
        self._order = [self._values[each] for each in ordered]
        parts = []
        for each in ordered:
            within = len(each) >= (MIN_LETTERS_WITHIN if any(map(str.isalpha, each)) else MIN_DIGITS_WITHIN)
            within = within or max(each) >= _UNSPACED
            before, after = ("", "") if within else (r"(?<![\w.])", r"(?![\w]|\.\d)")
            parts.append(f"({before}{word_pattern(each)}{after})")
        return re.compile("|".join(parts))


def _head(key: str) -> str:
    """Return the whole memory key of which `key` is a part."""
    return key.partition(".")[0].partition("[")[0]


def _texts(value: Any) -> Iterator[str]:
    """Give each spoken text in a value. `true` and `false` do not identify anybody."""
    if isinstance(value, dict):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, list | tuple):
        for each in value:
            yield from _texts(each)
    elif value is not None and not isinstance(value, bool):
        yield spoken_text(value)


def _could_be(call: ActionCall, parameters: dict[str, Any]) -> bool:
    """Whether this call can have made an action's parameters."""
    for name, template in call.parameters.items():
        if name in parameters and isinstance(parameters[name], str) and template.parts:
            pattern = "".join(re.escape(each) if isinstance(each, str) else ".*" for each in template.parts)
            if not re.fullmatch(pattern, parameters[name], re.DOTALL):
                return False
    return True
