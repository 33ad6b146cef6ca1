"""Sessions for others: they say what their level says, and replay."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import Note, SessionStarted
from rise_engine.kernel.records import RuleRecord, TaskRecord
from rise_engine.privacy.changed_session import why_not_replayed
from rise_engine.privacy.levels import ExportLevel
from rise_engine.privacy.sharing import share_session
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.session.folder import JOURNAL, read_info
from rise_engine.session.replay import compare_replay
from tests.results.analysis.samples import (
    Script,
    act,
    everything,
    play_session,
    recovered_session,
    short,
    task,
    torn_session,
    write_scenario,
)

SECRETS = ("zelda", "quux", "anna", "felt sick", "looks away", "hurry", "asks something", "/data/", "2024-11")
NAME_RULE = """<InteractionRule name="Named" initial="Start">
  <State id="Start"><transition cond="person_name == '{value}'" target="Known"/></State>
  <State id="Known"/>
</InteractionRule>"""


def shared(folder: Path, target: Path, level: ExportLevel = "shared") -> Path:
    share_session(folder, target, level=level)
    return target


def text_of(folder: Path) -> str:
    """Everything that the record says; the scenario's own words left out."""
    return "".join((folder / name).read_text("utf-8") for name in (JOURNAL, "session.toml")).casefold()


def what_is_told(data: SessionData) -> object:
    """Everything but what the program says about what was asked for, which depends on what was written."""
    told = msgspec.to_builtins((list(data.records), data.acts, data.cues, data.phases, data.points))
    return _without_sentences(told)


def _without_sentences(value: object) -> object:
    if isinstance(value, dict):
        engine_note = value.get("kind") == "note" and value.get("source") == "engine"
        gone = {"reason", "error", *(("text", "value") if engine_note else ())}
        return {name: _without_sentences(each) for name, each in value.items() if name not in gone}
    if isinstance(value, list | tuple):
        return [_without_sentences(each) for each in value]
    return value


def scenario_with(root: Path, rule: str = "", memory: str = "") -> Path:
    folder = write_scenario(root / "scenario")
    if rule:
        (folder / "rules" / "named.xml").write_text(rule, "utf-8")
    if memory:
        text = (folder / "memory.json").read_text("utf-8").replace('"person_name": ""', memory)
        (folder / "memory.json").write_text(text, "utf-8")
    return folder


@pytest.mark.parametrize("level", ["shared", "public"])
def test_a_shared_session_replays_and_says_what_its_level_says(tmp_path: Path, level: ExportLevel) -> None:
    judged = everything(outcome="aborted", reason="Zelda felt sick")
    script: Script = [*judged, (60.0, task("assignValue", "person_name = Quux + '"))]
    folder = play_session(tmp_path / "sessions", script)
    assert all(secret in text_of(folder) for secret in SECRETS)
    target = shared(folder, tmp_path / "new", level)
    text = text_of(target)
    assert [secret for secret in SECRETS if secret in text] == []
    assert ("shall we go on" in text) is (level == "shared")
    comparison = compare_replay(target)
    assert comparison.identical
    assert comparison.records == compare_replay(folder).records > 100
    before = read_session(folder, level=level)
    again = read_session(target, level=level, wizards={"W1": "W1"})
    assert what_is_told(again) == what_is_told(before)  # as the original is told, and told twice it is the same
    assert again.facts.duration == before.facts.duration
    assert [path for path in (target, *target.rglob("*")) if path.stat().st_mode & 0o077] == []


def test_what_session_toml_says(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", short())
    report = share_session(folder, tmp_path / "new", level="shared", wizards={"anna": "Wizard-A"})
    info = read_info(tmp_path / "new")
    assert (info.wizard, info.started, info.scenario_folder, info.machine) == ("Wizard-A", "", "", {})
    assert (info.participant, info.seed, info.scenario_hash) == ("P01", 7, read_info(folder).scenario_hash)
    assert report.people == {"anna": "Wizard-A"}
    assert report.own_values == []


def test_a_recovered_session_can_be_shared(tmp_path: Path) -> None:
    target = shared(recovered_session(tmp_path / "sessions"), tmp_path / "new")
    assert compare_replay(target).identical
    assert not [secret for secret in SECRETS if secret in text_of(target)]


def test_words_that_decide_are_not_shared(tmp_path: Path) -> None:
    scenario = scenario_with(tmp_path, NAME_RULE.format(value="Zelda"))
    script: Script = [
        (1.0, task("startInteractionRule", "Named")),
        (2.0, task("assignValue", 'person_name = "Zelda"')),
        *short(),
    ]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=20.0)
    with pytest.raises(
        SessionError, match=r"decided what happened: without them record \d+ \(condition, at 2\.0 s\)"
    ) as found:
        shared(folder, tmp_path / "new")
    assert "Zelda" not in str(found.value)
    assert not (tmp_path / "new").exists()


def test_a_comparison_with_another_value_decides_nothing(tmp_path: Path) -> None:
    """Equal values stay equal and different ones different, so a rule that only compares them goes its way."""
    rule = NAME_RULE.replace("person_name == '{value}'", "person_name == other and visits &lt; 5")
    scenario = scenario_with(tmp_path, rule, '"person_name": "", "other": ""')
    toml = scenario / "scenario.toml"
    toml.write_text(toml.read_text("utf-8").replace('"person_name"]', '"person_name", "other"]'), "utf-8")
    script: Script = [
        (1.0, task("assignValue", 'person_name = "Zelda"')),
        (2.0, task("assignValue", '{"other": "Quux", "visits": 4}')),
        (3.0, task("startInteractionRule", "Named")),
        (4.0, task("assignValue", "other = Zelda")),
        (5.0, task("say", "Zelda and quux")),
    ]
    folder = play_session(tmp_path / "sessions", script, scenario=scenario, until=20.0)
    target = shared(folder, tmp_path / "new")
    records = read_session(target).records
    assert [each.state for each in records if isinstance(each, RuleRecord)][-1] == "Known"
    assert "zelda" not in text_of(target)
    assert "quux" not in text_of(target)
    said = [each.behavior for each in records if isinstance(each, TaskRecord)]
    assert 'person_name = "PERSONNAME1"' in said
    assert '{"other": "OTHER2", "visits": 4}' in said


