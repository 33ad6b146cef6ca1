"""Where a finding stands in a study's files: what remedies are worked out from."""

from __future__ import annotations

from xml.sax.saxutils import escape

from msgspec import UNSET, Struct

from rise_engine.author.edit.edits import ReplaceFile
from rise_engine.author.edit.outline import (
    Written,
    WrittenAct,
    WrittenAction,
    WrittenRule,
    WrittenState,
    WrittenTransition,
)
from rise_engine.author.edit.study_state import StudyState
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.source_files import SourceFile
from rise_engine.scenario.uses import Use, UsedKind
from rise_engine.syntax.changes import TextEdit, changed_text


class Way(Struct, frozen=True):
    """A way out of a state."""

    rule: WrittenRule
    state: WrittenState
    index: int
    """Its number in the state, from 0."""

    @property
    def written(self) -> WrittenTransition:
        return self.state.transitions[self.index]


class FindingPlace(Struct, frozen=True):
    """A finding, and what stands there."""

    finding: Diagnostic
    study: StudyState
    text: str
    """Of the file, without a byte order mark."""
    start: int
    """The character of the text at which the finding begins."""
    end: int

    @property
    def file(self) -> str:
        return self.finding.location.file

    @property
    def is_xml(self) -> bool:
        return self.file.lower().endswith(".xml")

    @property
    def written(self) -> str:
        """What the finding is about, as it stands in the file."""
        return self.text[self.start : self.end]

    def use(self, kind: UsedKind) -> Use | None:
        """The name of a kind that stands there."""
        place = self.finding.location
        column = place.column + (self.written[:1] in ("'", '"'))  # a text of TOML or JSON
        found = self.study.checked.uses.at(place.file, place.line, column)
        return found if found is not None and found.kind == kind else None

    def rewritten(self, *edits: TextEdit) -> ReplaceFile:
        """The file with other text at some places."""
        return ReplaceFile(self.file, changed_text(self.text, edits))

    def replaced(self, new: str) -> ReplaceFile:
        """The file with other text in the place of what the finding is about, escaped as XML wants it."""
        return self.rewritten(TextEdit(self.start, self.end, self.escaped(new)))

    def escaped(self, new: str) -> str:
        """As it stands in an attribute of this file, where it is one of XML."""
        return escape(new, {'"': "&quot;"}).replace("&gt;", ">") if self.is_xml else new

    # --- what it stands in ------------------------------------------------------------------------------------------

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
    def way(self) -> Way | None:
        rule = self.rule
        for state in rule.states if rule is not None else ():
            for index, way in enumerate(state.transitions):
                if rule is not None and self.is_in(way) and not way.shared_by:
                    return Way(rule, state, index)
        return None

    def is_in(self, written: Written) -> bool:
        """Whether it stands in something that is written in the acts and rules."""
        return written.file == self.file and written.holds(self.start)


def place_of(finding: Diagnostic, study: StudyState) -> FindingPlace | None:
    """The place of a finding; None: its file is none of the study, or is not UTF-8."""
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
