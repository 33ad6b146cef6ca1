"""What the editor shows and asks for, without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import (
    AddTransition,
    SetActionType,
    SetParameter,
    SetSetting,
    SetWaits,
    TransitionForm,
)
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.model import Parameter
from rise_engine.scenario.settings import SCENARIO_TABLES, SettingTable
from rise_engine.study.settings import STUDY_TABLES
from rise_engine.study.study_toml import load_study
from rise_tui.editor import data_pages
from rise_tui.editor.data_pages import SettingsPage
from rise_tui.editor.model.acts import (
    action_fields,
    action_rows,
    action_times,
    file_lines,
    new_action_parameters,
    parameter_note,
    scale_line,
)
from rise_tui.editor.model.additions import additions
from rise_tui.editor.model.data_fields import key_fields
from rise_tui.editor.model.draft import FilePlace, StudyDraft, draft_of, first_new_finding
from rise_tui.editor.model.fields import EditField
from rise_tui.editor.model.setting_fields import plan_lines, setting_fields
from rise_tui.editor.model.study_rows import find_at, study_rows, used_by
from rise_tui.editor.page import top_line
from rise_tui.rendering.text import line_width, plain_text
from tests.study.studies import DESIGN, HEAD, write_study
from tests.tui.editor.conftest import editor


@pytest.fixture
def draft(study: Path) -> StudyDraft:
    return draft_of(Workspace(study))


def test_the_form_of_an_action_has_all_that_the_robot_declares_and_each_field_makes_its_edit(draft: StudyDraft) -> None:
    act = draft.outline.act("R_FollowGaze")
    assert act is not None
    (look,) = act.actions
    fields = {each.label: each for each in action_fields(act, look, draft.checked)}
    assert set(draft.checked.robot.actions["LookAt"].parameters) <= set(fields)
    assert fields["pointx"].required
    assert fields["roll"].text is None
    assert fields["pointx"].edits("2") == (SetParameter("R_FollowGaze", look.id, "pointx", "2", 0),)
    assert fields["waits for"].edits(None) == (SetWaits("R_FollowGaze", look.id, ()),)
    assert fields["waits for"].edits("1,2") == (SetWaits("R_FollowGaze", look.id, ("1", "2")),)
    assert fields["action"].edits("Wait") == (SetActionType("R_FollowGaze", look.id, "Wait"),)


def test_a_parameter_says_its_range_its_unit_and_what_holds_when_it_is_not_given() -> None:
    volume = Parameter("volume", "number", default=1, minimum=0, maximum=1)
    assert parameter_note(volume, is_given=False) == "from 0 to 1; not given: 1"
    assert parameter_note(volume, is_given=True) == "from 0 to 1"
    assert parameter_note(Parameter("t", "number", "ms"), is_given=False) == "milliseconds; the robot's own"


def test_a_new_action_has_what_it_must_have(draft: StudyDraft) -> None:
    for spec in draft.checked.robot.actions.values():
        required = {name for name, each in spec.parameters.items() if each.required}
        assert set(new_action_parameters(spec)) == required


def test_an_action_begins_when_all_that_it_waits_for_has_ended(draft: StudyDraft) -> None:
    for act in draft.outline.acts:
        times = action_times(act, draft.checked)
        for action in act.actions:
            ends = [times[id].end for id in action.wait_for]
            assert times[action.id].begin == max(ends, default=0.0)


@pytest.mark.parametrize("width", [60, 79, 119, 199])
def test_rows_keep_within_their_width(draft: StudyDraft, width: int) -> None:
    for act in draft.outline.acts:
        rows = action_rows(act, draft.checked, width, wrong_lines=frozenset())
        assert max(line_width(row.line) for row in rows) <= width
        assert line_width(scale_line(act, draft.checked, width)) <= width + 1
    assert max(line_width(row.line) for row in study_rows(draft, width // 2)) <= width // 2
    assert line_width(top_line(draft, width)) == width


def test_used_by_names_rules_and_keys_and_a_line_leads_back_to_its_act(draft: StudyDraft) -> None:
    assert any(each.startswith("rule ") for each in used_by(draft, "act", "R_Greeting"))
    for act in draft.outline.acts:
        assert find_at(draft, act.file, act.line) == ("act", act.name)


def test_a_setting_stays_what_it_is(study: Path) -> None:
    file = study / "scenario.toml"
    file.write_text(file.read_text() + "\n[fillers]\noffer_after = 2\n")
    fields = settings_of(study)
    assert fields["title"].edits("5") == (SetSetting(("title",), "5"),)
    assert fields["fillers.offer_after"].edits("1.5") == (SetSetting(("fillers", "offer_after"), 1.5),)
    with pytest.raises(EditRefused, match="offer_after is a number; not “soon”"):
        fields["fillers.offer_after"].edits("soon")


def settings_of(study: Path | Workspace, file: str = "scenario.toml") -> dict[str, EditField]:
    """The fields of a file's settings, by their paths with dots."""
    workspace = study if isinstance(study, Workspace) else Workspace(study)
    fields = [each for each in setting_fields(draft_of(workspace)) if each.id.startswith(f"{file}\0")]
    return {each.id.partition("\0")[2].replace("\0", "."): each for each in fields}


