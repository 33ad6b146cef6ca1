"""The language server, asked as editors ask it."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rise_engine.author.edit.edits import Rename
from rise_engine.author.edit.plan import StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.study_folder import read_study_files
from rise_engine.scenario.loader import load
from tests.author.lsp.editor import editing

pytestmark = pytest.mark.slow
ACTS, RULES = "acts/greeting.xml", "rules/greeting.xml"


async def test_findings_while_typing(tmp_path: Path) -> None:
    """What is not saved wins over the disk, in all files; an emoji before it shifts nothing."""
    async with editing(tmp_path, "greeting") as editor:
        editor.open(ACTS)
        await editor.until(ACTS, [])
        editor.replace(ACTS, '<Dialog name="R_Greeting"', '<!-- 😀 --><Dialog name="R_Other"')
        await editor.until("scenario.toml", ["unknown-act"])
        (found,) = editor.findings[editor.uri("scenario.toml")]
        line = (editor.folder / "scenario.toml").read_text().splitlines()[found.range.start.line]
        assert line[found.range.start.character : found.range.end.character] == '"R_Greeting"'
        assert (found.source, found.severity) == ("rise", lsp.DiagnosticSeverity.Error)
        editor.replace(ACTS, "<!-- 😀 --><Dialog name", "<!-- 😀 --><Dialog nome")
        await editor.until(ACTS, ["unknown-attribute"])
        attribute = editor.findings[editor.uri(ACTS)][0].range
        units = editor.texts[ACTS].splitlines()[attribute.start.line].encode("utf-16-le")
        assert units[2 * attribute.start.character : 2 * attribute.end.character].decode("utf-16-le") == "nome"
        document = lsp.TextDocumentIdentifier(editor.uri(ACTS))
        editor.client.text_document_did_close(lsp.DidCloseTextDocumentParams(document))
        await editor.until("scenario.toml", [])
        await editor.until(ACTS, [])


async def test_a_file_that_belongs_to_no_study_is_left_alone(tmp_path: Path) -> None:
    async with editing(tmp_path, "greeting") as editor:
        (tmp_path / "page.xml").write_text("<html>")
        uri = (tmp_path / "page.xml").as_uri()
        item = lsp.TextDocumentItem(uri, "xml", 1, "<html>")
        editor.client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))
        document, place = lsp.TextDocumentIdentifier(uri), lsp.Position(0, 3)
        assert not await editor.client.text_document_definition_async(lsp.DefinitionParams(document, place))
        assert not await editor.client.text_document_completion_async(lsp.CompletionParams(document, place))
        editor.open(ACTS)
        await editor.until(ACTS, [])
        assert list(editor.findings) == [editor.uri(ACTS)]


async def test_where_a_name_is_defined_and_used(tmp_path: Path) -> None:
    async with editing(tmp_path, "greeting") as editor:
        editor.open("rules/gaze.xml")
        place = editor.place("rules/gaze.xml", "R_FollowGaze", 4)
        (defined,) = await editor.definitions("rules/gaze.xml", "R_FollowGaze", 4)
        assert defined.uri == editor.uri("acts/gaze.xml")
        context = lsp.ReferenceContext(include_declaration=True)
        found = await editor.client.text_document_references_async(lsp.ReferenceParams(context=context, **place)) or []
        files = [each.uri.rpartition("/")[2] for each in found]
        assert sorted(set(files)) == ["gaze.xml", "scenario.toml"] and len(files) == 7
        told = await editor.client.text_document_hover_async(lsp.HoverParams(**place))
        assert (
            told is not None
            and isinstance(told.contents, lsp.MarkupContent)
            and "**R_FollowGaze** (act), named in 6 places" in told.contents.value
        )


async def test_a_name_is_changed_everywhere_as_the_engine_does(tmp_path: Path) -> None:
    async with editing(tmp_path, "greeting") as editor:
        editor.open(RULES)
        files = read_study_files(editor.folder)
        state = StudyState(files, load(editor.folder), editor.folder)
        expected = apply_plan(files, plan(Rename("act", "R_Greeting", "R_Grüße"), state))
        place = editor.place(RULES, "R_Greeting", 2)
        edit = await editor.client.text_document_rename_async(lsp.RenameParams(new_name="R_Grüße", **place))
        assert edit is not None and edit.changes is not None and len(edit.changes) > 2
        editor.apply({uri: list(edits) for uri, edits in edit.changes.items()})
        assert read_study_files(editor.folder) == expected and load(editor.folder).scenario is not None
        with pytest.raises(JsonRpcException, match="R_FollowGaze"):
            await editor.client.text_document_rename_async(lsp.RenameParams(new_name="R_FollowGaze", **place))


async def test_remedies(tmp_path: Path) -> None:
    """At the place of a finding, behind its last letter too, whether or not the editor names the finding."""
    async with editing(tmp_path, "greeting") as editor:
        editor.open("rules/gaze.xml")
        editor.replace("rules/gaze.xml", '"R_FollowGaze"', '"R_FolowGaze"')
        await editor.until("rules/gaze.xml", ["unknown-act", *["unreachable-transition"] * 3])
        finding = editor.findings[editor.uri("rules/gaze.xml")][0]
        for into, context in ((1, {"diagnostics": [finding]}), (len("R_FolowGaze"), {"only": ["quickfix"]})):
            found = await editor.remedies("rules/gaze.xml", "R_FolowGaze", into, **context)
            assert list(found) == ["write R_FollowGaze", "make the act R_FolowGaze"]
        action = found["write R_FollowGaze"]
        assert action.is_preferred and list(action.diagnostics or ()) == [finding]
        assert action.edit is not None and action.edit.changes is not None
        ((uri, (edit,)),) = action.edit.changes.items()
        assert uri == editor.uri("rules/gaze.xml")
        assert edit.range.start.line == finding.range.start.line and edit.new_text == "l"  # nothing else is touched
        made = found["make the act R_FolowGaze"].edit
        assert made is not None and made.changes is not None
        ((uri, (edit,)),) = made.changes.items()
        assert uri == editor.uri("acts/signals.xml") and '<Dialog name="R_FolowGaze"/>' in edit.new_text
        assert not await editor.remedies("rules/gaze.xml", "R_FolowGaze", 1, only=["refactor"])
        assert not await editor.remedies("rules/gaze.xml", "<onEntry>")


async def test_a_remedy_may_make_a_file(tmp_path: Path) -> None:
    """An editor that cannot make one gets it in a file that there is."""
    operations = [lsp.ResourceOperationKind.Create]
    edits = lsp.WorkspaceEditClientCapabilities(document_changes=True, resource_operations=operations)
    able = lsp.ClientCapabilities(workspace=lsp.WorkspaceClientCapabilities(workspace_edit=edits))
    for capabilities, folder in ((able, tmp_path / "able"), (None, tmp_path / "not")):
        async with editing(folder, "greeting", capabilities) as editor:
            editor.open("scenario.toml")
            editor.replace("scenario.toml", 'rule = "Greeting"', 'rule = "Zzz"')
            await editor.until("scenario.toml", ["unknown-rule"])
            found = await editor.remedies("scenario.toml", '"Zzz"', 2)
            if capabilities is None:
                written = found["make the rule Zzz in rules/listening.xml"].edit
                assert written is not None and written.changes is not None
                assert list(written.changes) == [editor.uri("rules/listening.xml")]
                editor.apply({uri: list(edits) for uri, edits in written.changes.items()})
                editor.client.text_document_did_save(lsp.DidSaveTextDocumentParams(editor.document("scenario.toml")))
                await editor.until("scenario.toml", [])
                continue
            assert list(found) == ["make the rule Zzz"]
            for action in found.values():
                assert action.edit is not None and action.edit.document_changes is not None
                create, change = action.edit.document_changes
                assert isinstance(create, lsp.CreateFile) and create.uri == editor.uri("rules/zzz.xml")
                assert isinstance(change, lsp.TextDocumentEdit) and change.text_document.uri == create.uri
                (text,) = change.edits
                assert isinstance(text, lsp.TextEdit)
                (editor.folder / "rules" / "zzz.xml").write_text(text.new_text)
                editor.client.workspace_did_change_watched_files(
                    lsp.DidChangeWatchedFilesParams([lsp.FileEvent(create.uri, lsp.FileChangeType.Created)])
                )
                await editor.until("scenario.toml", [])


async def test_a_file_that_is_changed_before_it_is_opened(tmp_path: Path) -> None:
    """As Helix does with one that a quick fix has made; what it says of it when it opens it is older."""
    async with editing(tmp_path, "greeting") as editor:
        editor.open("scenario.toml")
        editor.replace("scenario.toml", 'rule = "Greeting"', 'rule = "Zzz"')
        await editor.until("scenario.toml", ["unknown-rule"])
        (editor.folder / "rules" / "zzz.xml").touch()
        editor.texts["rules/zzz.xml"] = ""
        editor.replace("rules/zzz.xml", "", '<InteractionRule name="Zzz" initial="A"><State id="A"/></InteractionRule>')
        await editor.until("scenario.toml", [])
        item = lsp.TextDocumentItem(editor.uri("rules/zzz.xml"), "xml", 0, "")
        editor.client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))
        editor.replace("rules/zzz.xml", 'name="Zzz"', 'name="Yyy"')
        await editor.until("scenario.toml", ["unknown-rule"])
        editor.replace("rules/zzz.xml", 'name="Yyy"', 'name="Zzz"')
        await editor.until("scenario.toml", [])


async def test_changes_that_come_in_another_order(tmp_path: Path) -> None:
    """As quick ones of Helix do: the newest counts."""
    async with editing(tmp_path, "greeting") as editor:
        editor.open("scenario.toml")
        document = lsp.VersionedTextDocumentIdentifier(9, editor.uri("scenario.toml"))
        for version, rule, codes in ((9, "Zzz", ["unknown-rule"]), (8, "Greeting", ["unknown-rule"]), (10, "Gaze", [])):
            text = editor.texts["scenario.toml"].replace('rule = "Greeting"', f'rule = "{rule}"')
            document = lsp.VersionedTextDocumentIdentifier(version, document.uri)
            change = lsp.TextDocumentContentChangeWholeDocument(text)
            editor.client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [change]))
            assert await editor.definitions("scenario.toml", "R_Greeting", 2)  # what came before is taken in
            await editor.until("scenario.toml", codes)


async def test_a_name_of_several_words_is_renamed_as_a_whole(tmp_path: Path) -> None:
    rename = lsp.TextDocumentClientCapabilities(rename=lsp.RenameClientCapabilities(prepare_support=True))
    async with editing(tmp_path, "greeting", lsp.ClientCapabilities(text_document=rename)) as editor:
        editor.open("rules/gaze.xml")
        place = editor.place("rules/gaze.xml", "Back to default", 6)
        found = await editor.client.text_document_prepare_rename_async(lsp.PrepareRenameParams(**place))
        assert isinstance(found, lsp.PrepareRenamePlaceholder) and found.placeholder == "Back to default"
        line = editor.texts["rules/gaze.xml"].splitlines()[found.range.start.line]
        assert line[found.range.start.character : found.range.end.character] == "Back to default"
        nothing = editor.place("rules/gaze.xml", "<onEntry>", 2)
        assert await editor.client.text_document_prepare_rename_async(lsp.PrepareRenameParams(**nothing)) is None


async def test_symbols_and_layout(tmp_path: Path) -> None:
    async with editing(tmp_path, "greeting") as editor:
        editor.open("rules/gaze.xml")
        document = lsp.TextDocumentIdentifier(editor.uri("rules/gaze.xml"))
        symbols = await editor.client.text_document_document_symbol_async(lsp.DocumentSymbolParams(document)) or []
        (rule,) = (each for each in symbols if isinstance(each, lsp.DocumentSymbol))
        assert rule.name == "Gaze"
        assert [each.name for each in rule.children or ()] == ["Nobody", "Following", "Pausing", "Back to default"]
        lines = editor.texts["rules/gaze.xml"].splitlines()
        for each in (rule, *(rule.children or ())):
            named, whole = each.selection_range, each.range
            assert lines[named.start.line][named.start.character : named.end.character] == each.name
            assert lines[whole.start.line].lstrip().startswith("<") and lines[whole.end.line].endswith(">")
            assert whole.start.line <= named.start.line <= whole.end.line
        editor.replace("rules/gaze.xml", "<State ", "<State\n\n\n      ")
        options = lsp.FormattingOptions(tab_size=2, insert_spaces=True)
        laid = await editor.client.text_document_formatting_async(lsp.DocumentFormattingParams(document, options)) or []
        assert len(laid) == 1 and "<State\n\n\n" not in laid[0].new_text


async def test_what_is_explored_is_written_with_help(tmp_path: Path) -> None:
    toml = "scenario.toml"
    async with editing(tmp_path, "greeting") as editor:
        editor.open(toml)
        said = "\n[always]\n\"gone is gone\" = \"not (in('Greeting', 'Nobdy') and runs('R_Greeting'))\"\n"
        editor.replace(toml, "\n[act.R_Nod]", said + "\n[act.R_Nod]")
        await editor.until(toml, ["unknown-state"])
        (found,) = editor.findings[editor.uri(toml)]
        line = editor.texts[toml].splitlines()[found.range.start.line]
        assert line[found.range.start.character : found.range.end.character] == "Nobdy"
        place = editor.place(toml, "'Nobdy", 1)
        proposed = await editor.client.text_document_completion_async(lsp.CompletionParams(**place))
        assert isinstance(proposed, list) and "Nobody" in [each.label for each in proposed]
        titles = await editor.remedies(toml, "Nobdy", 2)
        assert any("Nobody" in title for title in titles)
        editor.replace(toml, "Nobdy", "Nobody")
        await editor.until(toml, [])
        place = editor.place(toml, "runs('R_Greeting", 8)
        told = await editor.client.text_document_hover_async(lsp.HoverParams(**place))
        assert told is not None and isinstance(told.contents, lsp.MarkupContent)
        assert told.contents.value.startswith("**R_Greeting** (act), named in")
        assert 'read as `not (in("Greeting", "Nobody") and runs("R_Greeting"))`' in told.contents.value
        edit = await editor.client.text_document_rename_async(lsp.RenameParams(new_name="R_Hello", **place))
        assert edit is not None and edit.changes is not None
        assert {uri.rpartition("/")[2] for uri in edit.changes} == {"greeting.xml", toml}
        assert len(edit.changes[editor.uri(toml)]) == 2
