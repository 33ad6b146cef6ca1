"""The text says what the kernel does: an interpreter that was written from docs/explanation/semantics.md alone puts out
the same records, commands and times on random studies. More of them: `./dev soak`."""

import ast
from pathlib import Path

import pytest

from rise_engine.kernel import act_runner, failures, scheduler

from .comparison import MOVES, Disagreement, Play, difference, shortest_difference

ALLOWED = {"rise_engine.expression", "rise_engine.scenario", "rise_engine.kernel.inputs"}
"""The scenario, how its conditions are computed, and what goes in."""
PLAYERS = {"comparison.py", "test_agreement.py"}
"""They play studies to the kernel as well."""
SURPRISES = (297483577, 601569348, 715000606)
"""Studies of the random search that once differed."""


@pytest.fixture(scope="module")
def played() -> tuple[list[str], set[str]]:
    """What differs in 160 studies, and the kinds of records in them."""
    found: list[str] = []
    seen: set[str] = set()
    for study in (*range(160), *SURPRISES):
        play = Play(study)
        try:
            play.run()
        except Disagreement as error:
            found.append(f"{error}\nagain: python -m tests.reference --study {study}")
        seen |= play.seen
    return found, seen


@pytest.mark.slow
@pytest.mark.xdist_group("played")
def test_the_same_studies_every_time(played: tuple[list[str], set[str]]) -> None:
    found, _ = played
    assert not found, "\n".join(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "owner", "name", "wrong"),
    [
        (0, act_runner, "CANCEL_LIMIT", 4.0),
        (17, failures, "LONGEST_PAUSE", 3.0),
        (46, failures.FailedActs, "robot_back", lambda self: None),
        (2, scheduler, "_OUTCOMES", {"SUCCEEDED": "succeeded", "ABORTED": "stopped", "CANCELED": "failed"}),
        (0, act_runner.ActRunner, "_pick_variant", lambda self, run, action: action.calls[0]),
        (315, act_runner.ActRunner, "go_on", lambda self: None),
        (48, scheduler.Scheduler, "resume_waiting", lambda self: None),
    ],
)
def test_a_kernel_that_does_something_else_is_found(
    first: int, owner: object, name: str, wrong: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner, name, wrong)
    study = next(study for study in (first, *range(400)) if difference(study))  # `first`: only to find it sooner
    told = shortest_difference(study)
    assert f"study {study}, input" in told and ("  kernel " in told or "  interpreter " in told)
    assert f" of {MOVES} moves; again: python -m tests.reference --study {study})" in told


@pytest.mark.slow
@pytest.mark.xdist_group("played")
def test_the_studies_use_everything(played: tuple[list[str], set[str]]) -> None:
    _, kinds = played
    assert kinds >= {
        *(f"action {how}" for how in ("started", "accepted", "succeeded", "failed", "canceled", "lost", "skipped")),
        "action timed-out",
        *(f"task {how}" for how in ("PENDING", "ACTIVE", "SUCCEEDED", "ABORTED", "CANCELED", "REJECTED")),
        *(f"rule {how}" for how in ("started", "entered", "stayed", "ended", "stopped", "faulted")),
        *(f"cue {how}" for how in ("marked", "filled", "answered", "undone")),
        *(f"stop {how}" for how in ("requested", "latched", "released")),
        *(f"countdown {how}" for how in ("began", "broken", "failed")),
        *(f"kept {how}" for how in ("kept", "taken", "expired", "taken-back")),
        *(f"failure {how}" for how in ("asked", "waiting", "repeated", "gone-on", "dropped")),
        *(f"{how}{more}" for how in ("start", "resumed", "stepped back") for more in ("", ", without onEntry")),
        *("session recovered", "check", "outcome aborted", "recording stalled", "sync"),
        *("mistake", "timing ABORTED", "timing CANCELED", "note", "memory", "event", "condition", "robot lost"),
    }


def test_the_interpreter_uses_nothing_of_the_kernel() -> None:
    for file in Path(__file__).parent.glob("*.py"):
        if file.name in PLAYERS:
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rise_engine"):
                assert any((node.module or "").startswith(allowed) for allowed in ALLOWED), (file.name, node.module)
            elif isinstance(node, ast.Import):
                assert not any(name.name.startswith("rise_engine") for name in node.names), file.name
