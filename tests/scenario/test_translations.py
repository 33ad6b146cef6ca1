"""Translations are read, compared with what the acts say, and put in its place (docs/reference/languages.md)."""

from __future__ import annotations

import re
from hashlib import sha256
from pathlib import Path

import pytest

from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.speech.spoken_texts import spoken_texts
from tests.scenario.folders import act, folder, found

LABLINKING = Path(__file__).parents[2] / "scenarios" / "lablinking"
ACTS = act(
    """<Speech><actionID>1</actionID><message>Hello, {name|you}!</message></Speech>
<Variants><actionID>2</actionID><Speech><message>Good.</message></Speech>
  <Speech><message>Well
     done.</message></Speech></Variants>
<Speech><actionID>3</actionID><message>{sentence}</message></Speech>
<Speech><actionID>4</actionID><message>Voilà!</message><language>fr</language></Speech>
<Speech><actionID>5</actionID><message>Right.</message><language>en-GB</language></Speech>"""
)
TOML = 'language = "en"\nrobot = "generic"\n'
GERMAN = """[A]
1 = { text = "Hallo, {name|du}!", of = "Hello, {name|you}!" }
"2/1" = { text = "Gut.", of = "Good." }
"2/2" = { text = "Gut gemacht.", of = "Well done." }
5 = { text = "Richtig.", of = "Right." }
"""
MEMORY = '{"name": "Ada", "sentence": "Los."}'


def study(german: str | None = GERMAN, toml: str = TOML, acts: str = ACTS) -> dict[str, bytes | None]:
    texts = {"scenario.toml": toml, "acts/a.xml": acts, "memory.json": MEMORY}
    files: dict[str, bytes | None] = {name: text.encode() for name, text in texts.items()}
    return files if german is None else {**files, "texts/de.toml": german.encode()}


def read(files: dict[str, bytes | None], language: str | None = None, *, allow: bool = False) -> LoadResult:
    return load("nowhere", held=files, language=language, allow_untranslated=allow)


def said(scenario: Scenario | None) -> dict[str, tuple[str, str]]:
    """Text and language of everything that is said, by the key of the text."""
    assert scenario is not None
    texts = spoken_texts(scenario.acts.values(), scenario.robot)
    return {
        text.key: (text.text, language.text if (language := text.call.parameters.get("language")) else "")
        for text in texts
    }


def test_a_session_speaks_the_language_that_was_asked_for() -> None:
    result = read(study(), "de")
    assert found(result) == [] and result.scenario is not None
    assert said(result.scenario) == {
        "1": ("Hallo, {name|du}!", "de"),
        "2/1": ("Gut.", "de"),
        "2/2": ("Gut gemacht.", "de"),
        "3": ("{sentence}", "de"),
        "4": ("Voilà!", "fr"),
        "5": ("Richtig.", "de"),
    }
    assert result.scenario.language == "de" and result.scenario.says_language
    assert result.scenario.languages == ("de",)


def test_without_a_language_nothing_is_different_from_a_study_without_translations() -> None:
    plain, translated = read(study(None)).scenario, read(study()).scenario
    assert plain is not None and translated is not None
    assert plain.acts == translated.acts and plain.language == translated.language == "en"
    assert not translated.says_language and said(plain)["1"] == ("Hello, {name|you}!", "")


def test_the_language_of_the_acts_can_be_asked_for() -> None:
    """A robot that spoke German in the session before is told so."""
    assert said(read(study(), "en").scenario)["1"] == ("Hello, {name|you}!", "en")
    assert said(read(study(None), "en").scenario)["5"] == ("Right.", "en-GB")


def test_the_hash_is_of_what_was_read_and_of_the_language_that_was_asked_for() -> None:
    """Reckoned here anew: that of a study without translations is what it was before there were languages."""
    files = read(study(None)).files
    assert sorted(files) == ["acts/a.xml", "memory.json", "robots/generic.toml", "scenario.toml"]
    digest = sha256()
    for name, data in [*sorted(files.items()), ("robot", b"generic")]:
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    plain = read(study(None)).scenario
    assert plain is not None and plain.hash == digest.hexdigest()
    hashes = {each.hash for each in (plain, *(read(study(), tag).scenario for tag in (None, "de", "en"))) if each}
    assert len(hashes) == 4


