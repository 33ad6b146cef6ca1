"""What a text with memory values says in each condition, in each language and for each row."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.dialogs import PickList
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.model.said_texts import said_texts
from tests.study.studies import DESIGN, write_study

from .conftest import editor

MESSAGES = (
    "Good morning.",
    "Hello {name}!",
    "{items[order[i]][form]}",
    "Is it {items[i].text}, {name}?",
    "{missing}",
    "{score[0]} points",
)
HERE = "plain, en, items {} and 1 other"


@pytest.fixture
def draft(tmp_path: Path) -> StudyDraft:
    acts = "".join(
        f'<Dialog name="R_{number}"><Speech><actionID>1</actionID><message>{text}</message></Speech></Dialog>'
        for number, text in enumerate(MESSAGES)
    )
    files = {
        "scenario.toml": 'language = "en"\n[languages]\nalso = ["de"]\n'
        '[conditions.plain]\nmemory = { form = "text" }\n[conditions.polite]\nmemory = { form = "long" }\n',
        "acts/acts.xml": f"<Dialogs>{acts}</Dialogs>",
        "memory.json": json.dumps({"name": "Ada", "form": "text", "i": 0, "order": [], "score": [3]}),
        "tables/items.csv": "text,long,text.de\nred,a red one,rot\nblue,a blue one,blau\n",
        "texts/de.toml": '[R_1]\n1 = { text = "Hallo {name}!", of = "Hello {name}!" }\n',
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return draft_of(Workspace(tmp_path))


@pytest.mark.parametrize(
    ("act", "expected"),
    [
        ("R_0", []),
        ("R_1", [("Hello Ada!", "plain, en and 1 other"), ("Hallo Ada!", "plain, de and 1 other")]),
        (
            "R_2",
            [
                ("red", "plain, en, items 1"),
                ("blue", "plain, en, items 2"),
                ("rot", "plain, de, items 1"),
                ("blau", "plain, de, items 2"),
                ("a red one", "polite, en, items 1 and 1 other"),
                ("a blue one", "polite, en, items 2 and 1 other"),
            ],
        ),
        ("R_3", [("Is it red, Ada?", HERE.format(1)), ("Is it blue, Ada?", HERE.format(2))]),
        ("R_4", [("{missing} has no value yet", "")]),
        ("R_5", [("3 points", "")]),
    ],
)  # fmt: skip
def test_what_a_text_says_and_where(draft: StudyDraft, act: str, expected: list[tuple[str, str]]) -> None:
    (spoken,) = [each for each in draft.checked.texts if each.act == act]
    assert [tuple(each) for each in said_texts(draft, spoken)] == expected


def test_the_cells_of_a_study_above_are_the_conditions(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN, plan=False)
    draft = draft_of(Workspace(tmp_path / "scenario"))
    (spoken,) = [each for each in draft.checked.texts if each.act == "Tell"]
    assert [tuple(each) for each in said_texts(draft, spoken)] == [
        ("true, 0", "yes+quiet"), ("true, 3", "yes+loud"), ("false, 0", "no+quiet"), ("false, 3", "no+loud"),
    ]  # fmt: skip


async def test_an_act_shows_the_first_and_lists_all(draft: StudyDraft) -> None:
    async with editor(Path(draft.folder), (80, 24)) as it:
        await it.open("act", "R_2")
        assert "says “red”" in it.screen.opened.parting.text and "u +5" in it.screen.opened.parting.text
        await it.press("u")
        await it.shows(PickList)
        assert "polite, en, items 2 and 1 other" in it.pilot.app.screen.list.text
        await it.press("escape")
        await it.open("act", "R_0")
        await it.press("u")
        await it.until(lambda: "it says the same in every condition" in it.notice)
