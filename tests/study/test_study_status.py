"""How a study stands, in the lines of `study status`."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.cli.study.day import next_lines, status_lines
from rise_engine.study.state import read_state
from tests.study.studies import DESIGN, HEAD, write_study

HIDDEN = DESIGN.replace("spare = 0.5", "spare = 0.5\nhidden = true")
TONGUES = '\n[strata]\nlanguage = ["de", "en"]\n'
STRATA = DESIGN.replace("spare = 0.5", 'spare = 0.5\nstrata = ["language"]') + TONGUES
PEOPLE = HEAD.replace("participant,", "participant,language,") + "P01,de,2026-11-01,,\nP02,en,2026-11-01,,\n"


def plan_table(lines: list[str]) -> list[list[str]]:
    """The words of the lines about the cells."""
    start = next(at for at, line in enumerate(lines) if line.startswith("cells of the plan"))
    rest = lines[start + 1 :]
    return [line.split() for line in rest[: rest.index("")]]


@pytest.mark.parametrize(
    ("design", "people", "rows"),
    [
        (DESIGN, None, [["condition", "complete", "open", "planned"], ["no", "0", "0", "2"], ["yes", "0", "0", "2"]]),
        (HIDDEN, None, [["complete", "open", "planned"], ["0", "0", "4"]]),
        (
            STRATA,
            PEOPLE,
            [
                ["language", "condition", "complete", "open"],
                ["de", "no", "0", "0"],
                ["de", "yes", "0", "0"],
                ["en", "no", "0", "0"],
                ["en", "yes", "0", "0"],
            ],
        ),
        (
            STRATA.replace("spare = 0.5", "spare = 0.5\nhidden = true"),
            PEOPLE,
            [["language", "complete", "open"], ["de", "0", "0"], ["en", "0", "0"]],
        ),
    ],
)
def test_the_cells_of_the_plan(tmp_path: Path, design: str, people: str | None, rows: list[list[str]]) -> None:
    """Of a hidden study only how many there are; how many are planned only where it is known."""
    write_study(tmp_path, design, people) if people else write_study(tmp_path, design)
    head, *found = plan_table(status_lines(read_state(tmp_path)))
    assert [head, *sorted(found)] == rows


def test_who_is_next_is_told_without_the_condition_of_a_hidden_study(tmp_path: Path) -> None:
    write_study(tmp_path, HIDDEN)
    shown = "\n".join([*next_lines(read_state(tmp_path)), *status_lines(read_state(tmp_path))])
    assert "P01, run 1 of 2" in shown
    assert not any(word in shown for word in ("yes", "quiet", "loud", "condition "))
