"""Changes entries of a TOML file. Comments, order, alignment, quotes and line ends stay.

Each function returns the whole new text; `syntax.changes.edits_between` converts the difference to edits.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct

from rise_engine.syntax.changes import EditRefused
from rise_engine.syntax.toml import (
    KeyPath,
    TomlPair,
    TomlSection,
    TomlValue,
    read_sections,
    toml_key,
    toml_value,
    value_at,
)

_PAIRS_IN_A_LINE = ("keys",)
"""Tables whose entries are written as one-line tables: `n = { rule = "Next" }`."""


class _TomlEntry(Struct, frozen=True):
    """A pair or an element of an array, with its holder."""

    holder: TomlSection | TomlValue
    index: int
    value: TomlValue


class TomlText:
    """A TOML file's text, its values, and the place of each."""

    def __init__(self, text: str) -> None:
        """:raises EditRefused: it is not TOML."""
        self.text = text
        self.newline = "\r\n" if "\r\n" in text else "\n"
        try:
            self.values: dict[str, Any] = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise EditRefused(f"it is not TOML ({error}); fix that first") from None
        self.sections = read_sections(text)
        self.entries: dict[KeyPath, _TomlEntry] = {}
        for section in self.sections:
            for index, pair in enumerate(section.pairs):
                self._note(section.path + pair.names, section, index, pair.value)

    def _note(self, path: KeyPath, holder: TomlSection | TomlValue, index: int, value: TomlValue) -> None:
        self.entries[path] = _TomlEntry(holder, index, value)
        for at, pair in enumerate(value.pairs):
            self._note(path + pair.names, value, at, pair.value)
        for at, item in enumerate(value.items):
            self._note((*path, str(at)), value, at, item)

    def find(self, path: Sequence[str]) -> Any:
        """The value at a path; None: there is none."""
        return value_at(self.values, path)

    def written(self, path: KeyPath) -> str:
        """A value as written in the file; empty for a table with a header."""
        entry = self.entries.get(path)
        return "" if entry is None else self.text[entry.value.start : entry.value.end]

    def line_end(self, at: int) -> int:
        """The offset of the end of the line, after its comment."""
        end = self.text.find("\n", at)
        end = len(self.text) if end < 0 else end
        return end - 1 if self.text.endswith("\r", at, end) else end

    def line_start(self, at: int) -> int:
        return self.text.rfind("\n", 0, at) + 1

    def sections_below(self, path: KeyPath) -> list[TomlSection]:
        """The sections of a table and of its subtables."""
        return [section for section in self.sections if section.parts and section.path[: len(path)] == path]


# --- setting ----------------------------------------------------------------------------------------------------------


def set_value(text: str, path: KeyPath, value: Any) -> str:
    """Set the value at a path, or add it if there is none.

    :raises EditRefused: the text is not TOML, TOML has no such value, or the path leads through another value.
    """
    toml = TomlText(text)
    old = toml.find(path)
    if old is None:
        return _add(toml, path, value)
    if repr(old) == repr(value):  # not ==: 1, 1.0 and true differ here
        return text
    is_element = isinstance(toml.find(path[:-1]), list)
    if isinstance(old, dict) and isinstance(value, dict) and (value or is_element):
        return _set_members(text, path, old, value)
    entry = toml.entries.get(path)
    fits = entry is not None or (isinstance(value, list) and all(isinstance(each, dict) for each in value))
    if isinstance(old, list) and isinstance(value, list) and value and old and fits:
        return _set_items(text, path, old, value)
    if entry is None:
        if is_element:
            raise EditRefused(f"`{'.'.join(path)}` is a table, and cannot become {json.dumps(value)}")
        return set_value(remove_value(text, path), path, value)
    new = toml_value(value, like=text[entry.value.start : entry.value.end])
    return text[: entry.value.start] + new + text[entry.value.end :]


