"""Checks whether the memory keys of a scenario can exist, and knows the engine's own values under `session`.

Dotted keys are followed into the start values. A key can exist if it is in the start values, or if a rule or a key of
the keyboard sets it, a part of the path to it, or something inside it. A start value that nothing sets never changes,
so a path that ends early there never exists. A null is a value that is still to come: any path may continue after it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, nearest_name
from rise_engine.expression import lookup
from rise_engine.expression.environment import reach_into
from rise_engine.expression.values import describe
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.model import SESSION, Json

_FEW = 12
"""How many names of an object a message lists."""
_SHORT = 1_000
"""The longest such list, in characters."""


class MemoryPaths:
    """The keys of one scenario: its start values, and the keys that are set while it runs."""

    def __init__(self, start: Mapping[str, Json], written: Collection[str]) -> None:
        self._start = start
        self._written = frozenset(written)
        self._within = {path for key in self._written for path in _key_prefixes(key)}
        """The keys that some assignment reaches into."""

    def is_known(self, key: str) -> bool:
        """Whether something has or sets the key, or the value that it reaches into."""
        return key in self._start or self._is_written(key) or ("." in key and key.partition(".")[0] in self._start)

    def reading_problem(self, key: str) -> str:
        """Why a known key can never have a value; empty if it can."""
        if key in self._start or self._is_written(key) or key.partition(".")[0] not in self._start:
            return ""
        value, path, missing = self._follow(key)
        if value is None or not missing:
            return ""
        remedy = self._suggested_path(value, path, missing)
        return f"the memory never has `{key}`: {_why_it_ends(value, path, missing[0])}{remedy}"

    def writing_problem(self, key: str) -> str:
        """Why a key can never be set; empty if it can."""
        if key in self._start or not isinstance(self._start.get(key.partition(".")[0]), dict | list):
            return ""
        if any(path in self._written for path in _key_prefixes(key)):
            return ""
        value, path, missing = self._follow(key)
        if value is None or not missing or isinstance(value, dict):  # objects on the path are made
            return ""
        return f"`{key}` cannot be set: {_why_it_ends(value, path)}"

    def _follow(self, key: str) -> tuple[Json, str, list[str]]:
        """Follow a key into the start values. Returns the last value, the path to it, and the parts that are left."""
        path, *parts = key.split(".")
        value = self._start[path]
        while parts:
            found, inner = reach_into(value, parts[0])
            if not found:
                break
            value, path = inner, f"{path}.{parts.pop(0)}"
        return value, path, parts

    def _is_written(self, key: str) -> bool:
        if key in self._written or any(path in self._written for path in _key_prefixes(key)):
            return True
        head = key.partition(".")[0]
        return key in self._within and (head in self._start or head in self._written)

    def _suggested_path(self, value: Json, path: str, missing: list[str]) -> str:
        """The path that was most likely meant, as the end of a message."""
        if not isinstance(value, dict):
            return ""
        sibling = nearest_name(missing[0], value)
        if sibling is not None:
            return f"; did you mean `{self._existing_part(path, [sibling, *missing[1:]])}`?"
        if 0 < len(value) <= _FEW:
            known = in_backquotes(f"{path}.{name}" for name in value)
            return f"; known: {known}" if len(known) < _SHORT else ""
        return ""

    def _existing_part(self, path: str, parts: list[str]) -> str:
        """The path with as many of the following parts as exist."""
        while parts and not lookup(self._start, ".".join((path, *parts)))[0]:
            parts = parts[:-1]
        return ".".join((path, *parts))


def _why_it_ends(value: Json, path: str, part: str = "") -> str:
    """Say where a path into the start values ends, and that nothing changes that."""
    if isinstance(value, list):
        entries = f"with the entries `{path}.0` to `{path}.{len(value) - 1}`" if len(value) > 1 else ""
        entries = entries or (f"with the one entry `{path}.0`" if value else "without entries")
        end = f"in the start values `{path}` is a list {entries}"
    elif isinstance(value, dict):
        end = f"in the start values `{path}` has no `{part}`"
    else:
        end = f"in the start values `{path}` is {describe(value)}, which has nothing inside"
    return f"{end}, and nothing in this scenario sets it"


def _key_prefixes(key: str) -> Iterator[str]:
    """The keys that a dotted key reaches into: `a` and `a.b` for `a.b.c`."""
    at = key.find(".")
    while at >= 0:
        yield key[:at]
        at = key.find(".", at + 1)


# --- the keys of the session ------------------------------------------------------------------------------------------


EXAMPLE: dict[str, Json] = {
    "speaking": False,
    "cue": False,
    "stopped": False,
    "participant": "",
    "condition": "",
    "factors": None,
    "language": "",
}
"""The keys under `session`. The study defines the names of the factors."""


def add_session_keys(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Find out whether anything in the scenario reads the session's values."""
    reads = [
        mention
        for mentions in (
            draft.key_reads,
            draft.optional_key_reads,
            draft.property_reads,
            draft.bare_words,
            draft.bare_keys,
        )
        for mention in mentions
        if mention.name.partition(".")[0] == SESSION
    ]
    if not reads:
        return
    is_own = SESSION in draft.tables or any(key.partition(".")[0] == SESSION for key in draft.settable_keys)
    if not is_own:
        draft.session_keys = EXAMPLE
        draft.settable_keys.add(SESSION)
    elif known := next((each for each in reads if each.name.partition(".")[2].partition(".")[0] in EXAMPLE), None):
        message = (
            f"`{known.name}` is a key of this scenario, because it sets `{SESSION}` itself; what the engine knows of "
            "the session is not there under that name: call your own key something else"
        )
        diagnostics.warning("own-session", known.locate(), message)


def factors_read(draft: ScenarioDraft) -> frozenset[str]:
    """The study's factors that anything reads without a fallback: `pace` for `session.factors.pace`."""
    if not draft.session_keys:
        return frozenset()
    paths = (mention.name.split(".") for mention in (*draft.key_reads, *draft.bare_words, *draft.bare_keys))
    return frozenset(path[2] for path in paths if path[:2] == [SESSION, "factors"] and len(path) > 2)


def keys_read(draft: ScenarioDraft) -> frozenset[str]:
    """The memory keys that anything reads, up to their first dot."""
    reads = (draft.key_reads, draft.optional_key_reads, draft.bare_words, draft.bare_keys, draft.spoken_keys)
    return frozenset(mention.name.partition(".")[0] for mentions in reads for mention in mentions)


def session_problem(draft: ScenarioDraft, key: str) -> str:
    """Describe a part of the session that does not exist; empty for other keys."""
    head, _, part = key.partition(".")
    if head != SESSION or not draft.session_keys:
        return ""
    near = did_you_mean(key, [f"{SESSION}.{name}" for name in EXAMPLE])
    return f"the engine keeps no `{part}` under `{SESSION}`{near}"