@pytest.mark.parametrize(
    ("name", "typed", "value"),
    [
        ("mode", "real", "real"),
        ("trials.columns", "task, items[i].text", ["task", "items[i].text"]),
        ("explore.faults", "2", 2),
        ("explore.pace", "[0.5, 2]", [0.5, 2]),
        ("explore.pace", "any", "any"),
        ("cue.keep", "3s", "3s"),
        ("languages.also", "de", ["de"]),
        ("study.participants", "40", 40),
    ],
)
def test_each_setting_is_offered_with_a_sentence_and_set_as_its_kind(
    study: Path, name: str, typed: str, value: object
) -> None:
    field = settings_of(study)[name]
    assert field.note[0].isupper() and len(field.note.split()) > 2
    assert field.edits(typed) == (SetSetting(tuple(name.split(".")), value),)


@pytest.mark.parametrize(
    ("name", "typed", "why"),
    [
        ("explore.faults", "1.5", "faults is a whole number; not “1.5”"),
        ("explore.faults", "1, 2", "faults is one whole number; not “1, 2”"),
        ("study.participants", "true", "participants is a whole number; not “true”"),
    ],
)
def test_a_setting_of_another_kind_is_refused(study: Path, name: str, typed: str, why: str) -> None:
    with pytest.raises(EditRefused, match=why):
        settings_of(study)[name].edits(typed)