@pytest.mark.parametrize(
    ("assigned", "gone"),
    [
        ("person_name = 34", ["34"]),
        ("person_name += 271828", ["271828"]),
        ('person_name = {"first": "Zelda", "codes": [31337, true]}', ["zelda", "31337"]),
        ('{"person_name": ["Zelda", "Quux"]}', ["zelda", "quux"]),
        ("person_name = 'Zel' + 'da'", ["zel'", "zelda"]),
        ("person_name = 'Zelda' + visits + 271828", ["zelda", "271828"]),
        ("person_name = Zelda", ["zelda"]),
    ],
)
def test_every_way_to_write_a_private_value(tmp_path: Path, assigned: str, gone: list[str]) -> None:
    scenario = scenario_with(tmp_path, memory='"person_name": 1' if "+=" in assigned else "")
    folder = play_session(
        tmp_path / "sessions", [(1.0, task("assignValue", assigned))], scenario=scenario, until=9.0, seed=5
    )
    target = shared(folder, tmp_path / "new")
    values = [line for line in text_of(target).splitlines() if "assignvalue" in line or '"kind":"memory"' in line]
    assert values
    assert [secret for secret in gone for line in values if secret in line.partition(',"crc"')[0]] == []
    assert compare_replay(target).identical


def test_values_that_the_condition_sets(tmp_path: Path) -> None:
    first = SessionStarted(participant="P01", memory={"person_name": "Zelda", "noise": 3})
    folder = play_session(tmp_path / "sessions", short(), started=first, until=20.0)
    target = shared(folder, tmp_path / "new")
    assert "zelda" not in text_of(target)
    assert '"noise":3' in text_of(target)


def test_a_name_that_the_scenario_itself_says_is_told_as_the_scenario_has_it(tmp_path: Path) -> None:
    """Somebody is called Nod, as an act is: what the scenario calls something stays."""
    script: Script = [(1.0, task("assignValue", 'person_name = "Nod"')), act("Nod", 2.0), (5.0, task("say", "Hi Nod"))]
    folder = play_session(tmp_path / "sessions", script, until=12.0)
    target = shared(folder, tmp_path / "new")
    records = read_session(target).records
    said = [each.behavior for each in records if isinstance(each, TaskRecord)]
    assert "Nod" in said
    assert "Hi Nod" not in said


def test_private_start_values_of_the_scenario_are_told(tmp_path: Path) -> None:
    scenario = scenario_with(tmp_path, memory='"person_name": "friend"')
    folder = play_session(tmp_path / "sessions", short(), scenario=scenario, until=20.0)
    assert share_session(folder, tmp_path / "new", level="shared").own_values == ["person_name"]


def test_what_the_engine_quoted_is_no_way_out(tmp_path: Path) -> None:
    script: Script = [(1.0, Note(text="`Zelda` cannot be said; `noise` can")), *short()]
    folder = play_session(tmp_path / "sessions", script, until=20.0)
    text = text_of(shared(folder, tmp_path / "new"))
    assert "`…` cannot be said; `noise` can" in text
    assert "zelda" not in text


def test_further_private_keys(tmp_path: Path) -> None:
    script: Script = [(1.0, task("assignValue", "noise = 271828")), (2.0, Note(text="271828", source="wizard:anna"))]
    folder = play_session(tmp_path / "sessions", script, until=9.0)
    share_session(folder, tmp_path / "new", level="shared", private=["noise"])
    assert "271828" not in text_of(tmp_path / "new")


def test_sessions_that_cannot_be_shared(tmp_path: Path) -> None:
    whole = play_session(tmp_path / "a", short(), until=20.0)
    torn = torn_session(tmp_path / "b")
    unended = play_session(tmp_path / "c", short(), until=5.0, ends=False)
    other = play_session(tmp_path / "d", short(), until=20.0)
    (other / "scenario" / "memory.json").write_text('{"WorkingMemory": [{"noise": 1}]}', "utf-8")
    changed = play_session(tmp_path / "e", short(), until=20.0)
    info = (changed / "session.toml").read_text("utf-8")
    (changed / "session.toml").write_text(info.replace("seed = 7", "seed = 8"), "utf-8")
    for folder, why in (
        (torn, "damaged"),
        (unended, "not ended"),
        (other, "is not the scenario"),
        (changed, "session.toml says seed = 8, but journal.jsonl says seed = 7"),
        (tmp_path / "nothing", "no session"),
    ):
        with pytest.raises(SessionError, match=why):
            shared(folder, tmp_path / "new")
        assert not (tmp_path / "new").exists()
    shared(whole, tmp_path / "new")


def test_a_session_that_lacks_a_record_is_refused_with_the_reason(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", everything())
    assert why_not_replayed(folder) == ""
    lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    del lines[next(number for number, line in enumerate(lines) if b'"kind":"act' in line)]
    (folder / JOURNAL).write_bytes(b"".join(lines))
    assert why_not_replayed(folder) == "the session does not replay unchanged (1 record cannot be read)"
