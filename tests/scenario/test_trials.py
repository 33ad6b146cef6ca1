"""`[trials]` of scenario.toml: what it may say, what is wrong with it, and who names what in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.author.lsp.completion import proposals
from rise_engine.results.export.trial_tables import TRIALS
from rise_engine.scenario.explore_settings import MEASURES, fits_state
from rise_engine.scenario.loader import load

RULES = """<InteractionRules>
  <InteractionRule name="Quiz" initial="Ask"><State id="Ask"><transition eventTopic="/x" target="Rest"/></State>
    <State id="Rest"><transition eventTopic="/x" target="Ask"/></State></InteractionRule>
  <InteractionRule name="Other" initial="Rest"><State id="Rest"/></InteractionRule>
</InteractionRules>"""
MEMORY = '{"i": 0, "items": [{"text": "a"}]}'


def scenario(folder: Path, trials: str) -> Path:
    (folder / "acts").mkdir(parents=True)
    (folder / "rules").mkdir()
    (folder / "acts" / "a.xml").write_text('<Dialogs><Dialog name="A"/></Dialogs>', "utf-8")
    (folder / "rules" / "r.xml").write_text(RULES, "utf-8")
    (folder / "memory.json").write_text(MEMORY, "utf-8")
    keys = '[keys]\nq = { rule = "Quiz" }\no = { rule = "Other" }\nx = { event = "/x" }\ni = { set = "i = i + 1" }\n'
    (folder / "scenario.toml").write_text(f"{keys}[trials]\n{trials}\n", "utf-8")
    return folder


def test_it_is_read(tmp_path: Path) -> None:
    loaded = load(scenario(tmp_path / "s", 'state = "Ask"\ncolumns = ["i", "items[i].text"]\nmeasure = "key_s"'))
    assert loaded.scenario is not None and (trials := loaded.scenario.trials) is not None
    assert ([each.text for each in trials.columns], trials.measure) == (["i", "items[i].text"], "key_s")
    assert trials.begins_at("Quiz", "Ask") and not trials.begins_at("Quiz", "Rest")
    assert trials.speech == ""


def test_the_event_of_the_participants_speech_is_read_and_a_use(tmp_path: Path) -> None:
    loaded = load(scenario(tmp_path / "s", 'state = "Ask"\nspeech = "/speech_begins"'))
    assert loaded.scenario is not None and loaded.scenario.trials is not None
    assert loaded.scenario.trials.speech == "speech_begins"
    uses = loaded.uses.of("event", "speech_begins")
    assert [(each.place.file, each.place.line, each.place.column) for each in uses] == [("scenario.toml", 8, 12)]


@pytest.mark.parametrize(
    ("trials", "code", "place", "said"),
    [
        ('state = "Asc"', "unknown-state", (7, 9), "did you mean `Ask`"),
        ('state = "Quiz/Asc"', "unknown-state", (7, 9), "did you mean `Quiz/Ask`"),
        ('state = "Rest"', "wrong-value", (7, 9), "`Quiz/Rest` and `Other/Rest`"),
        ('state = "Ask"\nkey = "i"', "wrong-value", (8, 1), "not with both"),
        ('columns = ["i"]', "missing-value", (6, 2), "what begins a trial"),
        ('state = "Ask"\ncolumns = ["itms"]', "unset-key", (8, 13), "did you mean `items`"),
        ('state = "Ask"\ncolumns = ["i + 1"]', "wrong-value", (8, 12), "not a memory key"),
        ('state = "Ask"\ncolumns = ["i", "i"]', "duplicate-name", (8, 17), "twice"),
        ('state = "Ask"\nmeasure = "participants"', "unknown-name", (8, 11), "did you mean `participant_s`"),
        ('state = "Ask"\nspeech = "/"', "missing-value", (8, 10), "begins to speak"),
        ('stat = "Ask"', "unknown-key", (7, 1), "did you mean `state`"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(
    tmp_path: Path, trials: str, code: str, place: tuple[int, int], said: str
) -> None:
    found = {
        (each.code, (each.location.line, each.location.column)): each.message
        for each in load(scenario(tmp_path / "s", trials)).diagnostics
    }
    assert said in found.get((code, place), ""), found


def test_a_mistyped_key_is_reported_once(tmp_path: Path) -> None:
    found = load(scenario(tmp_path / "s", 'stat = "Ask"')).diagnostics
    assert [each.code for each in found if each.severity == "error"] == ["unknown-key"]


def test_names_in_it_are_uses(tmp_path: Path) -> None:
    loaded = load(scenario(tmp_path / "s", 'state = "Quiz/Rest"\ncolumns = ["items[i].text"]'))
    named = {
        (kind, name)
        for kind, name in (("rule", "Quiz"), ("state", "Quiz/Rest"), ("key", "items"), ("key", "i"))
        if any(use.place.file == "scenario.toml" and use.place.line >= 7 for use in loaded.uses.of(kind, name))
    }
    assert named == {("rule", "Quiz"), ("state", "Quiz/Rest"), ("key", "items"), ("key", "i")}


def test_it_is_completed(tmp_path: Path) -> None:
    loaded = load(scenario(tmp_path / "s", 'state = "Ask"'))
    for text, wanted in (
        ("mea", "measure"),
        ('state = "A', "Ask"),
        ('columns = ["i', "items"),
        ('measure = "', "key_s"),
    ):
        before = f"[trials]\n{text}"
        _, found = proposals(loaded, "scenario.toml", before, len(before))
        assert wanted in {each.text for each in found}, text


def test_every_measure_is_a_column_that_is_a_number() -> None:
    types = {column.name: column.type for column in TRIALS.columns}
    assert {types[name] for name in MEASURES} <= {"number", "integer"}


def test_stars_stand_for_any_text() -> None:
    assert fits_state("Quiz/Task *, step ?", "Quiz", "Task 1, step ?") and fits_state("*", "Quiz", "Ask")
    assert not fits_state("Task *", "Quiz", "A Task 1")
