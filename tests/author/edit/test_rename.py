"""Rename: records are equal but for the name, and back again the files are the same bytes."""

from __future__ import annotations

import json
import re
from itertools import cycle
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import NameKind, Rename
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.cli import main
from rise_engine.scenario.loader import load
from tests.author.edit.guard import check_guard
from tests.author.edit.samples import SPELLINGS, after, study_files, study_state
from tests.expression.situation_tests import situation_tests

RENAMES: list[tuple[str, NameKind, str, str]] = [
    ("greeting", "act", "R_Introduction", "Ä & Ö"),
    ("greeting", "rule", "Greeting", "Zq"),
    ("greeting", "key", "person_near", "zq_near"),
    ("greeting", "action", "R_Introduction/5", "zq"),
    ("lablinking", "act", "R_Apology", "Zq_Sorry"),
    ("lablinking", "rule", "Table setting", 'Zq\'s "main" <rule>'),
    ("lablinking", "state", "Table setting/Welcome", "Zq & so"),
    ("lablinking", "event", "next", "zq_next"),
    ("lablinking", "key", "hesitation", "zqzögern"),
    ("lablinking", "key", "pause_ms", "zq_pause"),
    ("lablinking", "key", "participant_number", "zq_number"),
    ("negation", "rule", "Instructions", "Zq"),
    ("negation", "key", "order", "zq_order"),
    ("negation", "event", "/done", "/zq_done"),
    ("lab_opening", "key", "room", "zq_room"),
]


def exists(study: str, kind: NameKind, old: str) -> bool:
    return old.removeprefix("/") in study_state(study).checked.uses.names(kind)


RENAMES = [each for each in RENAMES if exists(*each[:3])]


def test_the_names_that_are_tried_are_there() -> None:
    assert len(RENAMES) >= 13 and {kind for _, kind, _, _ in RENAMES} == {
        "act",
        "rule",
        "state",
        "event",
        "key",
        "action",
    }


def records(folder: Path, capfd: pytest.CaptureFixture[bytes]) -> list[str]:
    with pytest.raises(SystemExit) as ended:
        main(["run", str(folder), "--tasks", str(folder / "session.jsonl"), "--speed", "max", "--seed", "1", "--json"])
    output, errors = capfd.readouterr()
    assert (ended.value.code or 0, errors) == (0, b"")
    return [json.dumps(json.loads(line), ensure_ascii=False) for line in output.splitlines()]


def write(files: Files, folder: Path) -> Path:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


_BEFORE: dict[str, list[str]] = {}


def is_identical(study: str, capfd: pytest.CaptureFixture[bytes], folder: Path) -> list[str]:
    """The records of a study before anything is renamed; played once."""
    if study not in _BEFORE:
        _BEFORE[study] = records(write(study_files(study), folder / study), capfd)
    return _BEFORE[study]


