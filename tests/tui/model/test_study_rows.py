"""The lists of the study's screen."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.study.model import CellStanding
from rise_tui.model.study_rows import NO_CONDITIONS, plan_rows, session_line
from tests.tui.fake_study import entry, standing


@pytest.mark.parametrize("width", [28, 44, 46, 80])
def test_two_cells_of_the_plan_never_look_alike(width: int) -> None:
    names = ("polite+AB", "polite+BA")
    cells = tuple(CellStanding({}, name, done, 0, 6) for done, name in enumerate(names))
    shown = ["".join(text for text, _ in row.line) for row in plan_rows(standing(cells=cells), NO_CONDITIONS, width)]
    for done, name in enumerate(names):
        at = next(number for number, line in enumerate(shown) if name in line)
        assert f"{done} of 6" in " ".join(shown[at : at + 2]), shown


def test_a_reassigned_session_says_where_it_comes_from() -> None:
    moved = replace(entry("P09"), reassigned="run as P08, and reassigned to P09: the wrong name was chosen")
    assert session_line(moved, NO_CONDITIONS).endswith(
        " · run as P08, and reassigned to P09: the wrong name was chosen"
    )
