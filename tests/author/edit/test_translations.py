"""A translation is one line of its file, and nothing else in the file changes."""

from __future__ import annotations

import tomllib
from difflib import unified_diff
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import (
    AddLanguage,
    AnyEdit,
    RemoveAct,
    RemoveAction,
    RemoveVariant,
    Rename,
    SetParameter,
    SetSetting,
    SetTranslation,
)
from rise_engine.author.edit.plan import EditRefused, Files, Plan, apply_plan
from rise_engine.author.edit.planning import StudyState, plan
from rise_engine.author.edit.translations import follow_texts
from rise_engine.scenario.loader import load
from tests.author.edit.guard import BeyondTheEdit, check_guard
from tests.author.edit.samples import after, state_of, study_state
from tests.author.edit.samples import changed_lines as count_changed_lines
from tests.chance import some

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"
GERMAN = "texts/de.toml"
SPELLINGS = {
    "LF": lambda text: text,
    "CRLF": lambda text: text.replace("\n", "\r\n"),
    "BOM": lambda text: "\ufeff" + text,
    "no line end": lambda text: text.rstrip("\n"),
    "comments": lambda text: text.replace(" }\n", " }  # said calmly\n").replace("\n[", "\n\n# an act\n["),
    "sections": lambda text: text.replace('"2/1" = { text = "Sehr gut!", of = "Very good!" }', "").replace(
        "[R_Yes]", '[R_Praise."2/1"]\ntext = "Sehr gut!"\nof = "Very good!"\n\n[R_Yes]', 1
    ),
    "one table": lambda text: text.replace('"2/1" = { text = "Sehr gut!", of = "Very good!" }', "").replace(
        "[R_Praise]",
        'R_Gone = { "1" = { text = "x", of = "y" } }\n\n[R_Praise]\n'
        "\"2/1\".text = '''Sehr gut!'''\n\"2/1\".of = \"Very good!\"",
        1,
    ),
}


def state(change: str = "LF") -> StudyState:
    loaded = load(LABLINKING)
    text = loaded.files[GERMAN].decode()
    files = {**loaded.files, GERMAN: SPELLINGS[change](text).encode()}
    return StudyState(files=files, checked=loaded, folder=LABLINKING)


def changed_lines(before: Files, after: Files) -> tuple[list[str], list[str]]:
    """Lines that went and lines that came, in the German file; no other may be another one."""
    assert {name for name in before if before[name] != after.get(name)} <= {GERMAN}
    texts = [each[GERMAN].decode().split("\n") for each in (before, after)]
    lines = [*unified_diff(*texts, n=0, lineterm="")][2:]
    return [each[1:] for each in lines if each[0] == "-"], [each[1:] for each in lines if each[0] == "+"]


@pytest.mark.parametrize("spelling", ["LF", "CRLF", "BOM", "no line end", "comments", "sections"])
def test_a_translation_is_one_line(spelling: str) -> None:
    study = state(spelling)
    after = apply_plan(study.files, plan(SetTranslation("de", "R_Praise", "2/1", "  Prima, \n weiter! "), study))
    went, came = changed_lines(study.files, after)
    assert [len(went), len(came)] == [1, 1] and came[0] == went[0].replace("Sehr gut!", "Prima, weiter!")


@pytest.mark.parametrize("text", ['Er sagt "ja".', "Er sagt 'ja' und \"nein\".", "a\\b", "ä € 🙂 \u200f"])
def test_any_text_is_read_back(text: str) -> None:
    study = state()
    files = apply_plan(study.files, plan(SetTranslation("de", "R_Break", "2", text), study))
    assert load(LABLINKING, held=dict(files)).translations["de"].texts["R_Break/2"].template.text == text