@pytest.mark.slow
@pytest.mark.parametrize(("study", "kind", "old", "new"), RENAMES)
def test_the_records_are_equal_but_for_the_name(
    study: str, kind: NameKind, old: str, new: str, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    renamed = after(study_state(study), Rename(kind, old, new))
    assert not renamed.checked.errors
    before = is_identical(study, capfdbinary, tmp_path)
    now = records(write(renamed.files, tmp_path / "renamed" / study), capfdbinary)
    alone = (old.rpartition("/")[2] if kind in ("state", "action") else old).removeprefix("/")
    fresh = json.dumps(new.removeprefix("/"), ensure_ascii=False)[1:-1]
    hashes = re.compile(r'"hash": "[0-9a-f]+"|"scenario_hash": "[0-9a-f]+"')
    folders = re.compile(rf'"[^"]*/{study}\b')
    back = [folders.sub('"', hashes.sub("", line.replace(fresh, alone))) for line in now]
    assert back == [folders.sub('"', hashes.sub("", line)) for line in before]
    assert kind == "action" or any(fresh in line for line in now), "the session has nothing of this name"


@pytest.mark.parametrize(("spelling", "rename"), zip(SPELLINGS, cycle(RENAMES[2::5]), strict=False))
def test_back_again_the_files_are_the_same(spelling: str, rename: tuple[str, NameKind, str, str]) -> None:
    study, kind, old, new = rename
    before = study_state(study, spelling)
    there = after(before, Rename(kind, old, new))
    owner = old.rpartition("/")[0]
    alone = old.rpartition("/")[2] if kind in ("state", "action") else old
    again = after(there, Rename(kind, f"{owner}/{new}" if kind in ("state", "action") else new, alone))
    assert there.files != before.files
    assert {name: data for name, data in again.files.items() if data != before.files[name]} == {}
    findings = [each.code for each in before.checked.diagnostics]
    assert [each.code for each in there.checked.diagnostics] == findings


ACTS = """<Dialogs>
<Template name="Say"><parameter name="name"/><parameter name="what"/>
<Dialog name="${name}"><Speech><actionID>1</actionID><message>${what} {person.name|you}</message></Speech></Dialog>
</Template>
<Template name="Twice"><parameter name="n"/>
<Dialog name="R_${n}"><Speech><actionID>1</actionID><message>${n}</message></Speech></Dialog>
</Template>
<Template name="Both"><parameter name="n"/>
<Dialog name="${n}"><Speech><actionID>1</actionID><message>${n}</message></Speech></Dialog>
</Template>
<!-- R_A says it; R_AB does not. -->
<use template="Say" name="R_A" what="Hello"/>
<use template="Say" name="R_B" what="R_A"/>
<use template="Twice" n="1"/>
<use template="Both" n="Lamp"/>
</Dialogs>
"""
RULES = """<InteractionRules>
<InteractionRule name="Main" initial="One" priority="1">
<State id="One"><onEntry>
<function startCommunicationRobotAct="R_A"/><function assignValue='person = {"name": "R_A"}'/>
<function assignValue="mode = quiet"/>
<function raiseEventTopic="/R_B_end"/></onEntry>
<transition eventTopic="/R_A_end" target="Two"/>
<transition cond="person.name = 'person' and defined(flag)" target="Two"/>
<transition ended="R_A" target="Two"/></State>
<State id="Two"><onEntry><function startInteractionRule="Other" state="End"/></onEntry>
<transition eventTopic="/Other_End" target="One"/><transition eventTopic="/R_B_end" target="One"/></State>
</InteractionRule>
<InteractionRule name="Other" initial="End"><State id="End"/></InteractionRule>
</InteractionRules>
"""
TOML = """private = ["person"] # person
[keys]
a = { act = "R_A", label = "R_A" }
b = { set = "flag = person.name" }
[act.R_A]
hold = true
[act."R_B*"]
filler = true
[study]
conditions = ["x", "y"]
[conditions.x]
memory = { flag = true }
[conditions.y]
memory = { "flag" = false }
"""
TASKS = r"""# R_A
{"function_type": "startCommunicationRobotAct", "domain_task_behavior": "R_A", "source": "R_A"}
{"function_type": "startInteractionRule", "domain_task_behavior": {"rule": "Other", "state": "End"}}
{"function_type": "startInteractionRule", "domain_task_behavior": "{\"rule\": \"Other\", \"state\": \"End\"}"}
{"function_type": "assignValue", "domain_task_behavior": "{\"person\": {\"name\": \"person\"}}"}
{"function_type": "assignValue", "domain_task_behavior": "flag = person.name = 'flag'"}
{"function_type": "raiseEventTopic", "domain_task_behavior": "/R_A_end"}
{"function_type": "releaseStop", "domain_task_behavior": {"Other": "wait"}}
{"function_type": "stepBack", "domain_task_behavior": {"rule": "Main", "take_back": ["flag"]}}
{"expect": {"rules": {"Other": "End"}, "memory": {"flag": "flag"}, "starts": ["R_A"], "events": ["/R_A_end", "x"]}}
not json R_A
"""
DE = """[R_A]
1 = { text = "Hallo {person.name|du}", of = "Hello {person.name|you}" }
[R_B]
"1" = { text = "R_A {person.name|du}", of = "R_A {person.name|you}" }
"""
FACTORS = """[factors.f]
levels.yes.memory = { flag = true }
levels.no.memory = { flag = false }
"""
FILES = {
    "acts/a.xml": ACTS,
    "rules/r.xml": RULES,
    "scenario.toml": TOML,
    "memory.json": '{"person": {"name": "x"}, "flag": null, "mode": "loud"}',
    "session.jsonl": TASKS,
    "texts/de.toml": DE,
    "study.toml": FACTORS,
}


@pytest.fixture
def state(tmp_path: Path) -> StudyState:
    files = {name: text.encode() for name, text in FILES.items()}
    loaded = load(write(files, tmp_path / "study"))
    assert loaded.scenario is not None, loaded.errors
    return StudyState(files, loaded, tmp_path / "study")


def renamed(state: StudyState, kind: NameKind, old: str, new: str) -> tuple[dict[str, str], Plan]:
    """What has changed, as lines that are new."""
    planned = plan(Rename(kind, old, new), state)
    after = apply_plan(state.files, planned)
    loaded = load(state.folder, held=after)
    assert loaded.scenario is not None, loaded.errors
    check_guard([Rename(kind, old, new)], state, StudyState(after, loaded, state.folder))
    changed = {}
    for name, data in after.items():
        old_lines = state.files[name].decode().splitlines()
        lines = [line for at, line in enumerate(data.decode().splitlines()) if line != old_lines[at]]
        if lines:
            changed[name] = "\n".join(lines)
    return changed, planned


def test_an_act_is_renamed_in_every_file(state: StudyState) -> None:
    changed, planned = renamed(state, "act", "R_A", "R A")
    assert changed == {
        "acts/a.xml": '<use template="Say" name="R A" what="Hello"/>',
        "rules/r.xml": (
            """<function startCommunicationRobotAct="R A"/><function assignValue='person = {"name": "R_A"}'/>\n"""
            """<transition eventTopic="/R A_end" target="Two"/>\n"""
            """<transition ended="R A" target="Two"/></State>"""
        ),
        "scenario.toml": 'a = { act = "R A", label = "R_A" }\n[act."R A"]',
        "session.jsonl": TASKS.splitlines()[1].replace('"R_A", "s', '"R A", "s')
        + "\n"
        + TASKS.splitlines()[6].replace("R_A", "R A")
        + "\n"
        + TASKS.splitlines()[9].replace("R_A", "R A"),
        "texts/de.toml": '["R A"]',
    }
    assert planned.says == ("the act `R_A` is called `R A` now, in 11 places of 5 files",)
    assert planned.noticed == (
        "the comment in acts/a.xml, line 11, still has `R_A`",
        "the comment in session.jsonl, line 1, still has `R_A`",
    )


def test_a_key_is_renamed_where_it_is_a_key(state: StudyState) -> None:
    changed, planned = renamed(state, "key", "person", "guest")
    assert changed == {
        "acts/a.xml": ACTS.splitlines()[2].replace("{person.name", "{guest.name"),
        "rules/r.xml": RULES.splitlines()[3].replace("person =", "guest =")
        + "\n"
        + RULES.splitlines()[7].replace("person.name =", "guest.name ="),
        "scenario.toml": 'private = ["guest"] # person\nb = { set = "flag = guest.name" }',
        "memory.json": FILES["memory.json"].replace("person", "guest"),
        "session.jsonl": TASKS.splitlines()[4].replace(r"{\"person", r"{\"guest")
        + "\n"
        + TASKS.splitlines()[5].replace("person", "guest"),
        "texts/de.toml": "\n".join(line.replace("person", "guest") for line in DE.splitlines() if "person" in line),
    }
    assert planned.noticed == ("the comment in scenario.toml, line 1, still has `person`",)
    changed, _ = renamed(state, "key", "flag", "sign")
    assert changed["study.toml"].count("{ sign = ") == 2
    assert changed["scenario.toml"].splitlines()[-2:] == ["memory = { sign = true }", "memory = { sign = false }"]
    assert changed["session.jsonl"].splitlines() == [
        TASKS.splitlines()[5].replace('"flag', '"sign'),
        TASKS.splitlines()[8].replace("flag", "sign"),
        TASKS.splitlines()[9].replace('"flag":', '"sign":'),
    ]


def test_states_and_rules_take_the_events_of_their_ends_with_them(state: StudyState) -> None:
    changed, _ = renamed(state, "state", "Other/End", "Fin")
    assert sorted(changed) == ["rules/r.xml", "session.jsonl"]
    assert 'eventTopic="/Other_Fin"' in changed["rules/r.xml"] and 'state="Fin"' in changed["rules/r.xml"]
    assert changed["session.jsonl"].count("Fin") == 3
    changed, _ = renamed(state, "rule", "Other", "Else")
    assert 'eventTopic="/Else_End"' in changed["rules/r.xml"] and changed["session.jsonl"].count("Else") == 4
    changed, planned = renamed(state, "act", "R_B", "R_Bee")
    assert changed["rules/r.xml"].count("/R_Bee_end") == 2
    assert planned.noticed == ("`/R_B_end` is also raised explicitly; it gets the new name there, too",)


@pytest.mark.parametrize(
    ("kind", "old", "new", "why"),
    [
        ("act", "R_C", "R_D", "there is no act `R_C`; did you mean"),
        ("act", "R_A", "R_B", "`R_B` is taken: acts/a.xml, line 13"),
        ("act", "R_A", " x", "is not a name"),
        ("act", "R_A", "", "is not a name"),
        ("act", "R_A", "a\u200bb", "is not a name"),
        ("act", "R_A", "R_A", "has this name already"),
        (
            "act",
            "R_1",
            "R_2",
            r"acts/a.xml, line 14 .*: the template `Twice` puts the name together \(acts/a.xml, line 6\)",
        ),
        ("act", "R_B", "R_C", r'\[act."R_B\*"\] sets `filler` of `R_B` by its name'),
        ("act", "R_A", "R_B2", r'\[act."R_B\*"\] sets `filler` of `R_B2` by its name'),
        ("act", "R_A", "Other", "waits for the event `R_A_end`; it would be `Other_end`"),
        ("rule", "Other", "Main", "`Main` is taken"),
        ("state", "Main/One", "Two", "`Two` is taken"),
        ("state", "One", "Three", "write RULE/STATE"),
        ("action", "R_A/1", "x", "has its name from a template .* and so has"),
        ("action", "R_A/7", "x", "write ACT/ID"),
        ("event", "R_A_end", "x", "the engine raises `R_A_end` by itself"),
        ("key", "person", "flag", "`flag` is taken"),
        ("key", "person", "a b", "cannot be a memory key"),
        ("key", "person", "pi", "cannot be a memory key"),
        ("key", "person", "a.b", "has no dot"),
        ("key", "person", "session", "`session` is taken"),
        ("key", "person.name", "x", "`person.name` is a part of `person`"),
        ("key", "person", "quiet", "`quiet` is a text in rules/r.xml, line 5, and would become the key"),
    ],
)
def test_what_would_change_the_study_is_refused(
    state: StudyState, kind: NameKind, old: str, new: str, why: str
) -> None:
    with pytest.raises(EditRefused, match=why):
        renamed(state, kind, old, new)


EXPLORED = r"""
[explore]
end = "Main"
tries = { flag = [1] }
[always]
both = "in('Main', \"Two\") and runs('R_A') and flag"
[eventually]
main = { after = 'rule("Main")', then = "waits('R_A') or mode = 'Main'", unless = "in('Other', 'End')" }
"""


@pytest.mark.parametrize(
    ("kind", "old", "new", "asked"),
    [
        ("act", "R_A", "It's \\", {"in Main Two", "runs It's \\", "rule Main", "waits It's \\", "in Other End"}),
        ("rule", "Main", 'a "b"', {'in a "b" Two', "runs R_A", 'rule a "b"', "waits R_A", "in Other End"}),
        ("state", "Main/Two", '"T"', {'in Main "T"', "runs R_A", "rule Main", "waits R_A", "in Other End"}),
        ("state", "Other/End", "Ä's", {"in Main Two", "runs R_A", "rule Main", "waits R_A", "in Other Ä's"}),
        ("key", "flag", "zq", {"in Main Two", "runs R_A", "rule Main", "waits R_A", "in Other End"}),
    ],
)
def test_names_in_properties(state: StudyState, kind: NameKind, old: str, new: str, asked: set[str]) -> None:
    """Each within its quotation marks, of the condition and of the file; and back again the files are the same."""
    files = {**state.files, "scenario.toml": state.files["scenario.toml"] + EXPLORED.encode()}
    before = StudyState(files, load(state.folder, held=files), state.folder)
    there = _after(before, Rename(kind, old, new))
    scenario = there.checked.scenario
    assert scenario is not None
    parts = [part for each in scenario.properties for part in (each.condition, each.after, each.unless) if part]
    tests = [test for part in parts for test in situation_tests(part)]
    assert {" ".join((test.function, *test.names)) for test in tests} == asked
    assert scenario.explore.end == (new if kind == "rule" else "Main")
    assert scenario.explore.tries.keys() == parts[0].keys == {"zq" if kind == "key" else "flag"}
    owner, _, alone = old.rpartition("/")
    back = _after(there, Rename(kind, f"{owner}/{new}" if owner else new, alone))
    assert back.files["scenario.toml"].endswith(EXPLORED.encode())


def _after(state: StudyState, edit: Rename) -> StudyState:
    files = apply_plan(state.files, plan(edit, state))
    following = StudyState(files, load(state.folder, held=files), state.folder)
    check_guard([edit], state, following)
    return following


def test_a_name_that_cannot_be_written_in_the_files_marks_is_refused(state: StudyState) -> None:
    files = {**state.files, "scenario.toml": state.files["scenario.toml"] + EXPLORED.encode()}
    before = StudyState(files, load(state.folder, held=files), state.folder)
    with pytest.raises(EditRefused, match=r'line 22: write this text in " marks first'):
        plan(Rename("rule", "Main", "It's"), before)


def test_a_name_that_is_something_else_too_is_refused(state: StudyState) -> None:
    with pytest.raises(EditRefused, match=r"is something else in the template `\w+`, too; change it there by hand"):
        plan(Rename("act", "Lamp", "Light"), state)


def test_a_file_that_cannot_be_read_stands_in_the_way(state: StudyState) -> None:
    files = {**state.files, "rules/z.xml": b"<InteractionRules>"}
    broken = StudyState(files, load(state.folder, held=files), state.folder)
    with pytest.raises(EditRefused, match=r"rules/z\.xml cannot be read"):
        plan(Rename("act", "R_A", "R_X"), broken)
