"""The same few mutated scenarios in every run of the suite; `./dev fuzz` for others, and thousands."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.__main__ import Fuzz
from tests.fuzz.mutations import BY_KIND, EVERYWHERE

COUNT = 100


@pytest.mark.slow
def test_mutated_scenarios_are_read_or_refused_with_a_sentence(tmp_path: Path) -> None:
    fuzz = Fuzz(tmp_path, seed=2026)
    for number in range(COUNT):
        case = fuzz.case(number)
        assert not case.wrong, f"{case.scenario}/{case.file}, number {number}: {case.wrong}\n{case.content!r}"


@pytest.mark.slow
def test_the_mutations_mutate(tmp_path: Path) -> None:
    """A fuzz that changes nothing, or makes only rubbish, finds nothing."""
    fuzz = Fuzz(tmp_path, seed=7)
    originals = {(folder.name, name): content for folder, name, content in fuzz.files}
    cases = [fuzz.case(number) for number in range(60)]
    changed = [case for case in cases if case.content != originals[case.scenario, case.file]]
    assert len(changed) > 50
    assert 5 < sum(case.accepted for case in changed) < 50
    assert {Path(case.file).suffix for case in cases} == {".xml", ".json", ".toml"}
    for mutation in {*EVERYWHERE, *(each for kind in BY_KIND.values() for each in kind)}:
        assert mutation.__doc__