def test_settings_stand_below_the_headings_of_their_tables(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    fields = setting_fields(draft_of(Workspace(tmp_path)))
    headings = [each.label for each in fields if each.kind == "heading"]
    assert headings[0] == "study.toml" and headings.index("factors hesitation") < headings.index("assignment")
    at = headings.index("factors hesitation")
    assert headings[at + 1 : at + 3] == ["factors hesitation levels yes", "factors hesitation levels no"]
    assert "recording lsl" not in headings and all(each.note for each in fields)


@pytest.mark.parametrize(("file", "tables"), [("scenario.toml", SCENARIO_TABLES), ("study.toml", STUDY_TABLES)])
def test_no_two_settings_have_one_path_and_each_says_what_it_does(file: str, tables: Sequence[SettingTable]) -> None:
    settings = [each for table in tables for each in table.settings]
    assert len({each.path for each in settings}) == len(settings)
    for each in (*settings, *tables):
        assert each.meaning[0].isupper() and not each.meaning.endswith("."), each
        assert len(each.meaning.split()) <= 25, each


def test_the_plan_that_a_design_gives_is_shown(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    workspace = Workspace(tmp_path)
    before = plan_lines(str(tmp_path), workspace.files)
    workspace.apply(*settings_of(workspace, "study.toml")["n"].edits("8"))
    after = plan_lines(str(tmp_path), workspace.files)
    assert "for 4 complete participants" in before[0] and "for 8 complete participants" in after[0]
    workspace.apply(*settings_of(workspace, "study.toml")["assignment.between"].edits("list"))
    assert plan_lines(str(tmp_path), workspace.files) == []


def test_private_keys_and_how_long_an_event_is_kept(study: Path) -> None:
    file = study / "scenario.toml"
    file.write_text(file.read_text() + '\n[keys.z]\nevent = "/go"\n')
    fields = settings_of(study)
    assert fields["private"].text == "person_name"
    assert fields["private"].edits("person_name,age") == (SetSetting(("private",), ["person_name", "age"]),)
    assert fields["private"].edits(None) == (SetSetting(("private",), None),)
    assert fields["keys.z.keep"].edits("3s") == (SetSetting(("keys", "z", "keep"), "3s"),)


def test_the_design_of_a_study_has_a_row_for_each_value_of_a_check(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN + '\n[[check]]\nid = "door"\nask = "The door is closed"\n', plan=False)
    workspace = Workspace(tmp_path)
    fields = settings_of(workspace, "study.toml")
    assert settings_of(workspace) == {} and fields["n"].text == "4"
    workspace.apply(*fields["check.0.ask"].edits("The lamp is on"))
    workspace.apply(SetSetting(("check", "1"), {"id": "two", "ask": "Ready", "when": "after"}, file="study.toml"))
    loaded = load_study(tmp_path, check_scenarios=False, held=workspace.files)
    assert loaded.study is not None
    assert [(each.id, each.ask, each.when) for each in loaded.study.checks] == [
        ("door", "The lamp is on", "before"),
        ("two", "Ready", "after"),
    ]


def test_a_check_a_factor_a_level_and_what_it_changes_are_added_to_a_study(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    workspace = Workspace(tmp_path)

    def add(chosen: str, typed: str) -> None:
        found = {each.choice.value: each for each in additions(draft_of(workspace))}
        edits, id = found[chosen].make(typed)
        workspace.apply(*edits)
        assert id in [each.id for each in setting_fields(draft_of(workspace))]

    add("check", "The door is closed")
    add("factor", "voice: quiet, loud")
    add("level voice", "babble")
    add("value voice loud", "distraction = true")
    add("value voice babble", "distraction = babble")
    add("auto disk", "")
    add("stratum", "language: de, en")
    add("wizard", "anna: W1")
    for chosen, typed, why in (
        ("factor", "voice", "A factor has a name and at least two levels"),
        ("factor", "voice: quiet, quiet", "A factor has a name and at least two levels"),
        ("level voice", "loud", "voice has a level “loud” already"),
        ("value voice loud", "distraction", "Write a memory key and its value"),
    ):
        with pytest.raises(EditRefused, match=why):
            add(chosen, typed)
    study = load_study(tmp_path, check_scenarios=False, held=workspace.files).study
    assert study is not None
    assert [(each.id, each.ask or each.auto) for each in study.checks] == [
        ("check1", "The door is closed"),
        ("disk", "disk"),
    ]
    assert study.strata == {"language": ("de", "en")} and study.assignment.strata == ("language",)
    assert study.wizards == {"anna": "W1"}
    voice = next(each for each in study.factors if each.name == "voice")
    assert {each.name: dict(each.memory) for each in voice.levels} == {
        "quiet": {}, "loud": {"distraction": True}, "babble": {"distraction": "babble"},
    }  # fmt: skip


def test_a_key_that_does_something_else_of_the_same_kind_keeps_its_label(study: Path) -> None:
    file = study / "scenario.toml"
    file.write_text(file.read_text() + '\n[keys.z]\nact = "R_Greeting"\nlabel = "hello"\n')
    field = next(each for each in key_fields(draft_of(Workspace(study))) if each.id == "z")
    assert (field.text, field.note) == ("act R_Greeting", "“hello”")
    assert field.edits("act R_Other") == (SetSetting(("keys", "z", "act"), "R_Other"),)
    assert field.edits("event /go") == (SetSetting(("keys", "z"), {"event": "/go"}),)
    with pytest.raises(EditRefused, match="write an act, a rule, an event or a value"):
        field.edits("jump high")


def test_lines_of_the_file_show_what_differs_from_what_is_saved(study: Path) -> None:
    workspace = Workspace(study)
    act = workspace.outline.act("R_Greeting")
    assert act is not None
    speech = next(each for each in act.actions if each.calls[0].type == "Speech")
    workspace.apply(SetParameter("R_Greeting", speech.id, "message", "Good day."))
    draft = draft_of(workspace)
    now = draft.outline.act("R_Greeting")
    assert now is not None
    lines = [plain_text(line) for line in file_lines(draft, FilePlace(act.file, now.line, now.line + 30), 100, 12)]
    assert sum("-|" in line for line in lines) == 1
    assert any("+|" in line and "Good day." in line for line in lines)


def test_a_second_mistake_in_the_same_words_is_a_new_one(study: Path) -> None:
    workspace = Workspace(study)
    unfinished = TransitionForm(condition="person_near and")
    workspace.apply(AddTransition("Greeting", "Nobody", unfinished))
    draft = draft_of(workspace)
    found = first_new_finding(draft, workspace.preview(AddTransition("Greeting", "Nobody", unfinished)))
    assert found is not None and found.message == "something is missing after `and`"
    assert first_new_finding(draft, workspace.preview()) is None
    workspace.close()


@pytest.mark.slow
async def test_the_plan_follows_a_number_while_it_is_typed(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    async with editor(tmp_path, (80, 24)) as it:
        await it.open("settings")
        page = it.screen.opened
        assert isinstance(page, SettingsPage) and not page.effect.display
        page.go_to("study.toml\0assignment\0block")
        await it.press("enter")
        await it.type("3")
        await it.until(lambda: "equally full after 4 and 6 rows" in page.effect.text)
        assert page.effect.display and "block = " not in it.draft_text, "it is only typed"
        await it.press("escape")
        await it.until(lambda: "equally full after 2, 4 and 6 rows" in page.effect.text)
        await it.press("end")
        await it.until(lambda: not page.effect.display)


async def test_a_long_plan_says_how_much_of_it_is_not_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    monkeypatch.setattr(data_pages, "plan_lines", lambda folder, files: [f"line {number}" for number in range(9)])
    async with editor(tmp_path, (80, 24)) as it:
        await it.open("settings")
        page = it.screen.opened
        assert isinstance(page, SettingsPage) and page.head.text.startswith(" DESIGN")
        page.go_to("study.toml\0assignment\0block")
        await it.press("down")
        await it.until(lambda: page.effect.display)
        shown = page.effect.text.splitlines()
        assert shown[-1].startswith(f" +{9 - (len(shown) - 1)} more lines") and len(shown) < 9


@pytest.mark.parametrize(
    ("chosen", "typed", "why"),
    [
        ("camera", "camera: -i 'no end", "quotation mark"),
        ("factor", "hesitation: a, b", "there is a factor hesitation already"),
        ("wizard", "anna: W2", "there is a wizard anna already"),
        ("stratum", "language: fr, it", "there is a stratum language already"),
    ],
)
def test_an_addition_replaces_nothing_and_refuses_what_cannot_be_read(
    tmp_path: Path, chosen: str, typed: str, why: str
) -> None:
    more = '\n[strata]\nlanguage = ["de", "en"]\n[wizards]\nanna = "W1"\n'
    write_study(tmp_path, DESIGN + more, HEAD.replace("status", "language,status"), plan=False)
    found = {each.choice.value: each for each in additions(draft_of(Workspace(tmp_path)))}
    with pytest.raises(EditRefused, match=why):
        found[chosen].make(typed)


def test_names_with_commas_and_levels_that_are_numbers_keep_their_form(tmp_path: Path) -> None:
    design = DESIGN.replace("levels.quiet.", "levels.1.").replace("levels.loud.", "levels.2.")
    survey = '\n[questionnaire.mood]\nfile = "mood.csv"\nleave_out = ["Name, first", "id"]\n'
    write_study(tmp_path, design + survey, plan=False)
    workspace = Workspace(tmp_path)
    labels = [each.label for each in setting_fields(draft_of(workspace)) if each.kind == "heading"]
    assert "factors noise levels 1" in labels and "factors noise levels 3" not in labels
    field = settings_of(workspace, "study.toml")["questionnaire.mood.leave_out"]
    assert field.text is not None
    path = ("questionnaire", "mood", "leave_out")
    assert field.edits(field.text) == (SetSetting(path, ["Name, first", "id"], file="study.toml"),)
    assert field.edits("a, b") == (SetSetting(path, ["a", "b"], file="study.toml"),)
