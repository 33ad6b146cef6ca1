"""The lists of the study's screen."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.study.model import AssignmentSettings, CellStanding, StudyStanding
from rise_tui.model.study_rows import (
    NO_CONDITIONS,
    Conditions,
    conditions_of,
    due_rows,
    find_participant,
    participant_rows,
    person_rows,
    plan_rows,
    session_line,
)
from rise_tui.rendering.text import ListRow, plain_text
from tests.tui.fake_study import entry, standing, study


def texts(rows: list[ListRow]) -> list[str]:
    return [plain_text(row.line) for row in rows]


def beside(now: StudyStanding, conditions: Conditions, name: str, width: int) -> list[str]:
    """What is shown beside the participants while this one is under the cursor."""
    each = find_participant(now, name)
    assert each is not None
    return texts([*plan_rows(now, conditions, width), *due_rows(now, width), *person_rows(each, conditions, width)])


@pytest.mark.parametrize("width", [79, 90, 120])
def test_every_state_is_a_word_and_a_glyph(width: int) -> None:
    lines = texts(participant_rows(standing(), width))
    assert all(len(line) <= width for line in lines)
    for number, word in enumerate(
        (
            *("✓ complete", "✓ complete", "- excluded", "- withdrawn", "◐ unfinished"),
            *("? no outcome", "◇ in progress", "■ aborted", "✗ no consent", "○ waiting"),
        )
    ):
        assert word in lines[number]
    assert [line[:6] for line in lines if "→" in line] == [" → P07"]


@pytest.mark.parametrize("width", [44, 60])
def test_labels_stand_for_levels(width: int) -> None:
    shown = "\n".join(beside(standing(), conditions_of(study()), "P01", width))
    assert "de  A" in shown and "1 complete, 1 begun" in shown and "Media of P01" in shown
    assert "A+loud" in shown and "yes+loud" not in shown


@pytest.mark.parametrize("name", ["P01", "P05", "P07", "P08"])
def test_a_hidden_study_shows_no_condition_before_and_none_of_others(name: str) -> None:
    hidden = conditions_of(study(assignment=AssignmentSettings(strata=("language",), hidden=True)))
    shown = "\n".join([*texts(participant_rows(standing(), 79)), *beside(standing(), hidden, name, 60)])
    assert not any(word in shown for word in ("quiet", "loud", "yes", "A+", " A ", " B "))
    assert "de  " in shown and "1 complete, 1 begun" in shown


@pytest.mark.parametrize("width", [28, 44, 46, 80])
def test_two_cells_of_the_plan_never_look_alike(width: int) -> None:
    names = ("polite+AB", "polite+BA")
    cells = tuple(CellStanding({}, name, done, 0, 6) for done, name in enumerate(names))
    shown = texts(plan_rows(standing(cells=cells), NO_CONDITIONS, width))
    for done, name in enumerate(names):
        at = next(number for number, line in enumerate(shown) if name in line)
        assert f"{done} of 6" in " ".join(shown[at : at + 2]), shown


def test_a_reassigned_session_says_where_it_comes_from() -> None:
    moved = replace(entry("P09"), run_as="P08", reassigned="the wrong name was chosen")
    assert session_line(moved, NO_CONDITIONS).endswith(" · run as P08, and reassigned: the wrong name was chosen")
