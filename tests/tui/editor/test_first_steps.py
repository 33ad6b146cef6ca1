"""What a new user of the editor stumbled over: found words, fields of templates, forms not yet filled in."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.author.edit.edits import AddRule
from rise_engine.author.edit.study_folder import scenarios_below
from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.act_page import ActPage
from rise_tui.editor.data_pages import KeysPage
from rise_tui.editor.model.draft import draft_of, toml_values
from rise_tui.editor.model.study_rows import study_rows
from rise_tui.editor.rule_page import RulePage
from tests.tui.editor.conftest import editor

ACTS = """<Dialogs>
  <Template name="Look"><parameter name="id"/><LookAt><actionID>${id}</actionID>
    <pointx>1</pointx><pointy>0</pointy><pointz>1</pointz></LookAt></Template>
  <Dialog name="R_Riddle">
    <use template="Look" id="1"/>
    <Variants><actionID>2</actionID>
      <Speech><message>Guess.</message></Speech>
      <Speech><message>What has teeth and bites nobody?</message></Speech>
    </Variants>
  </Dialog>
</Dialogs>
"""


@pytest.fixture
def riddle(study: Path) -> Path:
    (study / "acts" / "riddle.xml").write_text(ACTS)
    return study


@pytest.mark.slow
async def test_an_act_found_by_its_words_opens_on_them_also_in_a_later_wording(riddle: Path) -> None:
    before = (riddle / "acts" / "riddle.xml").read_bytes()
    async with editor(riddle) as it:
        await it.press("slash")
        await it.type("bites nobody")
        await it.until(lambda: it.screen.home.current == ("act", "R_Riddle"))
        await it.press("enter", "enter")
        await it.until(lambda: isinstance(it.screen.opened, ActPage))
        page = it.screen.opened
        assert isinstance(page, ActPage)
        await it.until(lambda: page.action is not None and page.action.id == "2")
        await it.open("act", "R_Riddle")
        page = it.screen.opened
        assert isinstance(page, ActPage)
        await it.press("enter", "enter")
        await it.until(lambda: "pointx" in it.notice and "`Look`" in it.notice, "a field of a template says so")
        assert not page.is_typing
    assert (riddle / "acts" / "riddle.xml").read_bytes() == before


async def test_a_form_says_what_the_check_would_find_and_what_is_missing(study: Path) -> None:
    async with editor(study) as it:
        it.screen.make(AddRule("Riddle", "Start"))
        await it.until(lambda: "Riddle" in it.draft_text)
        await it.open("rule", "Riddle")
        page = it.screen.opened
        assert isinstance(page, RulePage)
        panel = page.editor.panel
        await it.press("a")
        assert panel.is_open and "✗" not in panel.text, "an empty form is not wrong yet"
        await it.press("enter")
        assert "✗ it waits for nothing yet" in panel.text
        await it.press("right", "right", "tab")
        await it.type("2")
        await it.until(lambda: "✗" in panel.text and "is not a time" in panel.text)
        await it.type("s")
        await it.until(lambda: "✗" not in panel.text)
        await it.press("tab")
        await it.type("person_near and ")
        await it.until(lambda: "✗ something is missing after `and`" in panel.text and "so far read as" in panel.text)
        await it.type("person_near")
        await it.until(lambda: "✗" not in panel.text)
        await it.press("shift+tab", "shift+tab", "left", "left", "tab")
        await it.type("nxt")
        await it.until(lambda: "▲ nothing in this scenario raises the event `nxt`" in panel.text)
        assert "F5 gives it a key" in panel.text
        assert "Start" in it.draft_text and "after=" not in it.draft_text.partition("Riddle")[2]


def test_the_title_stays_while_there_is_an_error(study: Path) -> None:
    workspace = Workspace(study)
    title = draft_of(workspace).title
    assert title == toml_values((study / "scenario.toml").read_bytes())["title"] != study.name
    (study / "memory.json").write_text("{")
    workspace.read_disk_changes()
    assert workspace.checked.scenario is None and draft_of(workspace).title == title
    assert toml_values(b"title = ") == {}
    workspace.close()


def test_all_wordings_are_searched(riddle: Path) -> None:
    workspace = Workspace(riddle)
    found = [row.id for row in study_rows(draft_of(workspace), 80, "BITES nobody") if row.selectable]
    assert found == ["act\0R_Riddle"]
    workspace.close()


def test_the_folder_of_a_study_leads_to_its_scenarios(study: Path, tmp_path: Path) -> None:
    assert scenarios_below(study) == [], "it is a scenario itself"
    above = tmp_path / "trial"
    above.mkdir()
    assert scenarios_below(above) == []
    (above / "study.toml").write_text('scenario = "../study"\n')
    assert [each.resolve() for each in scenarios_below(above)] == [study]
    (above / "study.toml").write_text('scenario = "gone"\n[factors.f.levels.a]\nscenario = "../study"\n')
    assert [each.resolve() for each in scenarios_below(above)] == [study]
    (above / "study.toml").write_text("scenario = ")
    assert scenarios_below(above) == []


@pytest.mark.slow
async def test_what_a_key_does_is_said_in_words_and_a_taken_one_says_by_what(study: Path) -> None:
    async with editor(study) as found:
        await found.open("keys")
        await found.press("a")
        await found.type("7")
        await found.press("enter")
        await found.type("act R_Nod")
        await found.press("enter")
        await found.until(lambda: "key 7 starts the act R_Nod (new)" in found.notice)
        await found.press("a")
        await found.type("b")
        await found.press("enter")
        await found.until(lambda: "the key b is taken: rule Greeting" in found.notice)
        await found.open("act", "R_Nod")
        page = found.screen.opened
        assert isinstance(page, ActPage) and "keys n 7" in page.head.text
        # A search begins in the list where a page has none.
        await found.send_together("slash", *"Keys", "enter", "enter")
        await found.until(lambda: isinstance(found.screen.opened, KeysPage))
        await found.press("escape", "slash")
        await found.type("zzz")
        await found.until(lambda: "no name or text matches" in found.screen.home.rows.text)
        await found.press("escape")
        await found.send_together("slash", *"R_Introduction", "enter", "enter", "enter", "enter")
        await found.until(lambda: found.screen.page.is_typing)
        field = found.screen.query_one(ActPage).form.input
        await found.until(lambda: field.size.width > 50)
        await found.pilot.resize_terminal(108, 30)
        await found.until(lambda: field.size.width > 80, "an open field lies over the whole row of another window")