@pytest.mark.parametrize("spelling", ["LF", "CRLF", "BOM", "comments"])
def test_what_is_taken_out_and_put_back_is_the_same_file(spelling: str) -> None:
    """Texts within their act, the last of their act, of the first and of the last act of the file."""
    study = state(spelling)
    texts = study.checked.texts
    for text in (*some(texts, 6), *texts[1:3], texts[-1]):
        said = study.checked.translations["de"].texts[text.id].template.text
        without = apply_plan(study.files, plan(SetTranslation("de", text.act, text.key, None), study))
        went, came = changed_lines(study.files, without)
        assert not any(came) and len([line for line in went if "text =" in line]) == 1
        again = StudyState(without, study.checked, study.folder)
        back = apply_plan(without, plan(SetTranslation("de", text.act, text.key, said), again))
        if spelling != "comments":  # the comment beside it has gone with it
            assert back[GERMAN] == study.files[GERMAN], text.id


def test_a_new_language_begins_with_a_file() -> None:
    study = state()
    made = plan(SetTranslation("pt-BR", "R_Break", "2", "Pausa."), study).written
    english = "Let us stop here for a moment. Somebody will be with you shortly."
    assert made == {"texts/pt-BR.toml": f'[R_Break]\n2 = {{ text = "Pausa.", of = "{english}" }}\n'.encode()}


def test_the_same_text_once_more_says_that_it_is_right_still() -> None:
    study = state()
    files = {**study.files, GERMAN: study.files[GERMAN].replace(b'of = "Very good!"', b'of = "Good!"')}
    stale = StudyState(files, study.checked, study.folder)
    made = plan(SetTranslation("de", "R_Praise", "2/1", "Sehr gut!"), stale)
    assert made.says == ("R_Praise/2/1 in de: “Sehr gut!”: it is still right",)
    assert apply_plan(files, made) == study.files


def test_a_translation_without_of_gets_one() -> None:
    study = state()
    files = {**study.files, GERMAN: study.files[GERMAN].replace(b', of = "Very good!"', b"")}
    made = plan(SetTranslation("de", "R_Praise", "2/1", "Sehr gut!"), StudyState(files, study.checked, study.folder))
    assert apply_plan(files, made) == study.files


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (SetTranslation("german", "R_Yes", "2/1", "x"), "`german` is not a language tag; write de"),
        (SetTranslation("de", "R_Yess", "2/1", "x"), "did you mean `R_Yes`?"),
        (SetTranslation("de", "R_Yes", "2", "x"), "the act `R_Yes` has no text `2`; known: `2/1`, `2/2`"),
        (SetTranslation("de", "R_Yes", "2/1", " "), "to have none, remove it"),
        (SetTranslation("de", "R_Yes", "2/9", None), "`R_Yes/2/9` has no translation into `de`"),
        (SetTranslation("fr", "R_Yes", "2/1", None), "`R_Yes/2/1` has no translation into `fr`"),
    ],
)
def test_what_cannot_be_done_is_refused(edit: SetTranslation, sentence: str) -> None:
    with pytest.raises(EditRefused) as refused:
        plan(edit, state())
    assert sentence in str(refused.value)


def test_a_file_that_is_no_toml_is_left_alone() -> None:
    study = state()
    broken = StudyState({**study.files, GERMAN: b"[R_Yes"}, study.checked, study.folder)
    with pytest.raises(EditRefused, match=r"texts/de\.toml cannot be read, so it is not changed"):
        plan(SetTranslation("de", "R_Yes", "2/1", "x"), broken)


def test_a_translation_in_an_inline_table_of_its_act_is_removed_from_it() -> None:
    study = state("one table")
    after = apply_plan(study.files, plan(SetTranslation("de", "R_Gone", "1", None), study))
    assert changed_lines(study.files, after) == (['R_Gone = { "1" = { text = "x", of = "y" } }'], ["R_Gone = {}"])


