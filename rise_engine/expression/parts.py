"""Parts of values by index: `items[i].text` is read, `items[i].done = true` is set (semantics.md 8.4, 8.5).

A missing part always raises MissingPartError.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.expression.environment import MISSING, Environment, Json, describe, list_index, lookup, nesting_levels
from rise_engine.expression.errors import MISSING_PART, EvaluationError, MissingPartError
from rise_engine.expression.nodes import Part, with_all_brackets
from rise_engine.expression.operators import Operand


class PartReader:
    """The compiled operand that reads one part."""

    __slots__ = ("_base", "_part", "_steps", "_text")

    def __init__(self, part: Part, base: Operand, steps: Sequence[str | Operand], text: str) -> None:
        self._part = part
        self._base = base
        self._steps = steps
        self._text = text

    def __call__(self, env: Environment) -> Json:
        """Return the value of the part and note it in `env.parts`. Raises MissingPartError if it does not exist."""
        if env.parts is not None:
            env.parts[self._part.written] = None
        value = self._base(env)
        if value is MISSING:
            raise self._error(f"the memory has no `{with_all_brackets(self._part.base)}`")
        for count, step in enumerate(self._steps):
            index = step if isinstance(step, str) else step(env)
            place = find_part(value, index, by_dot=isinstance(step, str))
            if place is None:
                raise self._error(self._why_missing(value, index, count))
            value = value[place]
        if env.parts is not None:
            env.parts[self._part.written] = value
        return value

    def is_there(self, env: Environment) -> bool:
        """Whether the part exists; for `defined`."""
        try:
            self(env)
        except MissingPartError:
            return False
        return True

    def assign(self, memory: Mapping[str, Json], value: Json, env: Environment) -> tuple[str, Json]:
        """Return the key of the memory that changes if this part is set to `value`, and its new value.

        The indexes are read from `env`. Copies the values on the path; the memory itself is not changed. The last step
        may be a new name in an object. Raises MissingPartError if an earlier step or a list entry does not exist, and
        EvaluationError if the value would be nested too deeply.
        """
        name = with_all_brackets(self._part.base)
        head, *names = (name,) if name in memory else name.split(".")
        if not lookup(memory, name)[0]:
            raise self._error(f"the memory has no `{name}`")
        steps: list[str | Operand] = [*names, *self._steps]
        top: list[Json] = [memory[head]]
        holder: Json = top
        place: int | str = 0
        for count, step in enumerate(steps):
            inner = holder[place]
            index = step if isinstance(step, str) else step(env)
            if isinstance(inner, (list, dict)):
                inner = holder[place] = inner.copy()
            following = find_part(inner, index, by_dot=isinstance(step, str))
            if following is None and count == len(steps) - 1 and isinstance(inner, dict):
                following = _name_of(index)
            if following is None:
                raise self._error(self._why_missing(inner, index, count - len(names)))
            holder, place = inner, following
        holder[place] = value
        if len(steps) + nesting_levels(value) > MAX_LEVELS:
            message = f"`{head}` would be nested too deeply: more than {MAX_LEVELS} lists and objects within each other"
            raise EvaluationError(message, self._text)
        return head, top[0]

    def _error(self, what: str) -> MissingPartError:
        return MissingPartError(f"{MISSING_PART}: {what}", self._text)

    def _why_missing(self, holder: Json, index: Json, count: int) -> str:
        """Explain why the part does not exist. `count`: the number of steps that lead to the holder."""
        name = with_all_brackets(self._part._replace(steps=self._part.steps[:count]))
        if isinstance(holder, list):
            whole = _whole_number(index)
            if whole is None:
                shown = f"`{index}`" if isinstance(index, str) else describe(index)
                return f"`{name}` is a list, whose entries are found by whole numbers from 0 on, not by {shown}"
            entries = f"the entries 0 to {len(holder) - 1}" if len(holder) > 1 else "one entry, 0"
            return f"`{name}` has {entries if holder else 'no entries'}, and no {whole}"
        if isinstance(holder, dict):
            named = _name_of(index)
            return f"`{name}` has no `{named}`" if named is not None else f"{describe(index)} names nothing in `{name}`"
        return f"`{name}` is {describe(holder)}, which has no parts"


def find_part(holder: Json, index: Json, *, by_dot: bool) -> int | str | None:
    """The place of a part in a list or an object; None if it does not exist.

    :param by_dot: whether the name follows a dot, where digits are the index of a list entry.
    """
    if isinstance(holder, list):
        if by_dot:
            return list_index(holder, index)
        whole = _whole_number(index)
        return whole if whole is not None and 0 <= whole < len(holder) else None
    if isinstance(holder, dict):
        name = _name_of(index)
        return name if name is not None and name in holder else None
    return None


def _whole_number(index: Json) -> int | None:
    """The list index of a value, or None."""
    if isinstance(index, float) and index.is_integer():
        return int(index)
    return index if isinstance(index, int) and not isinstance(index, bool) else None


def _name_of(index: Json) -> str | None:
    """The name in an object that a value means: a text, or the digits of a whole number."""
    if isinstance(index, str):
        return index
    whole = _whole_number(index)
    return None if whole is None else str(whole)
