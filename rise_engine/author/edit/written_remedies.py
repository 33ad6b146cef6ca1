"""Remedies that change the text at the place of a diagnostic: the intended name, a quotation mark, a number.

Each is a pair of a description and the edit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from xml.sax.saxutils import escape, unescape

from msgspec import UNSET, Struct

from rise_engine.author.edit.acts import next_id
from rise_engine.author.edit.edits import AnyEdit, ReplaceFile
from rise_engine.author.edit.outline import (
    Written,
    WrittenAct,
    WrittenAction,
    WrittenRule,
    WrittenState,
    WrittenTransition,
)
from rise_engine.author.edit.plan import StudyState
from rise_engine.scenario.checking.uses import Use, UsedKind
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.syntax.changes import EditRefused, TextEdit, changed_text
from rise_engine.syntax.xml_layout import gap_before, gap_in
from rise_engine.syntax.xml_repair import RepairedText
from rise_engine.syntax.xml_writing import NewElement, set_text


class StateTransition(Struct, frozen=True):
    """A transition of a state."""

    rule: WrittenRule
    state: WrittenState
    index: int
    """Its index in the state, from 0."""

    @property
    def written(self) -> WrittenTransition:
        return self.state.transitions[self.index]


class FindingPlace(Struct, frozen=True):
    """A diagnostic and its place in the file."""

    finding: Diagnostic
    study: StudyState
    text: str
    """The text of the file, without a byte order mark."""
    start: int
    """The index of the character where the diagnostic begins."""
    end: int

    @property
    def file(self) -> str:
        return self.finding.location.file

    @property
    def is_xml(self) -> bool:
        return self.file.lower().endswith(".xml")

    @property
    def written(self) -> str:
        """The text of the file that the diagnostic marks."""
        return self.text[self.start : self.end]

    def use(self, kind: UsedKind) -> Use | None:
        """Return the name of a kind at this place."""
        place = self.finding.location
        column = place.column + (self.written[:1] in ("'", '"'))  # skip the quotation mark of a text in TOML or JSON
        found = self.study.checked.uses.at(place.file, place.line, column)
        return found if found is not None and found.kind == kind else None

    def rewritten(self, *edits: TextEdit) -> ReplaceFile:
        """Return the file with other text at some places."""
        return ReplaceFile(self.file, changed_text(self.text, edits))

    def replaced(self, new: str) -> ReplaceFile:
        """Return the file with other text instead of the marked one, escaped for XML."""
        return self.rewritten(TextEdit(self.start, self.end, self.escaped(new)))

    def escaped(self, new: str) -> str:
        """Escape a text for an attribute if this file is XML."""
        return escape(new, {'"': "&quot;"}).replace("&gt;", ">") if self.is_xml else new

    # --- the enclosing parts ----------------------------------------------------------------------------------------

    @property
    def act(self) -> WrittenAct | None:
        return next((each for each in self.study.outline.acts if self.is_in(each)), None)

    @property
    def action(self) -> tuple[WrittenAct, WrittenAction] | None:
        act = self.act
        found = next((each for each in act.actions if self.is_in(each)), None) if act else None
        return (act, found) if act is not None and found is not None else None

    @property
    def rule(self) -> WrittenRule | None:
        return next((each for each in self.study.outline.rules if self.is_in(each)), None)

    @property
    def transition(self) -> StateTransition | None:
        rule = self.rule
        for state in rule.states if rule is not None else ():
            for index, transition in enumerate(state.transitions):
                if rule is not None and self.is_in(transition) and not transition.shared_by:
                    return StateTransition(rule, state, index)
        return None

    def is_in(self, written: Written) -> bool:
        """Return whether a part of the acts and rules contains this place."""
        return written.file == self.file and written.holds(self.start)


def place_of(finding: Diagnostic, study: StudyState) -> FindingPlace | None:
    """Return the place of a diagnostic; None: its file is not one of the study's, or not UTF-8."""
    name = finding.location.file
    data = study.files.get(name)
    try:
        text = data.decode("utf-8-sig") if data is not None else None
    except UnicodeDecodeError:
        return None
    if data is None or text is None:
        return None
    source = SourceFile(name, data, text)
    start = source.offset(finding.location.line, finding.location.column)
    end = start if finding.end is UNSET else source.offset(finding.end.line, finding.end.column)
    return FindingPlace(finding, study, text, start, max(start, end))


# --- remedies --------------------------------------------------------------------------------------------------------


_EXPRESSION_KINDS = ("condition", "assignment", "time")
_NUMBER = re.compile(r"\s*([\d.]+)\s*\Z")
_ATTRIBUTE = re.compile(r"""[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*')""")
_CONFLICT = re.compile(
    r"<{7}[^\r\n]*(?:\r\n?|\n)(?P<ours>.*?)(?:\|{7}.*?)?^={7}[^\r\n]*(?:\r\n?|\n)(?P<theirs>.*?)^>{7}[^\r\n]*(?:\r\n?|\n|\Z)",
    re.DOTALL | re.MULTILINE,
)
_ALLOW_COMMENT = re.compile(r"<!--.*?-->|#[^\r\n]*", re.DOTALL)
_BLANKS = " \t"

WrittenRemedy = tuple[str, AnyEdit]