@pytest.mark.parametrize("spelling", ["LF", "CRLF", "BOM", "comments"])
def test_translations_follow_texts_that_get_another_number_or_go(spelling: str) -> None:
    """As when the first wording of R_Praise is removed, an act goes, and an action gets a second wording."""
    study = state(spelling)
    moved: dict[tuple[str, str], str | None] = {("R_Praise", "2/1"): None}
    moved |= {("R_Praise", f"2/{number}"): f"2/{number - 1}" for number in (2, 3, 4)}
    moved |= {("R_Yes", "2/1"): None, ("R_Yes", "2/2"): None, ("R_Break", "2"): "2/1"}
    after = apply_plan(study.files, Plan(splices=follow_texts(study, moved)))
    before, found = (tomllib.loads(each[GERMAN].decode("utf-8-sig")) for each in (study.files, after))
    praise = list(before["R_Praise"].values())
    assert found["R_Praise"] == dict(zip(("2/1", "2/2", "2/3"), praise[1:], strict=True))
    assert found["R_Break"] == {"2/1": before["R_Break"]["2"]}
    others = set(before) - {"R_Praise", "R_Yes", "R_Break"}
    assert set(found) == {*others, "R_Praise", "R_Break"} and all(found[act] == before[act] for act in others)


# --- the guard, and languages ---------------------------------------------------------------------------------------

YES, NO = b'"Ja, genau."', b'"Ja, das stimmt."'


@pytest.mark.parametrize(
    "edit",
    [
        SetTranslation("de", "R_Praise", "2/1", "Sehr gut!"),
        SetParameter("R_Praise", "2", "message", "Very good!", 0),
        RemoveAct("R_Praise"),
        RemoveVariant("R_Praise", "2", 0),
        Rename("act", "R_Praise", "R_Laud"),
        SetSetting(("title",), "x"),
        AddLanguage("fr"),
        SetParameter("R_Break", "2", "message", None),  # its translation goes with it
    ],
)
def test_no_edit_may_change_the_translation_of_another_text(edit: AnyEdit) -> None:
    before = study_state("lablinking")
    files = apply_plan(before.files, plan(edit, before))
    check_guard([edit], before, state_of(files, "lablinking"))
    assert YES in files[GERMAN]
    files = {**files, GERMAN: files[GERMAN].replace(YES, NO, 1)}
    with pytest.raises(BeyondTheEdit, match=r"de/R_Yes/2/1|translations would change"):
        check_guard([edit], before, state_of(files, "lablinking"))


@pytest.mark.parametrize(
    "edit", [RemoveAct("R_Praise"), RemoveAction("R_Praise", "2"), RemoveVariant("R_Praise", "2", 1)]
)
def test_translations_that_go_with_their_text_are_no_surprise(edit: AnyEdit) -> None:
    study = after(study_state("lablinking"), edit)
    assert "unknown-text" not in {each.code for each in study.checked.errors}


def test_a_language_is_one_line_and_its_first_translation_makes_the_file() -> None:
    before = study_state("lablinking")
    one = after(before, AddLanguage("fr"))
    assert count_changed_lines(before.files, one.files)[1] == 0
    assert tomllib.loads(one.files["scenario.toml"].decode())["languages"] == {"also": ["fr"]}
    assert one.checked.translations["fr"].texts == {}
    two = after(one, AddLanguage("de-x-sie"), SetTranslation("fr", "R_Praise", "2/1", "Très bien !"))
    assert tomllib.loads(two.files["scenario.toml"].decode())["languages"] == {"also": ["fr", "de-x-sie"]}
    assert two.files["texts/fr.toml"].decode().count("Très bien !") == 1


@pytest.mark.parametrize(
    ("language", "sentence"),
    [
        ("german", "`german` is not a language tag; write de"),
        ("DE", "the study is translated into `de` already"),
        (" en ", "the acts are in `en` themselves"),
    ],
)
def test_a_language_that_cannot_be_added_is_refused(language: str, sentence: str) -> None:
    with pytest.raises(EditRefused) as refused:
        plan(AddLanguage(language), study_state("lablinking"))
    assert sentence in str(refused.value)
