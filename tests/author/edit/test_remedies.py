"""What can be done about a finding: each remedy ends it, changes what it says, and nothing else."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest
from msgspec.structs import replace

from rise_engine.author.edit.edits import ReplaceFile
from rise_engine.author.edit.remedies import _REMEDIES, Remedy, remedies
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.diagnostics import Diagnostic
from tests.author.edit.samples import SCENARIOS, study_files

GAZE, SETTINGS, LOOKS = "rules/gaze.xml", "scenario.toml", "acts/gaze.xml"
WAY = '<transition cond="person_near" target="Following"/>\n  </State>'


class Case(NamedTuple):
    """A study in which something is wrong, and what is offered for it."""

    file: str
    old: str
    """What stands there in the shipped study; empty: the file is new."""
    new: str
    code: str
    titles: tuple[str, ...]
    after: str = ""
    """What stands in the file after the first remedy."""
    likely: bool = False


CASES = (
    Case(GAZE, 'act="R_LookAhead"', 'act="R_LokAhead"', "unknown-act",
         ("write R_LookAhead", "make the act R_LokAhead"), 'act="R_LookAhead"', likely=True),
    Case(GAZE, 'target="Pausing"', 'target="Waiting"', "unknown-state", ("make the state Waiting in the rule Gaze",),
         '<State id="Waiting"'),
    Case(GAZE, 'initial="Nobody"', 'initial="Waiting"', "unknown-state", ("make the state Waiting in the rule Gaze",),
         '<State id="Waiting"'),
    Case(SETTINGS, 'event = "/W_close"', 'rule = "Zzz"', "unknown-rule", ("make the rule Zzz",)),
    Case(SETTINGS, 'event = "/W_close"', 'act = "R_Close"', "unknown-act", ("make the act R_Close",)),
    Case(GAZE, WAY, WAY.replace("person_near", "score"), "unset-key",
         ("give score the start value 0", "give score the start value false", 'give score the start value ""')),
    Case(GAZE, 'after="1s"', 'after="2"', "time", ("write 2s", "write 2ms"), 'after="2s"'),
    Case(GAZE, WAY, WAY.replace('near"', 'near AND defined(person_name)"'), "condition", ("write and",),
         "person_near and defined", likely=True),
    Case(GAZE, WAY, WAY.replace("near", "x ≥ 2"), "condition", ("write >=",), 'cond="person_x >= 2"', likely=True),
    Case(GAZE, WAY, WAY.replace("near", "x < 2"), "unescaped", ("write the marks in rules/gaze.xml as XML wants them",),
         'cond="person_x &lt; 2"', likely=True),
    Case(GAZE, WAY, WAY.replace("near", "near && person_x &lt; 2"), "unescaped",
         ("write the marks in rules/gaze.xml as XML wants them",), "near &amp;&amp; person_x &lt; 2", likely=True),
    Case(GAZE, WAY, WAY.replace(" cond", ' colour="red" cond'), "unknown-attribute", ("remove colour",),
         '<transition cond="person_near"', likely=True),
    Case(GAZE, "<onEntry>", '<onEntry><function assignValue="person_name = anna"/>', "bare-word",
         ("write 'anna' in quotation marks",), "person_name = 'anna'", likely=True),
    Case(GAZE, ' initial="Nobody"', "", "missing-attribute", ("let Gaze begin in Nobody",),
         '<InteractionRule name="Gaze" initial="Nobody"', likely=True),
    Case(GAZE, 'cond="person_near" target="Following"/>\n    <transition ended="R_FollowGaze"',
         'target="Following"/>\n    <transition ended="R_FollowGaze" cond="person_near"', "unreachable-transition",
         ("try it before the transition in line 13", "remove this transition from the state"), likely=True),
    Case(GAZE, 'ended="R_FollowGaze" outcome', 'ended="R_Nod" outcome', "unreachable-transition",
         ("wait for /R_Nod_failed, whoever starts the act", "remove this transition from the state"),
         'eventTopic="/R_Nod_failed"', likely=True),
    Case(GAZE, ' outcome="failed" target="Pausing"/>', "/>", "no-effect", ("remove this transition from the state",)),
    Case(GAZE, "  <!-- No use", '  <State id="Lost"></State>\n  <!-- No use', "unreachable-state",
         ("remove the state Lost",)),
    Case(SETTINGS, "b   = {", "f2  = {", "key-taken", ("use the key b instead", "use the key e instead"), "\nb "),
    Case(SETTINGS, "b   = {", '"ctrl+a" = {', "key-refused", ("use the key b instead", "use the key e instead")),
    Case(SETTINGS, "title =", "titel =", "unknown-key", ("write title", "remove titel from scenario.toml"),
         'title = "Greeting', likely=True),
    Case(SETTINGS, "filler = true", "filler = true\nxyzzy = 3", "unknown-key", ("remove xyzzy from scenario.toml",)),
    Case(LOOKS, "<actionID>2", "<actionID>1", "duplicate-id", ("give it the actionID 2",), "<actionID>2", likely=True),
    Case(LOOKS, "<actionID>2</actionID>\n", "\n", "missing-id", ("give it the actionID 2",),
         "<actionID>2", likely=True),
    Case(LOOKS, "<actionID>2</actionID>", "<actionID>2</actionID><waitForActions>1,7</waitForActions>", "unknown-id",
         ("do not wait for 7",), "<waitForActions>1<"),
    Case(LOOKS, "<actionID>2</actionID>", "<actionID>2</actionID><blub>3</blub>", "unknown-parameter",
         ("remove blub",)),
    Case(LOOKS, "</Dialogs>", '<Dialog name="R_E"></Dialog></Dialogs>', "empty-act",
         ("remove the act R_E, which nothing names",)),
    Case(LOOKS, "<value>neutral", "<value>neutrl", "unknown-name", ("write neutral",), "<value>neutral<", likely=True),
    Case("memory.json", '"person_greeted"', '"Wie oft?"', "unwritable-key", ("rename the key to Wie_oft, everywhere",),
         '"Wie_oft"', likely=True),
    Case(GAZE, "  <!-- No use", "  <!-- check: allow empty-act: it is so -->\n  <!-- No use", "unused-allow",
         ("remove the comment, which silences nothing",), "  </State>\n\n  <!-- No use", likely=True),
    Case(SETTINGS, "[keys]", "# check: allow empty-act: it is so\n[keys]", "unused-allow",
         ("remove the comment, which silences nothing",), '"]\n\n[keys]', likely=True),
    Case(GAZE, '    <transition after="1s" cond="person_near" target="Following"/>\n',
         '<<<<<<< HEAD\n    <transition after="1s" cond="person_near" target="Following"/>\n=======\n'
         '    <transition after="2s" cond="person_near" target="Following"/>\n>>>>>>> other\n', "merge-conflict",
         ("keep the upper of the two versions", "keep the lower of the two versions"),
         'Pausing">\n    <transition after'),
    Case("texts/de.toml", "", '[R_Greeting]\n"99" = { text = "a", of = "b" }\n', "unknown-text",
         ("remove 99 from texts/de.toml",)),
    Case("texts/de.toml", "", '[R_Zzz]\n"1" = { text = "a", of = "b" }\n', "unknown-text",
         ("remove R_Zzz from texts/de.toml",)),
    Case("texts/de.toml", "", '[R_Introduction]\n1 = { text = "Ich heiße Floka.", of = "b" }\n', "stale-translation",
         ("the translation is still right: update `of` to the present text",), 'of = "My name is Floka'),
)  # fmt: skip


def opened(folder: Path, case: Case) -> Workspace:
    """The shipped study with what is wrong in it."""
    shutil.copytree(SCENARIOS / "greeting", folder)
    path = folder / case.file
    if case.old:
        text = path.read_text()
        assert case.old in text
        path.write_text(text.replace(case.old, case.new, 1))
    else:
        path.parent.mkdir(exist_ok=True)
        path.write_text(case.new)
    return Workspace(folder)


def offered(study: Workspace, code: str) -> tuple[Diagnostic, list[Remedy]]:
    found = [each for each in study.checked.diagnostics if each.code == code]
    first = min(found, key=lambda each: not remedies(each, study.state))
    return first, remedies(first, study.state)


def count(study: Workspace, finding: Diagnostic) -> int:
    """How often the same is found, wherever it stands now."""
    return sum((each.code, each.message) == (finding.code, finding.message) for each in study.checked.diagnostics)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.code}-{case.titles[0][:20]}")
def test_a_remedy_ends_its_finding(tmp_path: Path, case: Case) -> None:
    study = opened(tmp_path / "study", case)
    finding, found = offered(study, case.code)
    assert tuple(each.title for each in found) == case.titles
    assert [each.is_likely for each in found] == [case.likely, *[False] * (len(found) - 1)]
    before, times = study.files, count(study, finding)
    for each in found:
        study.apply(each.edit)
        assert count(study, finding) < times
        assert each is not found[0] or case.after in study.files[case.file].decode()
        study.undo()
        assert study.files == before
    study.close()


@pytest.mark.parametrize("spelling", ["crlf", "bom_tabs", "cr"])
def test_a_name_that_is_written_right_is_all_that_changes(tmp_path: Path, spelling: str) -> None:
    """Whatever the line ends and marks of the file are."""
    study = opened(tmp_path / "study", CASES[0])
    written = study_files("greeting", spelling)[GAZE].replace(b'"R_LookAhead"', b'"R_LokAhead"')
    study.apply(ReplaceFile(GAZE, written.decode()))
    study.apply(offered(study, "unknown-act")[1][0].edit)
    assert study.files[GAZE] == written.replace(b"R_LokAhead", b"R_LookAhead")
    study.close()


def test_a_failure_that_nobody_notices_has_two_remedies(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    shutil.copytree(SCENARIOS / "greeting", folder)
    settings, rule = folder / SETTINGS, folder / GAZE
    settings.write_text(settings.read_text().replace("repeat:1", "go_on"))
    heard = rule.read_text().replace(' outcome="failed"', "")
    rule.write_text(heard.replace('ended="R_FollowGaze"', 'eventTopic="/R_FollowGaze_end"'))
    study = Workspace(folder)
    finding, found = offered(study, "unnoticed-failure")
    assert finding.location.file == GAZE
    assert [each.title for each in found] == ["wait for /R_FollowGaze_succeeded", 'ask the wizard: on_failure = "ask"']
    study.apply(found[1].edit)
    assert "unnoticed-failure" not in [each.code for each in study.checked.diagnostics]
    study.close()


def test_nothing_is_offered_that_cannot_be_made(tmp_path: Path) -> None:
    """States that lead to one another alone; a file that is no UTF-8; a finding about a file outside of the study."""
    lost = "".join(
        f'<State id="{here}"><transition after="1s" target="{there}"/></State>' for here, there in ("AB", "BA")
    )
    wrong = Case(GAZE, "</InteractionRule>", f"{lost}</InteractionRule>", "unreachable-state", ())
    study = opened(tmp_path / "a", wrong)
    assert offered(study, "unreachable-state")[1] == []
    study.close()
    study = opened(tmp_path / "b", CASES[0])
    (finding, *_) = study.checked.diagnostics
    (tmp_path / "b" / GAZE).write_bytes(study.files[GAZE].replace(b"look", b"l\xfck"))
    study.read_disk_changes()
    assert remedies(finding, study.state) == []
    elsewhere = replace(finding, location=replace(finding.location, file="/elsewhere/SayThen.xml"))
    assert remedies(elsewhere, study.state) == []
    study.close()


def test_every_code_with_remedies_is_one_that_there_is() -> None:
    listed = (Path(__file__).parents[3] / "docs" / "reference" / "scenario.md").read_text()
    assert [code for code in _REMEDIES if f"- `{code}`: " not in listed] == []
    assert {each.code for each in CASES} | {"unnoticed-failure", "key-twice"} >= set(_REMEDIES)
