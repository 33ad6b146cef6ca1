"""The acts, rules and states of a file, for an editor's outline."""

from __future__ import annotations

from collections.abc import Iterable

from lsprotocol import types as lsp

from rise_engine.author.edit.outline import Written
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.lsp.served_study import ServedStudy
from rise_engine.author.lsp.study_server import StudyServer
from rise_engine.scenario.checking.uses import UsedKind
from rise_engine.scenario.files.source_files import SourceFile


def file_symbols(server: StudyServer, study: ServedStudy, name: str, source: SourceFile) -> list[lsp.DocumentSymbol]:
    """Return the acts and rules of a file, in its order, with the states of a rule below it."""
    return _FileSymbols(server, study, name, source).find()


class _FileSymbols:
    def __init__(self, server: StudyServer, study: ServedStudy, name: str, source: SourceFile) -> None:
        self.server, self.name, self.source = server, name, source
        self.uses = study.checked.uses
        self.states: dict[str, list[str]] = {}
        """By rule."""
        for state in self.uses.names("state"):
            self.states.setdefault(state.partition("/")[0], []).append(state)
        self.spans = _spans(study, name)

    def find(self) -> list[lsp.DocumentSymbol]:
        acts = self.symbols("act", self.uses.names("act"), lsp.SymbolKind.Function)
        return acts + self.symbols("rule", self.uses.names("rule"), lsp.SymbolKind.Class)

    def symbols(self, kind: UsedKind, names: Iterable[str], symbol: lsp.SymbolKind) -> list[lsp.DocumentSymbol]:
        found = []
        for each in names:
            for use in self.uses.of(kind, each):
                if not (use.defines and use.length and use.place.file == self.name):
                    continue
                start = self.source.offset(use.place.line, use.place.column)
                end = start + use.length
                first, last = self.spans.get((kind, each), (start, end))
                states = self.states.get(each, []) if kind == "rule" else []
                found.append(
                    lsp.DocumentSymbol(
                        each.partition("/")[2] if kind == "state" else each,
                        symbol,
                        self.server.range_of(self.source, min(first, start), max(last, end)),
                        self.server.range_of(self.source, start, end),
                        children=self.symbols("state", states, lsp.SymbolKind.EnumMember),
                    )
                )
        return sorted(found, key=lambda each: (each.range.start.line, each.range.start.character))


def _spans(study: ServedStudy, name: str) -> dict[tuple[str, str], tuple[int, int]]:
    """Return where acts, rules and states are in a file, so that an editor finds the one at the cursor."""
    try:
        outline = study.state.outline
    except EditRefused:  # the folder cannot be read
        return {}
    parts: dict[tuple[str, str], Written] = {("act", act.name): act for act in outline.acts if act.file == name}
    for rule in outline.rules:
        if rule.file == name:
            parts["rule", rule.name] = rule
            parts.update({("state", f"{rule.name}/{state.id}"): state for state in rule.states})
    return {named: (part.node.start, part.node.end) for named, part in parts.items()}
