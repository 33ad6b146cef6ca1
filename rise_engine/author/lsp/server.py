"""The language server: it answers requests from `ServedStudy` over standard input and output.

https://microsoft.github.io/language-server-protocol/specifications/lsp/3.17/specification/
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from xml.sax.saxutils import escape

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rise_engine.author.edit.outline import Written
from rise_engine.author.edit.plan import EditRefused, Plan
from rise_engine.author.lsp.completion import proposals
from rise_engine.author.lsp.hover import hover_text
from rise_engine.author.lsp.served_study import ServedStudy, StudyServer
from rise_engine.scenario.checking.uses import UsedKind
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.syntax.changes import edits_between

_QUICK_FIX = lsp.CodeActionKind.QuickFix.value
_KINDS = {
    "act": lsp.CompletionItemKind.Function,
    "rule": lsp.CompletionItemKind.Class,
    "state": lsp.CompletionItemKind.EnumMember,
    "event": lsp.CompletionItemKind.Event,
    "key": lsp.CompletionItemKind.Variable,
    "action": lsp.CompletionItemKind.Reference,
    "element": lsp.CompletionItemKind.Struct,
    "attribute": lsp.CompletionItemKind.Property,
}


def _refusal(why: str) -> JsonRpcException:
    """Make a refusal for the person at the editor."""
    return JsonRpcException(why, lsp.LSPErrorCodes.RequestFailed.value)


def make_server() -> StudyServer:
    """Make the server with all its answers."""
    server = StudyServer()
    _follow_documents(server)
    _answer_about_names(server)
    _answer_about_files(server)
    return server


def _follow_documents(server: StudyServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def hold(params: lsp.DidOpenTextDocumentParams | lsp.DidChangeTextDocumentParams) -> None:
        uri = params.text_document.uri
        if (found := server.study_of(uri)) is not None:
            study, name = found
            study.hold(study.folder / name, server.workspace.get_text_document(uri).source)
            server.publish(study)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def release_file(params: lsp.DidCloseTextDocumentParams) -> None:
        if (found := server.study_of(params.text_document.uri)) is not None:
            study, name = found
            study.release_file(study.folder / name)
            server.publish(study)

    @server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
    @server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def check_again(params: Any) -> None:
        for study in server.studies.values():
            study.forget()
            server.publish(study)


def _answer_about_names(server: StudyServer) -> None:
    @server.feature(
        lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=['"', "'", "{", "<", "/", "|"])
    )
    def complete(params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
        if (place := server.at(params)) is None:
            return []
        study, name, source, offset = place
        start, found = proposals(study.checked, name, source.text, offset)
        covered = server.range_of(source, start, offset)
        is_xml = name.lower().endswith(".xml")
        return [
            lsp.CompletionItem(
                label=each.text,
                kind=_KINDS.get(each.kind, lsp.CompletionItemKind.Value),
                detail=each.note or None,
                filter_text=each.text,
                text_edit=lsp.TextEdit(covered, escape(each.text, {'"': "&quot;"}) if is_xml else each.text),
            )
            for each in found
        ]

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    def define(params: lsp.DefinitionParams) -> list[lsp.Location]:
        if (found := server.use_at(params)) is None:
            return []
        places = (server.place_of_use(found[0], each) for each in found[0].definitions(found[1]))
        return [place for place in places if place is not None]

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    def refer(params: lsp.ReferenceParams) -> list[lsp.Location]:
        if (found := server.use_at(params)) is None:
            return []
        uses = (each for each in found[0].uses_like(found[1]) if params.context.include_declaration or not each.defines)
        places = (server.place_of_use(found[0], each) for each in uses)
        return [place for place in places if place is not None]

    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    def hover(params: lsp.HoverParams) -> lsp.Hover | None:
        place = server.at(params)
        text = hover_text(place[0], place[1], place[3]) if place is not None else ""
        return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text)) if text else None

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare_rename(params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder | None:
        """Return a name's range. Names may contain blanks, at which editors would end them."""
        found = server.use_at(params)
        place = server.place_of_use(*found) if found is not None else None
        if found is None or place is None:
            return None
        name = found[1].name
        alone = name.rpartition("/")[2] if found[1].kind in ("state", "action") else name
        return lsp.PrepareRenamePlaceholder(place.range, alone)

    @server.feature(lsp.TEXT_DOCUMENT_RENAME)
    def rename(params: lsp.RenameParams) -> lsp.WorkspaceEdit:
        if (found := server.use_at(params)) is None:
            raise _refusal("there is no name of an act, rule, state, event, action or memory key here")
        study, use = found
        try:
            changed = workspace_edit(server, study, study.rename(use, params.new_name))
        except EditRefused as refused:
            raise _refusal(str(refused)) from None
        assert changed is not None  # a rename creates no files
        return changed


