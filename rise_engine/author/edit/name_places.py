"""The place of a name in its file, and its replacement there by another name.

Comments that mention a name stay unchanged and are listed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from msgspec import Struct

from rise_engine.author.edit.plan import EditedText, EditRefused, Files, Splice
from rise_engine.expression.tokens import escape_text
from rise_engine.scenario.checking.uses import Use
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.syntax.toml import TomlKeyPart, TomlValue, toml_key
from rise_engine.syntax.toml_edits import TomlText
from rise_engine.syntax.xml import CDATA, XmlSyntaxError, XmlTree


class NamePlace(Struct, frozen=True):
    """The place of a name: its file, and its first and last character."""

    file: str
    start: int
    end: int


class NamePlaces:
    """Finds and rewrites names in the files of a study."""

    def __init__(self, files: Files) -> None:
        self.files = files
        self._sources: dict[str, SourceFile] = {}
        self._texts: dict[str, EditedText] = {}
        self._tomls: dict[str, TomlText] = {}
        self._trees: dict[str, XmlTree] = {}

    def find(self, use: Use) -> NamePlace | None:
        """Find the place of a used name: in the file, or in its template. None: both together make the name."""
        place = use.place
        if not use.length or place.file not in self.files:
            return None
        start = self._source(place.file).offset(place.line, place.column)
        return NamePlace(place.file, start, start + use.length)

    def _source(self, file: str) -> SourceFile:
        if file not in self._sources:
            text = self._text(file).text
            self._sources[file] = SourceFile(file, self.files[file], text)
        return self._sources[file]

    def _text(self, file: str) -> EditedText:
        if file not in self._texts:
            self._texts[file] = EditedText(file, self.files[file])
        return self._texts[file]

    def splice(self, place: NamePlace, name: str) -> Splice:
        """Replace the name at a place in the form that the file requires.

        :raises EditRefused: it cannot be written there.
        """
        if place.file.endswith(".xml"):
            return Splice(place.file, place.start, place.end, self._for_xml(place, name))
        if place.file.endswith(".toml"):
            return self._for_toml(place, name)
        return Splice(place.file, place.start, place.end, json.dumps(name, ensure_ascii=False)[1:-1])

    def _for_xml(self, place: NamePlace, name: str) -> str:
        text = self._text(place.file).text
        if place.file not in self._trees:
            try:
                self._trees[place.file] = XmlTree(text)
            except XmlSyntaxError as error:
                raise EditRefused(f"{place.file}: {error}") from None
        escaped = name.replace("&", "&amp;").replace("<", "&lt;")
        attribute = self._trees[place.file].element_at(place.start).attribute_at(place.start)
        if attribute is not None:
            return escaped.replace(attribute.quote, "&quot;" if attribute.quote == '"' else "&apos;")
        opening = text.rfind(CDATA, 0, place.start)
        return name if opening >= 0 and text.find("]]>", opening) >= place.end else escaped.replace("]]>", "]]&gt;")

    def _for_toml(self, place: NamePlace, name: str) -> Splice:
        """Replace the name within a text or as a key, with quotation marks if necessary."""
        text = self._text(place.file)
        if place.file not in self._tomls:
            self._tomls[place.file] = TomlText(text.text)
        toml = self._tomls[place.file]
        for part in _key_parts(toml):
            if part.start <= place.start < part.end:
                if (part.start, part.end) in ((place.start, place.end), (place.start - 1, place.end + 1)):
                    return Splice(place.file, part.start, part.end, toml_key(name))
                raise EditRefused(f"{place.file}, line {text.line(part.start)}: the name is a part of another one")
        for value in _values(toml):
            if value.start <= place.start < value.end:
                name = escape_text(name, _inner_quote(text, value, place))
                if text.text.startswith("'", value.start):
                    if "'" in name:
                        line = text.line(value.start)
                        raise EditRefused(
                            f"{place.file}, line {line}: write this text in \" marks first; it is in ' marks"
                        )
                    return Splice(place.file, place.start, place.end, name)
                return Splice(place.file, place.start, place.end, json.dumps(name, ensure_ascii=False)[1:-1])
        raise EditRefused(f"{place.file} is written in a way that cannot be changed here; change it with an editor")


def _inner_quote(file: EditedText, value: TomlValue, place: NamePlace) -> str:
    """Return the quotation mark around a name within a text, as in `runs('R_Yes')`; empty: there is none."""
    begin = file.text[value.start : value.start + 3]
    opening = len(begin) if begin in ('"""', "'''") else 1
    before = file.text[value.start + opening : place.start]
    return before[-1:] if before.endswith(("'", '"')) else ""


def _key_parts(toml: TomlText) -> Iterator[TomlKeyPart]:
    for section in toml.sections:
        yield from section.parts
        for pair in section.pairs:
            yield from pair.parts
            yield from _inner_parts(pair.value)


def _inner_parts(value: TomlValue) -> Iterator[TomlKeyPart]:
    for item in value.items:
        yield from _inner_parts(item)
    for pair in value.pairs:
        yield from pair.parts
        yield from _inner_parts(pair.value)


def _values(toml: TomlText) -> Iterator[TomlValue]:
    return (entry.value for entry in toml.entries.values() if entry.value.kind == "scalar")


# --- comments --------------------------------------------------------------------------------------------------------


_COMMENTS = {
    ".xml": re.compile(r"<!--.*?-->", re.DOTALL),
    ".toml": re.compile(r"#[^\n]*"),
    ".jsonl": re.compile(r"^[ \t]*#[^\n]*", re.MULTILINE),
    ".md": re.compile(r".+"),
    ".txt": re.compile(r".+"),
}
_MAX_COMMENTS = 10
"""Maximum number of comments that are listed one by one."""


def comments_with(name: str, files: Files, splices: list[Splice]) -> Iterator[str]:
    """Yield a sentence for each comment, or line of a README, that contains the name as a word.

    :param name: the old name.
    :param files: the files before the change.
    :param splices: the changes; names inside them do not count.
    """
    word = re.compile(rf"(?<![\w.]){re.escape(name)}(?!\w)")
    found: list[str] = []
    for file in sorted(files):
        pattern = next((each for suffix, each in _COMMENTS.items() if file.endswith(suffix)), None)
        if pattern is None or name.encode() not in files[file]:
            continue
        try:
            text = EditedText(file, files[file])
        except EditRefused:
            continue
        changed = [(each.start, each.end) for each in splices if each.file == file]
        for comment in pattern.finditer(text.text):
            for place in word.finditer(text.text, *comment.span()):
                if not any(start <= place.start() < end for start, end in changed):
                    what = "the text" if file.endswith((".md", ".txt")) else "the comment"
                    found.append(f"{what} in {file}, line {text.line(place.start())}, still has `{name}`")
    unique = list(dict.fromkeys(found))
    yield from unique[:_MAX_COMMENTS]
    if len(unique) > _MAX_COMMENTS:
        yield f"and {len(unique) - _MAX_COMMENTS} more comments still have `{name}`"