def test_what_is_missing_refuses_the_session_in_that_language_alone() -> None:
    files = study(GERMAN.replace('"2/2"', "# gone: "))
    assert found(read(files)) == ["acts/a.xml:1:1 untranslated"] and read(files).scenario is not None
    refused = read(files, "de")
    assert refused.scenario is None and refused.errors[0].code == "untranslated"
    assert refused.errors[0].message == "a text of `A` is not translated into `de`: 2/2, “Well done.”"


def test_what_is_missing_can_be_said_in_the_language_of_the_acts() -> None:
    """And the robot is told which language that is, action by action."""
    texts = said(read(study(GERMAN.replace('"2/2"', "# gone: ")), "de", allow=True).scenario)
    assert (texts["2/1"], texts["2/2"]) == (("Gut.", "de"), ("Well done.", "en"))


WRONG: dict[str, tuple[str, list[str]]] = {
    "fine": (GERMAN, []),
    "another text since": (GERMAN.replace("Right.", "Wrong."), ["texts/de.toml:5:1 stale-translation"]),
    "no such act": (f"{GERMAN}[B]\n", ["texts/de.toml:6:2 unknown-text"]),
    "no such text": (f'{GERMAN}"2/3" = {{ text = "x", of = "y" }}', ["texts/de.toml:6:1 unknown-text"]),
    "variants now": (GERMAN.replace('"2/1"', "2"), ["acts/a.xml:1:1 untranslated", "texts/de.toml:3:1 unknown-text"]),
    "slot left out": (GERMAN.replace("{name|du}", "du"), ["texts/de.toml:2:14 slot-differs"]),
    "another slot": (GERMAN.replace("{name|du}", "{nam|du}"), ["texts/de.toml:2:14 slot-differs"]),
    "no fallback": (GERMAN.replace("{name|du}", "{name}"), ["texts/de.toml:2:14 slot-differs"]),
    "slot of a stale text": (
        GERMAN.replace("{name|du}", "du").replace("Hello,", "Hi,"),
        ["texts/de.toml:2:1 stale-translation"],
    ),
    "brace": (GERMAN.replace("du}", "du"), ["acts/a.xml:1:1 untranslated", "texts/de.toml:2:14 template"]),
    "SSML": (GERMAN.replace("Gut.", "<speak>Gut."), ["texts/de.toml:3:18 ssml"]),
    "a bare text": (
        GERMAN.replace('{ text = "Gut.", of = "Good." }', '"Gut."'),
        ["acts/a.xml:1:1 untranslated", "texts/de.toml:3:9 wrong-type"],
    ),
    "without of": (
        GERMAN.replace(', of = "Good."', ""),
        ["acts/a.xml:1:1 untranslated", "texts/de.toml:3:1 missing-value"],
    ),
    "unknown key": (GERMAN.replace('of = "Good."', 'of = "Good.", off = 1'), ["texts/de.toml:3:40 unknown-key"]),
    "no TOML": ("[A\n", ["acts/a.xml:1:1 untranslated", "texts/de.toml:1:3 toml-syntax"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_found_at_its_place(name: str) -> None:
    german, expected = WRONG[name]
    assert found(read(study(german))) == expected


def test_slots_of_a_stale_translation_count_when_it_is_to_be_said() -> None:
    files = study(WRONG["slot of a stale text"][0])
    assert [each.code for each in read(files, "de").errors] == ["slot-differs"]


@pytest.mark.parametrize(
    ("name", "toml", "expected"),
    [
        ("texts/german.toml", TOML, "texts/german.toml:1:1 unknown-language"),
        ("texts/en.toml", TOML, "texts/en.toml:1:1 wrong-value"),
        ("texts/DE.toml", TOML, "texts/de.toml:1:1 duplicate-name"),
        ("texts/fr.toml", TOML.partition("\n")[2], "texts/de.toml:1:1 no-language"),
    ],
)
def test_files_are_called_as_their_language(name: str, toml: str, expected: str) -> None:
    assert expected in found(read({**study(toml=toml), name: b""}))


def test_a_language_that_there_is_not() -> None:
    message = read(study(), "fr").errors[0].message
    assert message == "this study is not in the language `fr`; it is in `en`, `de`"
    assert "write its language in scenario.toml" in read(study(None, ""), "fr").errors[0].message


def test_languages_that_are_wanted_have_no_file_yet() -> None:
    result = read(study(None, f'{TOML}[languages]\nalso = ["de", "xx", "en"]'))
    assert found(result) == [
        "acts/a.xml:1:1 untranslated",
        "scenario.toml:4:15 unknown-language",
        "scenario.toml:4:21 wrong-value",
    ]
    assert "`language = " in read(study(None, '[languages]\ndefault = "de"')).errors[0].message


def test_many_acts_without_translation_are_told_in_one_sentence_until_a_session_wants_them(tmp_path: Path) -> None:
    acts = "".join(act("<Speech><actionID>1</actionID><message>Hi</message></Speech>", f"A{n}") for n in range(7))
    path = folder(tmp_path, {"scenario.toml": TOML, "acts/a.xml": f"<Dialogs>{acts}</Dialogs>", "texts/de.toml": ""})
    assert found(load(path)) == ["texts/de.toml:1:1 untranslated"]
    assert len(load(path, language="de").errors) == 7


def test_a_parameter_of_a_robot_is_translated_when_it_is_declared() -> None:
    toml = TOML + (
        '[actions.Sing]\nparameters.words = { type = "text", spoken = true }\nparameters.tune = { type = "text" }\n'
        '[actions.Hum]\nchannels = ["speech"]\nparameters.message = { type = "text" }\n'
        '[actions.Move]\nparameters.far = { type = "number", spoken = true }\n'
    )
    acts = act(
        "<Sing><actionID>1</actionID><words>La</words><tune>c</tune></Sing>"
        "<Hum><actionID>2</actionID><message>Hm</message></Hum>"
    )
    result = read(
        study("[A]\n'1/words' = { text = 'Tra', of = 'La' }\n2 = { text = 'Ähm', of = 'Hm' }", toml, acts), "de"
    )
    assert found(result) == ["scenario.toml:10:46 wrong-type"]
    assert [text.key for text in result.texts] == ["1/words", "2"]


def test_two_texts_of_one_name() -> None:
    acts = act(
        "<Speech><actionID>2/1</actionID><message>a</message></Speech>\n<Variants><actionID>2</actionID>"
        "<Speech><message>b</message></Speech><Speech><message>c</message></Speech></Variants>"
    )
    assert "acts/a.xml:3:1 duplicate-id" in found(read(study("", acts=acts)))
    assert found(read(study(None, acts=acts))) == []


def test_lablinking_is_said_in_german() -> None:
    german, english = load(LABLINKING, language="de"), load(LABLINKING)
    assert german.diagnostics == english.diagnostics == []
    assert german.scenario is not None and english.scenario is not None
    spoken, written = (
        list(spoken_texts(each.scenario.acts.values(), each.scenario.robot)) for each in (german, english)
    )
    assert len(spoken) == len(written) == 72
    same = [text.id for text, original in zip(spoken, written, strict=True) if text.text == original.text]
    assert same == ["R_Filler_Hm/1/1", "R_Filler_Hm/1/2"]


# --- tables -----------------------------------------------------------------------------------------------------------

SAYS = act("<Speech><actionID>1</actionID><message>{items[i].text}</message></Speech>")
ALSO = TOML + '[languages]\nalso = ["de"]\n'


def with_table(csv: str, toml: str = ALSO, acts: str = SAYS, **more: str) -> dict[str, bytes | None]:
    texts = {"scenario.toml": toml, "acts/a.xml": acts, "memory.json": '{"i": 0}', "tables/items.csv": csv, **more}
    return {name: text.encode() for name, text in texts.items()}


def records(result: LoadResult) -> list[dict[str, object]]:
    assert result.scenario is not None, result.diagnostics
    return result.scenario.tables["items"].records


def test_a_table_has_a_column_for_each_language() -> None:
    files = with_table("id,text,text.de,limit,limit.de\n1,cup,Tasse,2,3\n2,plate,Teller,2,\n")
    own = [{"id": 1, "text": "cup", "limit": 2}, {"id": 2, "text": "plate", "limit": 2}]
    german = [{"id": 1, "text": "Tasse", "limit": 3}, {"id": 2, "text": "Teller", "limit": 2}]
    assert found(read(files)) == []
    assert [records(read(files, each)) for each in (None, "en", "de")] == [own, own, german]
    assert read(files, "de").scenario.hash != read(files).scenario.hash  # type: ignore[union-attr]
    assert set(read(files).files) >= {"tables/items.csv"}  # so a session's folder keeps it


def test_every_column_that_a_computed_name_can_mean_is_translated() -> None:
    says = act("<Speech><actionID>1</actionID><message>{items[i][wording]}</message></Speech>")
    files = with_table("id,direct,polite,polite.de\na1,Your name?,And you are?,Und Sie?\n", acts=says)
    (missing,) = [each.message for each in read(files, "de").errors]
    assert "it has no column `direct.de` beside `direct`, which is spoken" in missing


@pytest.mark.parametrize(
    ("csv", "place", "message"),
    [
        ("text,text.de\ncup,Tasse\nplate,\nx,\n", "3:7", "has no `text.de` in rows 2 (“plate”), 3 (“x”)"),
        ("id,text\n1,cup\n", "1:1", "it has no column `text.de` beside `text`, which is spoken"),
    ],
)
def test_what_a_table_does_not_translate_refuses_the_session_unless_it_is_allowed(
    csv: str, place: str, message: str
) -> None:
    files = with_table(csv)
    for language, allow, severity in ((None, False, "warning"), ("de", True, "warning"), ("de", False, "error")):
        result = read(files, language, allow=allow)
        (diagnostic,) = result.diagnostics
        assert (diagnostic.severity, diagnostic.code) == (severity, "untranslated")
        assert str(diagnostic.location) == f"tables/items.csv:{place}" and message in diagnostic.message
    assert records(read(files, "de", allow=True))[-1]["text"] in ("cup", "x")


@pytest.mark.parametrize(
    ("csv", "toml", "finding", "message"),
    [
        ("text,txt.de\ncup,Tasse\n", ALSO, "1:6 table-form", "there is no column `txt`; did you mean `text`?"),
        ("text,text.de,text.DE\ncup,a,b\n", ALSO, "1:14 table-form", "another column has `text` in the language `de`"),
        ("id,text,text.de\n1,,Tasse\n", ALSO, "2:4 table-value", "nothing in `text` that this could translate"),
        ("n,n.de,text,text.de\n1,eins,a,b\n", ALSO, "2:3 table-value", "`n.de` is a number"),
        ("text,text.fr,text.de\ncup,a,b\n", ALSO, "1:6 language-column", 'add "fr" to `also` under [languages]'),
        ("text,text.german,text.de\ncup,a,b\n", ALSO, "1:6 language-column", "call it `text.de`"),
        ("text,text.en,text.de\ncup,a,b\n", ALSO, "1:6 language-column", "is in `en` itself"),
    ],
)
def test_what_is_wrong_with_the_languages_of_a_table(csv: str, toml: str, finding: str, message: str) -> None:
    result = read(with_table(csv, toml))
    assert found(result) == [f"tables/items.csv:{finding}"]
    assert message in result.diagnostics[0].message


def test_columns_with_dots_are_as_they_were_where_nobody_can_mean_a_language() -> None:
    files = with_table("text,rt,rt.sd,text.old\ncup,1,2,x\n", TOML)
    assert found(read(files)) == [] and records(read(files)) == [{"text": "cup", "rt": 1, "rt.sd": 2, "text.old": "x"}]


def test_a_table_in_another_language_has_no_file_of_its_own() -> None:
    files = with_table("text,text.de\ncup,Tasse\n") | {"tables/items.de.csv": b"text\nTasse\n"}
    (diagnostic,) = read(files).diagnostics
    assert str(diagnostic.location) == "tables/items.de.csv:1:1"
    assert (
        "put its `de` into tables/items.csv" in diagnostic.message and "`text.de` beside `text`" in diagnostic.message
    )


def test_a_rule_cannot_name_the_column_of_a_language() -> None:
    acts = act('<Speech><actionID>1</actionID><message>{items[i]["text.de"]}</message></Speech>')
    assert "has no column `text.de`" in read(with_table("text,text.de\ncup,Tasse\n", acts=acts)).diagnostics[0].message


def test_the_page_shows_a_text_by_condition_and_language() -> None:
    page = (LABLINKING.parents[1] / "docs/reference/languages.md").read_text("utf-8")
    csv = page.split("`tables/items.csv`:")[1].split("```")[1].lstrip("\n")
    toml, acts = (re.findall(rf"```{kind}\n(.*?)```", page.split("## Tables")[1], re.S)[0] for kind in ("toml", "xml"))
    for language, condition, expected in (
        ("en", "polite", "Could you pass me the cup, please?"),
        ("de", "polite", "Könntest du mir bitte die Tasse geben?"),
        ("en", "direct", "Pass me the cup."),
        ("de", "direct", "Gib mir die Tasse."),
    ):
        scenario = read(with_table(csv, toml, acts), language).scenario
        assert scenario is not None
        memory = {**scenario.memory, **scenario.conditions[condition].memory, **scenario.table_memory}
        assert scenario.acts["R_Ask"].actions[0].calls[0].parameters["message"].fill(memory) == expected
