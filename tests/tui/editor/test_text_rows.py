"""The texts of a study as rows, without a screen."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.author.edit.edits import AnyEdit, SetParameter, SetTranslation, SetUseParameter
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.model.draft import FilePlace, StudyDraft, draft_of
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.model.text_rows import (
    TextEntry,
    TextState,
    TextsView,
    column_line,
    confirmation_edits,
    count_texts,
    entry_head,
    folder_from,
    head_line,
    languages_of,
    note_lines,
    original_edits,
    original_lines,
    own_language,
    place_of,
    session_note,
    shown_entries,
    speaking_seconds,
    text_entries,
    text_rows,
    translation_edits,
    translation_lines,
    view_named,
)
from rise_tui.rendering.text import line_width, plain_text
from tests.tui.editor.texts_study import MISSING, STALE, copy_lablinking, replace


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return copy_lablinking(tmp_path / "lab")


@pytest.fixture
def draft(folder: Path) -> StudyDraft:
    return draft_of(Workspace(folder))


def entry(draft: StudyDraft, id: str, language: str = "de") -> TextEntry:
    return next(each for each in text_entries(draft, language) if each.text.id == id)


@pytest.mark.parametrize(
    ("id", "state", "said"),
    [
        ("R_Praise/2/2", "there", "Gut gemacht!"),
        (STALE, "stale", "Sehr gut!"),
        (MISSING, "missing", ""),
    ],
)
def test_a_text_says_what_its_translation_is(draft: StudyDraft, id: str, state: TextState, said: str) -> None:
    found = entry(draft, id)
    assert (found.state, found.translated) == (state, said)


def test_texts_are_counted_and_without_a_language_none_lacks_anything(draft: StudyDraft) -> None:
    entries = text_entries(draft, "de")
    assert count_texts(entries) == (len(entries) - 2, 1, 0, 1, len(entries))
    assert {each.state for each in text_entries(draft, "")} == {"not needed"}
    assert (own_language(draft), languages_of(draft)) == ("en", ("de",))


@pytest.mark.parametrize(
    ("view", "ids"),
    [
        (TextsView("de", only=True), [STALE, MISSING]),
        (TextsView("de", wanted="VERY WELL DONE"), [STALE]),
        (TextsView("de", wanted="das stimmt"), ["R_Yes/2/2"]),
        (TextsView("de", wanted="praise/2/3"), ["R_Praise/2/3"]),
        (TextsView("de", only=True, wanted="das stimmt"), []),
    ],
)
def test_what_is_shown(draft: StudyDraft, view: TextsView, ids: list[str]) -> None:
    assert [each.text.id for each in shown_entries(text_entries(draft, "de"), view)] == ids


def test_all_texts_are_shown_in_the_order_of_the_acts(draft: StudyDraft) -> None:
    shown = shown_entries(text_entries(draft, "de"), TextsView("de"))
    assert [each.text.id for each in shown] == [each.id for each in draft.checked.texts]


@pytest.mark.parametrize("width", [60, 79, 99, 100, 119, 199])
@pytest.mark.parametrize("language", ["", "de"])
def test_lines_keep_within_their_width_and_a_long_text_is_there_whole(folder: Path, width: int, language: str) -> None:
    long = "Das ist ein sehr langer Satz, der nicht in eine Zeile passt. " * 12
    workspace = Workspace(folder)
    workspace.apply(SetTranslation("de", "R_Praise", "2/2", long), SetParameter("R_Praise", "2", "message", long, 1))
    draft, view = draft_of(workspace), TextsView(language)
    entries = text_entries(draft, language)
    rows = text_rows(draft, view, entries, 1, width)
    assert {line_width(row.line) for row in rows} <= {width, width - 1}, "the columns stand below each other"
    assert line_width(column_line(draft, view, 1, width)) <= width
    assert line_width(head_line(draft, view, entries, 3, width)) <= width
    for each in entries[:8]:
        lines = [
            entry_head(draft, each, width),
            *original_lines(draft, each, width, is_marked=True),
            *translation_lines(draft, each, language or "de", width, is_marked=False),
            *note_lines(draft, each, language, "lab", width),
        ]
        assert max(map(line_width, lines)) <= width
    shown = translation_lines(draft, entry(draft, "R_Praise/2/2"), "de", width, is_marked=True)
    words = [word for line in shown for word in plain_text(line).split()]
    assert words[0] == "▸de" and [word for word in words if word in long.split()] == long.split()


def test_rows_have_their_marks_and_an_act_is_named_once(draft: StudyDraft) -> None:
    rows = text_rows(draft, TextsView("de"), text_entries(draft, "de"), 1, 79)
    lines = {row.id: plain_text(row.line) for row in rows}
    assert lines[STALE].startswith(" R_Praise ") and "▲ Sehr gut!" in lines[STALE]
    assert "R_Praise" not in lines[MISSING] and "✗ –" in lines[MISSING]
    assert "✓ Gut gemacht!" in lines["R_Praise/2/2"]
    wide = text_rows(draft, TextsView("de"), text_entries(draft, "de"), 1, 119)
    assert "at once" in plain_text(wide[0].line) and "enthusiastic" in plain_text(wide[0].line)


def test_a_stale_text_says_of_what_it_was_and_how_a_session_is_started(draft: StudyDraft) -> None:
    text = " ".join(plain_text(line).strip() for line in note_lines(draft, entry(draft, STALE), "de", "my lab", 80))
    assert "It was “Very good!”. s: it is still right" in text
    assert "rise-tui --config 'my lab' --language de; refused now: 1 text missing" in text


def test_in_a_study_of_many_sessions_the_list_of_participants_says_the_language(folder: Path) -> None:
    (folder / "study.toml").write_text('[study]\nname = "x"\n')
    assert "from the column `language` of participants.csv" in session_note(draft_of(Workspace(folder)), "de", "lab")


@pytest.mark.parametrize(
    ("here", "folder", "named"), [("/a", "/a/lab", "lab"), ("/a/lab", "/a/lab", "."), ("/b", "/a/lab", "/a/lab")]
)
def test_a_folder_as_a_command_names_it(here: str, folder: str, named: str) -> None:
    assert folder_from(Path(here), folder) == named


def test_a_longer_translation_takes_longer(draft: StudyDraft) -> None:
    found = entry(draft, "R_Apology/5")
    assert found.translation is not None
    own = speaking_seconds(draft.checked, found.text, found.text.template)
    assert own < speaking_seconds(draft.checked, found.text, found.translation.template)


def test_a_translation_with_other_memory_values_is_wrong(folder: Path) -> None:
    replace(folder / "texts" / "de.toml", '"Gut gemacht!"', '"Gut gemacht, {person_name}!"')
    draft = draft_of(Workspace(folder))
    found = entry(draft, "R_Praise/2/2")
    assert found.state == "wrong" and count_texts(text_entries(draft, "de"))[:4] == (69, 1, 1, 1)
    assert found in shown_entries(text_entries(draft, "de"), TextsView("de", only=True))
    said = " ".join(plain_text(line).strip() for line in note_lines(draft, found, "de", "lab", 100))
    assert "✗ the translation has {person_name}, which the text does not have" in said
    assert "refused now: 1 text missing and 1 text wrong" in said


# --- edits ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("id", "column", "said", "edits"),
    [
        (MISSING, 1, " Das sieht\n toll aus. ", (SetTranslation("de", "R_Praise", "2/4", "Das sieht toll aus."),)),
        (MISSING, 1, "", ()),
        (STALE, 1, "Sehr gut!", ()),
        (STALE, 1, "  ", (SetTranslation("de", "R_Praise", "2/1", None),)),
        (STALE, 0, "Very well done!", ()),
        (STALE, 0, "Splendid!", (SetParameter("R_Praise", "2", "message", "Splendid!", 0),)),
    ],
)
def test_what_is_typed_becomes_an_edit(
    draft: StudyDraft, id: str, column: int, said: str, edits: tuple[AnyEdit, ...]
) -> None:
    found = entry(draft, id)
    made = original_edits(draft, found, said) if column == 0 else translation_edits(found, "de", said)
    assert made == edits


def test_an_act_says_something(draft: StudyDraft) -> None:
    with pytest.raises(EditRefused, match="on the act's page"):
        original_edits(draft, entry(draft, STALE), " ")


def test_a_text_with_a_comment_in_it_is_changed_in_its_file(folder: Path) -> None:
    replace(folder / "acts" / "feedback.xml", "Very well done!", "Very <!-- so --> well done!")
    draft = draft_of(Workspace(folder))
    with pytest.raises(EditRefused, match=r"e opens acts/feedback\.xml, line \d+"):
        original_edits(draft, entry(draft, STALE), "Fine.")


def test_a_text_of_a_template_is_changed_where_it_is_used(folder: Path) -> None:
    (folder / "acts" / "more.xml").write_text(
        '<Dialogs><Template name="Say"><parameter name="act"/><parameter name="words"/><Dialog name="${act}"><Speech>'
        "<actionID>1</actionID><message>${words}</message></Speech></Dialog></Template>\n"
        '<use template="Say" act="R_More" words="More."/></Dialogs>'
    )
    draft = draft_of(Workspace(folder))
    edit = SetUseParameter("acts/more.xml", 2, "Say", "words", "Less.")
    assert original_edits(draft, entry(draft, "R_More/1"), "Less.") == (edit,)


def test_only_a_stale_translation_with_the_same_slots_is_right_still(folder: Path) -> None:
    draft = draft_of(Workspace(folder))
    edits = confirmation_edits(entry(draft, STALE), "de")
    assert edits == (SetTranslation("de", "R_Praise", "2/1", "Sehr gut!"),)
    workspace = Workspace(folder)
    workspace.apply(*edits)
    assert entry(draft_of(workspace), STALE).state == "there"
    for id in (MISSING, "R_Praise/2/2"):
        with pytest.raises(EditRefused, match="is not of an earlier text"):
            confirmation_edits(entry(draft, id), "de")
    replace(folder / "acts" / "feedback.xml", "Very well done!", "Very well done, {person_name}!")
    with pytest.raises(EditRefused, match=r"cannot still be right: the translation leaves out \{person_name\}"):
        confirmation_edits(entry(draft_of(Workspace(folder)), STALE), "de")


# --- places ---------------------------------------------------------------------------------------------------------


def test_a_finding_in_a_file_of_translations_leads_to_its_text(draft: StudyDraft) -> None:
    stale = next(each for each in draft.findings if each.code == "stale-translation")
    found = find_at(draft, stale.location.file, stale.location.line)
    assert found is not None and found[0] == "texts"
    assert view_named(found[1]) == TextsView("de", STALE)
    assert view_named(TextsView("de", STALE, True, "x").name) == TextsView("de", STALE, True, "x")


def test_where_a_text_and_its_translation_stand(draft: StudyDraft) -> None:
    lines = draft.files["texts/de.toml"].decode().splitlines()
    for id, column, file, has in (
        (STALE, 1, "texts/de.toml", "Sehr gut!"),
        (MISSING, 1, "texts/de.toml", "[R_Praise]"),
    ):
        place = place_of(draft, entry(draft, id), "de", column)
        assert place.file == file
        if column:
            assert has in lines[place.line - 1]
    assert place_of(draft, entry(draft, STALE, ""), "", 0) == FilePlace("acts/feedback.xml", 10, 10)