def _suggest_name(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer the nearest right name."""
    suggestion = place.finding.suggestion
    if suggestion is UNSET or not suggestion.meant or place.finding.code in _EXPRESSION_KINDS:
        return
    wrong, meant, written = suggestion.written, suggestion.meant, place.written
    mark = "<" if written.startswith("<") else written[:1] if written[:1] in ("'", '"') else ""
    inner = written[1:-1] if mark and mark == written[-1:] else written.removeprefix(mark)
    if wrong.strip("/") != unescape(inner, {"&quot;": '"', "&apos;": "'"}).strip().strip("/"):
        return  # the name is in another place: in a template, or built from pieces
    slash = "/" if inner.startswith("/") and not meant.startswith("/") else ""
    at = place.start + len(mark)
    yield f"write {meant}", place.rewritten(TextEdit(at, at + len(inner), place.escaped(slash + meant)))


def _suggest_operator(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer the operator for `AND`, `&` or `≥`, and the known function for an unknown one."""
    suggestion = place.finding.suggestion
    if suggestion is UNSET or place.finding.code not in _EXPRESSION_KINDS:
        return
    for written in dict.fromkeys((place.escaped(suggestion.written), suggestion.written)):
        if place.text.startswith(written, place.start):
            edit = TextEdit(place.start, place.start + len(written), place.escaped(suggestion.meant))
            yield f"write {suggestion.meant}", place.rewritten(edit)
            return


def _quoted_word(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer quotation marks for a word that is meant as a text."""
    suggestion = place.finding.suggestion
    if place.finding.code != "bare-word" or suggestion is UNSET:
        return
    equals = place.text.find("=", place.start, place.end)
    word = re.compile(rf"(?<![\w.'\"&]){re.escape(suggestion.written)}(?![\w.'\";])")
    at = word.search(place.text, max(equals, place.start), place.end)
    if at is None or place.text[place.end : place.end + 1] == "'":
        return
    yield f"write '{at.group()}' in quotation marks", place.rewritten(TextEdit(*at.span(), f"'{at.group()}'"))


def _time_unit(place: FindingPlace) -> Iterator[WrittenRemedy]:
    number = _NUMBER.match(place.written) if place.finding.code == "time" else None
    if number is not None:
        for unit in ("s", "ms"):
            yield f"write {number.group(1)}{unit}", place.replaced(number.group(1) + unit)


def _escaped_marks(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer to escape `<`, `&` and quotation marks in the whole file: each remaining one would make it unreadable."""
    if place.finding.code not in ("unescaped", "quotes") or not place.is_xml:
        return
    mended = RepairedText(place.text).text
    yield f"write the marks in {place.file} as XML wants them", place.rewritten(TextEdit(0, len(place.text), mended))


def _one_version(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer each of the two versions of a git conflict."""
    if place.finding.code != "merge-conflict" or (found := _CONFLICT.match(place.text, place.start)) is None:
        return
    for version, words in (("ours", "upper"), ("theirs", "lower")):
        yield f"keep the {words} of the two versions", place.rewritten(TextEdit(*found.span(), found[version]))


def _no_silencing(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer to remove a comment that silences nothing, with its line if it is alone there."""
    comment = _ALLOW_COMMENT.match(place.text, place.start) if place.finding.code == "unused-allow" else None
    if comment is None:
        return
    line_start = max(place.text.rfind(end, 0, place.start) for end in "\r\n") + 1
    rest = re.compile(r"[ \t]*(\r\n?|\n|\Z)").match(place.text, comment.end())
    alone = rest is not None and not place.text[line_start : place.start].strip(_BLANKS)
    start, end = (line_start, rest.end()) if alone and rest is not None else comment.span()
    yield "remove the comment, which silences nothing", place.rewritten(TextEdit(start, end, ""))


def _no_attribute(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer to remove an unknown attribute, except for a function, whose attribute is its effect."""
    attribute = _ATTRIBUTE.match(place.text, place.start) if place.finding.code == "unknown-attribute" else None
    opened = place.text.rfind("<", 0, place.start)
    if attribute is None or place.text.startswith("<function", opened):
        return
    start = len(place.text[: place.start].rstrip())
    yield f"remove {place.written}", place.rewritten(TextEdit(start, attribute.end(), ""))


def _own_id(place: FindingPlace) -> Iterator[WrittenRemedy]:
    """Offer the next free number for an action without an actionID, or with a duplicate one."""
    found = place.action if place.finding.code in ("missing-id", "duplicate-id") else None
    if found is None or found[0].reason or found[1].reason:
        return
    act, action = found
    number = next_id(act)
    node, new = action.node, NewElement("actionID", text=number)
    own = next((each for each in node if each.tag == "actionID"), None)
    try:
        if own is not None:
            splice = set_text(own, number)
        else:
            splice = (gap_before(node[0]) if node else gap_in(node)).insert(new)
    except EditRefused:
        return
    yield f"give it the actionID {number}", place.rewritten(TextEdit(*splice[1:]))


WRITTEN: tuple[Callable[[FindingPlace], Iterable[WrittenRemedy]], ...] = (
    _suggest_name,
    _suggest_operator,
    _quoted_word,
    _time_unit,
    _escaped_marks,
    _one_version,
    _no_silencing,
    _no_attribute,
    _own_id,
)
"""Each offers its remedies for a diagnostic; a single one is probably what the author meant."""