def _set_members(text: str, path: KeyPath, old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    for key, value in new.items():
        text = set_value(text, (*path, key), value)
    for key in old:
        if key not in new:
            text = remove_value(text, (*path, key))
    return text


def _set_items(text: str, path: KeyPath, old: Sequence[Any], new: Sequence[Any]) -> str:
    """Set a list element by element. If it gets shorter, remove elements from the first difference on."""
    if len(new) < len(old):
        same = next((at for at, (one, other) in enumerate(zip(old, new, strict=False)) if one != other), len(new))
        for _ in range(len(old) - len(new)):
            text = remove_value(text, (*path, str(same)))
    for at, value in enumerate(new):
        text = set_value(text, (*path, str(at)), value)
    return text


def _add(toml: TomlText, path: KeyPath, value: Any) -> str:
    """Add a value at a path that does not exist yet."""
    above = next(path[:size] for size in range(len(path) - 1, -1, -1) if toml.find(path[:size]) is not None)
    rest = path[len(above) :]
    if not above and len(rest) > 1:
        in_a_line = len(rest) == 2 and rest[0] in _PAIRS_IN_A_LINE
        if isinstance(value, dict) and not in_a_line:
            return _add_section(toml, path, value)
        return _add_section(toml, path[:-1], {path[-1]: value})
    for part in reversed(rest[1:]):
        value = {part: value}
    path = path[: len(above) + 1]
    holder = toml.find(above)
    if not isinstance(holder, dict | list) or (isinstance(holder, list) and path[-1] != str(len(holder))):
        raise EditRefused(f"`{'.'.join(path[:-1])}` has no place for `{path[-1]}`")
    inside = toml.entries.get(above)
    if inside is not None:
        return _add_inline(toml, inside.value, path[-1], value)
    if isinstance(holder, list):
        return _add_section(toml, path, value, is_list=True)
    section = next((each for each in toml.sections if each.path == above), None)
    siblings = [each for each in toml.sections_below(above) if len(each.path) > len(above)]
    if (
        isinstance(value, dict)
        and value
        and (siblings or not above)
        and not (section is not None and section.pairs and above)
    ):
        return _add_section(toml, path, value)
    if section is not None:
        return _add_pair(toml, section, (path[-1],), value)
    dotted = _last_dotted(toml, above)
    if dotted is not None:
        owner, pair = dotted
        return _add_pair(toml, owner, (*above[len(owner.path) :], path[-1]), value, behind=pair)
    return _add_section(toml, above, {path[-1]: value}, before=siblings[0])


def _last_dotted(toml: TomlText, path: KeyPath) -> tuple[TomlSection, TomlPair] | None:
    """The last pair whose dotted key creates the table at `path`."""
    found = None
    for section in toml.sections:
        for pair in section.pairs:
            whole = section.path + pair.names
            if len(section.path) < len(path) < len(whole) and whole[: len(path)] == path:
                found = section, pair
    return found


def _add_pair(toml: TomlText, section: TomlSection, names: KeyPath, value: Any, behind: TomlPair | None = None) -> str:
    """Add a line after the last pair of a section, or after its header."""
    key = ".".join(map(toml_key, names))
    last = behind or (section.pairs[-1] if section.pairs else None)
    if last is None and not section.parts:
        return _add_first_line(toml, f"{key} = {toml_value(value)}")
    indent = ""
    if last is not None:
        indent = toml.text[toml.line_start(last.start) : last.start]
        key = key.ljust(_key_width(toml, section))
    at = toml.line_end(last.value.end if last is not None else section.header_end)
    return f"{toml.text[:at]}{toml.newline}{indent}{key} = {toml_value(value)}{toml.text[at:]}"


def _add_first_line(toml: TomlText, line: str) -> str:
    """Add a line before any table, but after a comment about the file, which ends with an empty line."""
    at = 0
    comment = re.match(r"(?:#[^\n]*\n)+[ \t]*\r?\n", toml.text)
    if comment is not None:
        at = comment.end()
    rest = toml.text[at:]
    gap = "" if not rest or rest.startswith(("\n", "\r\n")) else toml.newline
    return f"{toml.text[:at]}{line}{toml.newline}{gap}{rest}"


def _key_width(toml: TomlText, section: TomlSection) -> int:
    """The width of keys if the author has aligned their `=`; otherwise 0."""
    widths = set()
    padded = False
    for pair in section.pairs:
        between = toml.text[pair.parts[-1].end : pair.value.start].partition("=")[0]
        padded |= len(between) > 1
        widths.add(pair.parts[-1].end - pair.start + len(between))
    return widths.pop() - 1 if padded and len(widths) == 1 else 0


def _add_section(
    toml: TomlText,
    path: KeyPath,
    values: Mapping[str, Any],
    *,
    is_list: bool = False,
    before: TomlSection | None = None,
) -> str:
    """Add a table with its own header after the last table of the same name, or at the end of the file."""
    if not isinstance(values, Mapping):
        raise EditRefused(f"an element of `{path[0]}` is a table, not {json.dumps(values)}")
    names = tuple(name for at, name in enumerate(path) if not _is_element(toml, path[:at]))
    header = ".".join(map(toml_key, names))
    header = f"[[{header}]]" if is_list else f"[{header}]"
    lines = [header, *(f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items())]
    block = toml.newline.join(lines)
    if before is not None:
        at = toml.line_start(before.start)
        return f"{toml.text[:at]}{block}{toml.newline}{toml.newline}{toml.text[at:]}"
    alike = toml.sections_below(path[:1])
    if alike:
        at = toml.line_end(alike[-1].end)
        return f"{toml.text[:at]}{toml.newline}{toml.newline}{block}{toml.text[at:]}"
    text = toml.text
    if text.strip():
        text += "" if text.endswith("\n") else toml.newline
        text += toml.newline
    return f"{text}{block}{toml.newline}"


def _is_element(toml: TomlText, holder: KeyPath) -> bool:
    """Whether the next part of a path is an element of a list."""
    return bool(holder) and isinstance(toml.find(holder), list)


def _add_inline(toml: TomlText, holder: TomlValue, key: str, value: Any) -> str:
    """Add a last element to an array, or a last pair to an inline table."""
    text = toml.text
    entry = toml_value(value) if holder.kind == "array" else f"{toml_key(key)} = {toml_value(value)}"
    spans = _spans(holder)
    if not spans:
        inside = f" {entry} " if holder.kind == "table" else entry
        return f"{text[: holder.start + 1]}{inside}{text[holder.end - 1 :]}"
    last = spans[-1]
    if "\n" not in text[holder.start : last[0]]:
        return f"{text[: last[1]]}, {entry}{text[last[1] :]}"
    has_comma = text[last[1] : holder.end - 1].lstrip().startswith(",")
    line_start, line_end = toml.line_start(last[0]), toml.line_end(last[1])
    indent = re.match(r"[ \t]*", text[line_start : last[0]])
    assert indent is not None
    closing = holder.end - 1
    if line_end > closing:  # `]` is on the last element's line
        return f"{text[: last[1]]},{toml.newline}{indent.group()}{entry}{text[last[1] :]}"
    comma, end = ("", ",") if has_comma else (",", "")
    line = f"{toml.newline}{indent.group()}{entry}{end}"
    return f"{text[: last[1]]}{comma}{text[last[1] : line_end]}{line}{text[line_end:]}"


def _spans(holder: TomlValue) -> list[tuple[int, int]]:
    if holder.kind == "array":
        return [(item.start, item.end) for item in holder.items]
    return [(pair.start, pair.value.end) for pair in holder.pairs]


# --- removing ---------------------------------------------------------------------------------------------------------


def remove_value(text: str, path: KeyPath) -> str:
    """Remove an entry, and the header of a table that has no other entry.

    :raises EditRefused: the text is not TOML, or there is no such entry.
    """
    toml = TomlText(text)
    if not path or toml.find(path) is None:
        raise EditRefused(f"there is no `{'.'.join(path)}`")
    entry = toml.entries.get(path)
    if entry is not None and isinstance(entry.holder, TomlValue):
        return _remove_inline(toml, entry.holder, entry.index)
    stretches = [_section_stretch(toml, section) for section in toml.sections_below(path)]
    for section in toml.sections:
        if section.path[: len(path)] == path and section.parts:
            continue
        gone = [pair for pair in section.pairs if (section.path + pair.names)[: len(path)] == path]
        is_last = len(gone) == len(section.pairs) and section.parts and not section.is_list
        if gone and is_last and re.search(r"\n[ \t]*#", text[section.start : section.end]) is None:
            stretches.append(_section_stretch(toml, section))
        elif gone and is_last:  # keep comments on their own lines
            stretches.append(_line_stretch(toml, section.start, section.header_end))
            stretches += [_line_stretch(toml, pair.start, pair.value.end) for pair in gone]
        else:
            stretches += [_line_stretch(toml, pair.start, pair.value.end) for pair in gone]
    for start, end in sorted(stretches, reverse=True):
        text = text[:start] + text[end:]
    return text


def _line_stretch(toml: TomlText, start: int, end: int) -> tuple[int, int]:
    """The range of whole lines, with their end."""
    end = toml.line_end(end)
    while end < len(toml.text) and toml.text[end] in "\r\n":
        end += 1
        if toml.text[end - 1] == "\n":
            break
    return toml.line_start(start), end


def _section_stretch(toml: TomlText, section: TomlSection) -> tuple[int, int]:
    """The range of a section from its header to its last pair, with the empty lines before it."""
    start, end = _line_stretch(toml, section.start, section.end)
    before = toml.text[:start]
    kept = before.rstrip(" \t\r\n")
    if not kept:
        following = re.match(r"(?:[ \t]*\r?\n)*", toml.text[end:])
        assert following is not None
        return start, end + following.end()
    gap = re.match(r"[ \t]*\r?\n", before[len(kept) :])
    return (len(kept) + gap.end() if gap is not None else start), end


def _remove_inline(toml: TomlText, holder: TomlValue, index: int) -> str:
    text, spans = toml.text, _spans(holder)
    start, end = spans[index]
    if index + 1 < len(spans):
        gap = text[end : spans[index + 1][0]]
        if "#" not in gap or "\n" not in text[holder.start : start]:
            return text[:start] + text[spans[index + 1][0] :]
        return _remove_line(toml, start, end)
    if index and "#" not in text[spans[index - 1][1] : start]:
        return text[: spans[index - 1][1]] + text[end:]
    if index:
        return _remove_line(toml, start, end)
    closing = holder.end - 1
    if "#" in text[holder.start : closing]:
        return _remove_line(toml, start, end)
    return f"{text[: holder.start + 1]}{text[closing:]}"


def _remove_line(toml: TomlText, start: int, end: int) -> str:
    """Remove an element of an array that has comments, together with the rest of its line."""
    comma = re.match(r"[ \t]*,?", toml.text[end:])
    assert comma is not None
    first, last = toml.line_start(start), toml.line_end(end)
    if toml.text[first:start].strip():
        return toml.text[:start] + toml.text[end + comma.end() :]
    if toml.text[end + comma.end() : last].strip()[:1] not in ("", "#"):
        return toml.text[:start] + toml.text[end + comma.end() :]
    return toml.text[:first] + toml.text[_line_stretch(toml, start, end)[1] :]


# --- renaming ---------------------------------------------------------------------------------------------------------


def rename_key(text: str, path: KeyPath, name: str) -> str:
    """Rename an entry everywhere in the file.

    :raises EditRefused: the text is not TOML, there is no such entry, it is a list element, or the name is taken.
    """
    return rename_keys(text, {path: name})


def rename_keys(text: str, names: Mapping[KeyPath, str]) -> str:
    """Like `rename_key`, for several entries at once, which may swap their names."""
    toml = TomlText(text)
    written: list[tuple[int, int, bool, str]] = []
    for path, name in names.items():
        if not path or toml.find(path) is None:
            raise EditRefused(f"there is no `{'.'.join(path)}`")
        holder = toml.find(path[:-1])
        if not isinstance(holder, dict):
            raise EditRefused(f"`{'.'.join(path)}` is an element of a list and has no name")
        if name in holder and (*path[:-1], name) not in names:
            raise EditRefused(f"`{'.'.join((*path[:-1], name))}` is there already; choose another name")
        written += [(*place, toml_key(name)) for place in _written_names(toml, path)]
    for start, end, aligned, new in sorted(written, reverse=True):
        old = text[start:end]
        blanks = re.match(r" *(?==)", text[end:])
        if aligned and blanks is not None and blanks.end() > 1:
            kept = max(1, blanks.end() + len(old) - len(new))
            text = text[:start] + new + " " * kept + text[end + blanks.end() :]
        else:
            text = text[:start] + new + text[end:]
    return text


def _written_names(toml: TomlText, path: KeyPath) -> Iterator[tuple[int, int, bool]]:
    """The places of the last part of a path, and whether a `=` may be aligned after it."""
    at = len(path) - 1
    for section in toml.sections:
        if section.path[: len(path)] == path:
            yield from (
                (part.start, part.end, False)
                for part, place in zip(section.parts, section.places, strict=True)
                if place == at
            )
    for holder, pairs in _holders(toml):
        for pair in pairs:
            whole = holder + pair.names
            if len(holder) <= at < len(whole) and whole[: len(path)] == path:
                part = pair.parts[at - len(holder)]
                yield part.start, part.end, part is pair.parts[-1]


def _holders(toml: TomlText) -> Iterator[tuple[KeyPath, Sequence[TomlPair]]]:
    for section in toml.sections:
        yield section.path, section.pairs
    for path, entry in toml.entries.items():
        if entry.value.pairs:
            yield path, entry.value.pairs