def _answer_about_files(server: StudyServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def list_symbols(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        if (found := server.study_of(params.text_document.uri)) is None or (
            source := found[0].source(found[1])
        ) is None:
            return []
        return file_symbols(server, *found, source)

    @server.feature(
        lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix])
    )
    def offer_remedies(params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        """Offer remedies for all diagnostics that touch the place, whether or not the editor lists them."""
        wanted, found = params.context.only, server.study_of(params.text_document.uri)
        is_wanted = wanted is None or any(_QUICK_FIX.startswith(str(getattr(each, "value", each))) for each in wanted)
        source = found[0].source(found[1]) if found is not None else None
        if found is None or source is None or not is_wanted:
            return []
        (study, name), positions, actions = found, server.positions(source), dict[str, lsp.CodeAction]()
        start, end = (positions.offset(at.line, at.character) for at in (params.range.start, params.range.end))
        for finding in study.findings(name, start, end):
            shown = server.diagnostic(finding, source)
            for remedy, planned in study.remedies(finding, with_new_files="create" in file_operations(server)):
                edit = workspace_edit(server, study, planned)
                if edit is not None and remedy.title not in actions:
                    actions[remedy.title] = lsp.CodeAction(
                        remedy.title, lsp.CodeActionKind.QuickFix, [shown], remedy.is_likely or None, edit=edit
                    )
        return list(actions.values())

    @server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
    def lay_out(params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
        if (found := server.study_of(params.text_document.uri)) is None or (
            source := found[0].source(found[1])
        ) is None:
            return []
        try:
            after = found[0].formatted(found[1])
        except EditRefused as refused:
            raise _refusal(str(refused)) from None
        if after == source.text:
            return []
        return [lsp.TextEdit(server.range_of(source, 0, len(source.text)), after)]


# --- plans as edits of the protocol -----------------------------------------------------------------------------------


_BEGINNING = lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0))


def workspace_edit(server: StudyServer, study: ServedStudy, plan: Plan) -> lsp.WorkspaceEdit | None:
    """Return the changes of a plan; None: it creates or deletes files, which the editor does not support."""
    changes: dict[str, list[lsp.TextEdit]] = {}
    steps: list[lsp.CreateFile | lsp.DeleteFile] = []
    for splice in plan.splices:
        source = study.source(splice.file)
        assert source is not None  # it was read for this plan
        edit = lsp.TextEdit(server.range_of(source, splice.start, splice.end), splice.text)
        changes.setdefault(server.uri(study, splice.file), []).append(edit)
    for name, content in plan.written.items():
        source, uri = study.source(name), server.uri(study, name)
        if content is None:
            steps.append(lsp.DeleteFile(uri))
        elif source is None:
            steps.append(lsp.CreateFile(uri))
            changes[uri] = [lsp.TextEdit(_BEGINNING, content.decode("utf-8-sig"))]
        else:
            changes[uri] = _rewritten(server, source, content.decode("utf-8-sig"))
    if not steps:
        return lsp.WorkspaceEdit(changes=changes)
    if not {each.kind for each in steps} <= file_operations(server):
        return None
    edited = [
        lsp.TextDocumentEdit(lsp.OptionalVersionedTextDocumentIdentifier(uri, None), those)
        for uri, those in changes.items()
    ]
    return lsp.WorkspaceEdit(document_changes=[*steps, *edited])


def _rewritten(server: StudyServer, source: SourceFile, after: str) -> list[lsp.TextEdit]:
    """Return only the ranges that differ, so that an open file keeps its marks and its cursor."""
    return [
        lsp.TextEdit(server.range_of(source, each.start, each.end), each.text)
        for each in edits_between(source.text, after)
    ]


def file_operations(server: StudyServer) -> set[str]:
    """Return the file operations that the editor supports in addition to changes: "create", "delete"."""
    workspace = server.client_capabilities.workspace
    edits = workspace.workspace_edit if workspace is not None else None
    known = edits is not None and edits.document_changes and edits.resource_operations
    return {str(getattr(each, "value", each)) for each in known or ()}


# --- a file's outline -------------------------------------------------------------------------------------------------


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
    """Return the ranges of acts, rules and states in a file, so that an editor finds the one at the cursor."""
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
