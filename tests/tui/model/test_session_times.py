from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.kernel.records import MemoryRecord
from rise_engine.scenario.model import Act, Action, ActionCall
from rise_engine.scenario.speech.template import parse_template
from rise_tui.model.filtering import InvalidFilter
from rise_tui.model.log_text import parse_moment
from rise_tui.model.store import Store
from rise_tui.model.upcoming import QueuedTask, estimate_starts
from rise_tui.rendering.text import format_clock
from tests.tui.fake import FakeClient, demo


@pytest.mark.parametrize(
    ("typed", "when"),
    [
        ("14:32", 872.0),
        ("0:05", 5.0),
        ("1:14:32", 4472.0),
        ("00:14:32.5", 872.5),
        ("90:00", 5400.0),
        ("90", 90.0),
        ("90s", 90.0),
        ("2m", 120.0),
        ("2 min", 120.0),
        ("1h2m3s", 3723.0),
        ("-30s", 970.0),
        ("-30", 970.0),
        ("- 2m", 880.0),
        ("-1:00", 940.0),
        ("−10s", 990.0),
        ("-5h", 0.0),
        ("+5", 5.0),
        ("now", None),
        (" END ", None),
    ],
)
def test_times_as_people_type_them(typed: str, when: float | None) -> None:
    assert parse_moment(typed, 1000.0) == when


@pytest.mark.parametrize("typed", ["", "-", "later", "14:75", "1:75:00", "1:2:3:4", "5x", "s", "m5"])
def test_what_is_no_time_says_so(typed: str) -> None:
    with pytest.raises(InvalidFilter, match=r"59|14:32"):
        parse_moment(typed, 1000.0)


@given(st.integers(0, 99 * 3600))
def test_a_time_as_the_console_shows_it_is_read_back(whole: int) -> None:
    assert parse_moment(format_clock(float(whole)), 0.0) == whole


@pytest.mark.parametrize(
    ("running", "waiting", "expected"),
    [
        ([], [QueuedTask(3)], [0]),
        ([QueuedTask(10, 4)], [QueuedTask(3), QueuedTask(2)], [6, 9]),
        ([QueuedTask(10, 14)], [QueuedTask(3), QueuedTask(2)], [0, 3]),  # overdue: at any moment
        (
            [QueuedTask(10, 4), QueuedTask(60, 0, in_turn=False)],
            [QueuedTask(3)],
            [6],
        ),  # what runs beside is no obstacle
        ([QueuedTask(10, 4)], [QueuedTask(50, in_turn=False), QueuedTask(3)], [6, 6]),
        ([QueuedTask(None, 4)], [QueuedTask(3)], [None]),
        ([QueuedTask(10, 4)], [QueuedTask(None), QueuedTask(3)], [6, None]),
    ],
)
def test_when_waiting_tasks_start(
    running: list[QueuedTask], waiting: list[QueuedTask], expected: list[float | None]
) -> None:
    assert estimate_starts(running, waiting) == expected


turns = st.builds(QueuedTask, st.floats(0, 100), st.floats(0, 100), st.booleans())


@given(st.lists(turns, max_size=3), st.lists(turns, max_size=6))
def test_nothing_starts_before_what_comes_before_it(running: list[QueuedTask], waiting: list[QueuedTask]) -> None:
    found = estimate_starts(running, waiting)
    assert found == sorted(found, key=lambda at: at or 0.0) and all(at is not None and at >= 0 for at in found)


def test_an_estimate_follows_the_memory() -> None:
    speech = ActionCall("Speech", {"message": parse_template("{sentence}")})
    scenario = replace(
        demo(), acts={**demo().acts, "Say": Act("Say", (Action("1", (speech,)),))}, memory={"sentence": "short"}
    )
    client = FakeClient(scenario)
    client.emit(MemoryRecord(0, 0.0, "", "sentence", "short", None, "file", created=True))
    store = Store(client.attach_reply(), "anna", client.now)
    before = store.typical_seconds("Say")
    store.apply([MemoryRecord(99, 1.0, "", "sentence", "a much longer sentence " * 9, "short", "rule:R")])
    after = store.typical_seconds("Say")
    assert before is not None and after is not None and after > 10 * before
