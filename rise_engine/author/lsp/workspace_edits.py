"""Plans of edits as the protocol has them: changes of open and closed files, new files, files that go."""

from __future__ import annotations

from lsprotocol import types as lsp

from rise_engine.author.edit.plan import Plan
from rise_engine.author.lsp.served_study import ServedStudy
from rise_engine.author.lsp.study_server import StudyServer
from rise_engine.scenario.source_files import SourceFile
from rise_engine.syntax.changes import edits_between

_BEGINNING = lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0))


def workspace_edit(server: StudyServer, study: ServedStudy, plan: Plan) -> lsp.WorkspaceEdit | None:
    """What a plan changes; None: it makes or deletes files, and the editor says that it cannot."""
    changes: dict[str, list[lsp.TextEdit]] = {}
    steps: list[lsp.CreateFile | lsp.DeleteFile] = []
    for splice in plan.splices:
        source = study.source(splice.file)
        assert source is not None  # it was read to plan this
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
    """The stretches in which a file differs, so that what is open keeps its marks and its place."""
    return [
        lsp.TextEdit(server.range_of(source, each.start, each.end), each.text)
        for each in edits_between(source.text, after)
    ]


def file_operations(server: StudyServer) -> set[str]:
    """What the editor can do with files beside changing them: "create", "delete"."""
    workspace = server.client_capabilities.workspace
    edits = workspace.workspace_edit if workspace is not None else None
    known = edits is not None and edits.document_changes and edits.resource_operations
    return {str(getattr(each, "value", each)) for each in known or ()}
