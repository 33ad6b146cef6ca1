"""Sessions in another language: what they say, what is kept of it, and that they repeat."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from rise_engine.base.errors import SessionError
from rise_engine.cli.data.reproduce import load_for_robot
from rise_engine.cli.program import main
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.scenario.loader import load
from rise_engine.session.folder import INFO, load_scenario_copy, read_info
from rise_engine.session.journal_format import encode_header, encode_input
from rise_engine.session.recovery import recover
from rise_engine.session.replay import compare_replay

LABLINKING = Path(__file__).parents[2] / "scenarios" / "lablinking"
ACTS = ("R_Welcome", "R_Praise", "R_Praise", "R_Yes", "R_Hesitation", "R_Task1_Step1", "R_Filler_LetMeSee")


def run(folder: Path, *more: str) -> list[dict[str, Any]]:
    """The records of a session in virtual time."""
    acts = [word for act in ACTS for word in ("--act", act)]
    found = CliRunner().invoke(main, ["run", str(folder), "--speed", "max", "--seed", "11", "--json", *acts, *more])
    assert found.exit_code == 0, found.output
    return [json.loads(line) for line in found.stdout.splitlines()]


def begin(folder: Path, sessions: Path, monkeypatch: pytest.MonkeyPatch, **options: Any) -> Path:
    """A session in which nothing happens but its start, and whose engine goes away; its folder."""
    monkeypatch.setenv("RISE_SESSIONS", str(sessions))
    prepared = SessionPreparation(SessionOptions(str(folder), **options), lambda message: None)
    journal = prepared.open_journal(lambda: None, lambda: 0.0)
    journal.append(encode_header("rise-tui test") + encode_input(1, prepared.started))
    assert journal.close()
    prepared.close()
    return prepared.folder


def test_chance_is_the_same_in_every_language() -> None:
    """With one seed the same acts, the same wordings, in the same order; only the words and their length differ."""
    of = {text.template.text: text.of for text in load(LABLINKING).translations["de"].texts.values()}
    english, german = run(LABLINKING), run(LABLINKING, "--language", "de")

    def spoken(records: list[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
        return [
            (r["action"], r["parameters"])
            for r in records
            if r["kind"] == "action" and r["type"] == "Speech" and r["status"] == "started"
        ]

    assert len(spoken(english)) == len(spoken(german)) >= 9
    welcome = {"Hallo, herzlich willkommen! Ich heiße Pepper.": "Hello, and welcome! My name is Pepper."}
    for (id, said), (other, auf_deutsch) in zip(spoken(english), spoken(german), strict=True):
        assert id == other and auf_deutsch.pop("language") == "de" and "language" not in said
        assert (of | welcome)[auf_deutsch["message"]] == said["message"]
    assert [records[0]["language"] for records in (english, german)] == ["en", "de"]
    assert english[0]["scenario_hash"] != german[0]["scenario_hash"]


def test_a_session_keeps_its_translations_and_goes_on_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = shutil.copytree(LABLINKING, tmp_path / "study")
    folder = begin(study, tmp_path / "sessions", monkeypatch, language="de")
    info = read_info(folder)
    assert (info.language, info.allow_untranslated) == ("de", False)
    assert 'language = "de"' in (folder / INFO).read_text("utf-8")
    assert (folder / "scenario/texts/de.toml").read_bytes() == (study / "texts/de.toml").read_bytes()
    (study / "texts/de.toml").write_text("", "utf-8")
    assert load_scenario_copy(folder, info).language == "de"
    assert (
        recover(folder).scenario.acts["R_Break"].actions[1].calls[0].parameters["message"].text.startswith("Lass uns")
    )
    assert load_for_robot(folder, "generic").language == "de"
    assert compare_replay(folder).difference is None


def test_without_its_translations_a_session_does_not_repeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = shutil.copytree(LABLINKING, tmp_path / "study")
    folder = begin(study, tmp_path / "sessions", monkeypatch, language="de")
    (folder / "scenario/texts/de.toml").unlink()
    compared = compare_replay(folder)  # the study's own folder is still the same
    assert any("is still the same and was used" in note for note in compared.notes)
    (study / "texts/de.toml").unlink()
    with pytest.raises(SessionError, match="not in the language `de`"):
        compare_replay(folder)


def test_what_is_not_translated_refuses_the_session_with_a_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = shutil.copytree(LABLINKING, tmp_path / "study")
    german = study / "texts/de.toml"
    lines = german.read_text("utf-8").splitlines(keepends=True)
    german.write_text(
        "".join(line for line in lines if "Goodbye!" not in line and "Take the knife" not in line), "utf-8"
    )
    with pytest.raises(ServeRefused) as refused:
        begin(study, tmp_path / "sessions", monkeypatch, language="de")
    errors = [line for line in refused.value.report.lines if " error untranslated: " in line]
    assert [line.partition("`")[2].partition("`")[0] for line in errors] == [
        "R_Task2_Step3",
        "R_Task3_Step1",
        "R_Goodbye",
    ]
    folder = begin(study, tmp_path / "sessions", monkeypatch, language="de", allow_untranslated=True)
    scenario = load_scenario_copy(folder, read_info(folder))
    said = scenario.acts["R_Goodbye"].actions[4].calls[0].parameters
    assert said["message"].text.endswith("Goodbye!") and said["language"].text == "en"


@pytest.mark.parametrize(("more", "language"), [((), None), (("--language", "en"), "en"), (("--language", "de"), "de")])
def test_what_the_wizard_types_is_said_in_the_language_of_the_session(
    more: tuple[str, ...], language: str | None, tmp_path: Path
) -> None:
    (tmp_path / "tasks.jsonl").write_text(
        '{"at": 0, "function_type": "say", "domain_task_behavior": "Tschüs!"}\n', "utf-8"
    )
    found = next(
        each for each in run(LABLINKING, "--tasks", str(tmp_path / "tasks.jsonl"), *more) if each.get("act") == "say"
    )
    assert found["parameters"] == {"message": "Tschüs!"} | ({"language": language} if language else {})


@pytest.mark.parametrize("command", ["run", "serve"])
def test_what_cannot_be_asked_for_is_refused(command: str) -> None:
    found = CliRunner().invoke(main, [command, str(LABLINKING), "--allow-untranslated"])
    assert found.exit_code == 2 and "--allow-untranslated goes with --language" in found.output
    found = CliRunner().invoke(main, ["run", str(LABLINKING), "--language", "fr"])
    assert found.exit_code == 1 and "this study is not in the language `fr`; it is in `en`, `de`" in found.output


def test_a_check_in_a_language() -> None:
    found = CliRunner().invoke(main, ["check", str(LABLINKING), "--language", "de"])
    assert found.exit_code == 0 and found.output.startswith("no errors or warnings (")
