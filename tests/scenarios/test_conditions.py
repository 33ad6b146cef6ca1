"""The shipped studies in each of their conditions: what the record says of the memory is what scenario.toml says."""

from __future__ import annotations

import pytest

from rise_engine.cli import main
from rise_engine.scenario.loader import load
from tests.scenarios.conftest import Play
from tests.scenarios.played import SCENARIOS

STUDIES = {
    path.parent.name: scenario.conditions
    for path in sorted(SCENARIOS.glob("*/scenario.toml"))
    if (scenario := load(path.parent).scenario) is not None and scenario.conditions
}


def test_there_are_studies_with_conditions() -> None:
    assert {name: list(conditions) for name, conditions in STUDIES.items()} == {
        "lablinking": ["hesitation", "no hesitation"],
        "negation": ["negation", "no negation"],
    }


@pytest.mark.parametrize(
    ("study", "condition"), [(study, condition) for study, conditions in STUDIES.items() for condition in conditions]
)
def test_the_memory_is_what_the_condition_says_from_the_first_moment_to_the_last(
    play: Play, study: str, condition: str
) -> None:
    session = play(study, "--condition", condition)
    session.check_sound()
    assert [record["condition"] for record in session.of("session")] == [condition] * 2
    wanted = STUDIES[study][condition].memory
    set_by_it = session.of("memory", source="condition")
    assert {record["key"]: record["value"] for record in set_by_it} == wanted
    assert {record["t"] for record in set_by_it} == {0.0}
    before = [record for record in session.records if record["seq"] < set_by_it[0]["seq"]]
    assert {record["kind"] for record in before} == {"session", "memory"}, "nothing has happened yet"
    assert {record["source"] for record in before[1:]} == {"file"}, "after the start values, before `session`"
    for key, value in wanted.items():
        assert session.of("memory", key=key)[-1]["value"] == value
        assert len(session.of("memory", key=key)) == 2, "nothing has changed it since"


@pytest.mark.parametrize("study", STUDIES)
def test_the_conditions_differ_in_what_the_robot_does(play: Play, study: str) -> None:
    said = [play(study, "--condition", condition).said() for condition in STUDIES[study]]
    assert said[0] != said[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["lablinking", "--condition", "hesitaton"], "did you mean `hesitation`?"),
        (
            ["lablinking", "--mode", "real"],
            "a real session is run in a condition of the study: name one of `hesitation`, `no",
        ),
        (
            ["lablinking", "--condition", "no hesitation", "--set", "hesitation=true"],
            "`hesitation` cannot be set together with",
        ),
        (["greeting", "--condition", "calm"], "write under [conditions.calm] what it sets"),
    ],
)
def test_a_session_that_is_not_what_it_says_is_refused(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["run", *arguments])
    output, errors = capsys.readouterr()
    assert (ended.value.code, output) == (2, "") and errors.startswith("error: ") and sentence in errors


def test_check_says_how_many_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["check", "lablinking"])
    assert "9 memory keys, 2 conditions, robot pepper" in capsys.readouterr().out
