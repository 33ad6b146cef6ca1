"""In which language a session of a study is: a factor, a stratum or a column called `language` says it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.study.review import review_study
from rise_engine.study.state import read_state

from .studies import DESIGN, HEAD, PEOPLE, write_study

LANGUAGES = ("en", "de", "")
COLUMN = DESIGN + '\n[participants]\ncolumns = ["language"]\n'
STRATUM = DESIGN.replace("spare", 'strata = ["language"]\nspare') + '\n[strata]\nlanguage = ["en", "de"]\n'
FACTOR = DESIGN.replace(
    "[assignment]",
    '[factors.language]\nkind = "between"\nlabel_only = true\nlevels.en = {}\nlevels.de = {}\n\n[assignment]',
)


def people(*, everybody: bool = False) -> str:
    """P01 in English, P02 in German, P03 says nothing, and so on."""
    rows = PEOPLE.splitlines()
    tags = LANGUAGES[:2] if everybody else LANGUAGES
    return HEAD.strip() + ",language\n" + "".join(f"{row},{tags[n % len(tags)]}\n" for n, row in enumerate(rows))


def translate(folder: Path) -> None:
    (folder / "scenario/texts").mkdir()
    (folder / "scenario/texts/de.toml").write_text('[Greet]\n1 = { text = "Hallo!", of = "Hello!" }\n', "utf-8")
    (folder / "scenario/scenario.toml").write_text('title = "Sample"\nlanguage = "en"\nrobot = "generic"\n', "utf-8")


def language_of(folder: Path, participant: str, **more: object) -> str:
    """That of the session which would begin now."""
    options = SessionOptions("", study=str(folder), participant=participant, **more)  # type: ignore[arg-type]
    prepared = SessionPreparation(options, lambda message: None)
    prepared.close()
    message = prepared.scenario.acts["Greet"].actions[0].calls[0].parameters["message"].text
    assert message == ("Hallo!" if prepared.language == "de" else "Hello!")
    return prepared.language


@pytest.mark.parametrize("design", [COLUMN, STRATUM])
def test_a_column_says_it(tmp_path: Path, design: str) -> None:
    folder = tmp_path / "study"
    write_study(folder, design, people(everybody=design == STRATUM))
    assert language_of(folder, "P02") == ""  # nothing is translated: the column is one like any other
    translate(folder)
    assert [language_of(folder, name) for name in ("P01", "P02")] == ["en", "de"]
    if design == COLUMN:
        assert language_of(folder, "P03") == ""


def test_a_factor_says_it(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    write_study(folder, FACTOR)
    translate(folder)
    row = read_state(folder).plan[0]
    assert language_of(folder, "P01") == row.levels["language"]


def test_nobody_gives_a_session_that_counts_another_language(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    write_study(folder, COLUMN, people())
    translate(folder)
    with pytest.raises(ServeRefused, match=r"'en' is not the language of P02: the study says 'de'"):
        language_of(folder, "P02", language="en")
    assert language_of(folder, "P02", language="de") == "de"
    assert language_of(folder, "P03", language="de") == "de"
    assert language_of(folder, "P02", language="en", purpose="pilot") == "en"


def test_a_language_that_there_is_not_refuses_the_session(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    write_study(folder, COLUMN, people().replace(",de\n", ",fr\n"))
    translate(folder)
    with pytest.raises(ServeRefused) as refused:
        language_of(folder, "P02")
    assert "this study is not in the language `fr`; it is in `en`, `de`" in refused.value.report.lines[0]


@pytest.mark.parametrize(("design", "is_error"), [(STRATUM, True), (FACTOR, True), (COLUMN, False)])
def test_a_translation_that_is_missing_as_a_whole(tmp_path: Path, design: str, is_error: bool) -> None:
    folder = tmp_path / "study"
    write_study(folder, design, HEAD + PEOPLE if design == FACTOR else people(everybody=True))
    translate(folder)
    assert review_study(folder).errors == []
    (folder / "scenario/texts/de.toml").unlink()
    told = "unknown-language: the scenario scenario is not in the language `de`; it is in `en`"
    assert [told in str(each) for each in review_study(folder).errors] == [True] * is_error
    if design == STRATUM:
        with pytest.raises(ServeRefused, match="this study is not in the language `de`; it is in `en`"):
            language_of(folder, "P02")
    if design != FACTOR:
        assert language_of(folder, "P01") == language_of(folder, "P02", purpose="pilot") == ""


def test_the_study_is_checked_before_the_first_session(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    write_study(folder, COLUMN, people().replace("P05,2026-11-06,,,de", "P05,2026-11-06,,,fr"))
    assert review_study(folder).errors == []  # nothing is translated, so the column is one like any other
    translate(folder)
    assert [str(each) for each in review_study(folder).errors] == [
        "participants.csv:6:1: error unknown-language: the scenario scenario is not in the language `fr`; it is in "
        "`en`, `de`"
    ]
    (folder / "scenario/texts/de.toml").write_text("", "utf-8")
    assert (
        "not-translated: sessions in `de` are refused: a text of `Greet` is not translated into `de`: 1"
        in "\n".join(str(each) for each in review_study(folder).errors)
    )
