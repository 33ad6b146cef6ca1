"""An act's graph in lines: what is read from the characters is what the act says."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.author.drawing.act_graph import ActRow, act_rows
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Act, Action, ActionCall
from tests.chance import examples
from tests.tui.fake import DEMO


def act(*waits: str) -> Act:
    """Actions 1, 2, 3, ...; each with the ids for which it waits."""
    return Act(
        "A", tuple(Action(str(n), (ActionCall("Wait", {}),), tuple(text.split())) for n, text in enumerate(waits, 1))
    )


def drawn(some: Act, most: int = 12) -> list[str]:
    return [
        f"{row.level if row.first else ' '} {row.rails} {some.actions[row.position].id}" for row in act_rows(some, most)
    ]


def test_a_chain_a_meeting_and_a_branch() -> None:
    assert drawn(act("", "1", "2")) == [
        "1 ╭── 1",
        "2 ╰┬─ 2",
        "3  ╰─ 3",
    ]
    assert drawn(act("", "", "1 2", "3", "3")) == [
        "1 ╭─── 1",
        "  │╭── 2",
        "2 ╰┴┬─ 3",
        "3   ├─ 4",
        "    ╰─ 5",
    ]


def test_a_chain_and_a_branch_look_different() -> None:
    assert drawn(act("", "1", "1")) != drawn(act("", "1", "2"))
    assert drawn(act("", "1", "1")) == ["1 ╭─ 1", "2 ├─ 2", "  ╰─ 3"]


def test_what_stands_alone_says_so() -> None:
    assert drawn(act("", "", "1")) == ["1 ╭─ 1", "  │╶ 2", "2 ╰─ 3"]
    assert drawn(act("", "")) == ["1 ╶ 1", "  ╶ 2"]


def test_twelve_actions() -> None:
    """As it was looked at."""
    some = act("", "", "", "1 2", "3", "4 5", "4", "6", "6", "7 8 9", "", "10 11")
    assert drawn(some) == [
        "1 ╭───── 1",
        "  │╭──── 2",
        "  ││╭─── 3",
        "  │││╭── 11",
        "2 ╰┴││┬─ 4",
        "  ╭─┴││─ 5",
        "3 ╰┬─│┼─ 6",
        "  ╭│─│┴─ 7",
        "4 │├┬│── 8",
        "  │╰││┬─ 9",
        "5 ╰┬┴│┴─ 10",
        "6  ╰─┴── 12",
    ]


def read(rows: list[ActRow], some: Act) -> set[tuple[str, str]]:
    """Who waits for whom, from the characters alone: a line that is met by another row's way leads from its owner."""
    owners: dict[int, str] = {}
    found = set()
    for row in rows:
        me = some.actions[row.position].id
        touched = [at for at, character in enumerate(row.rails) if character in "╭┬├┼╰┴"]
        begins = [at for at in touched if row.rails[at] in "╭┬"]
        assert len(begins) <= 1
        for at in touched:
            if row.rails[at] in "├┼╰┴":
                found.add((me, owners[at]))
                if row.rails[at] in "╰┴":
                    del owners[at]
        for at, character in enumerate(row.rails):
            assert (character == "│") == (at in owners and at not in touched), "a line is interrupted"
        if touched:
            assert set(row.rails[touched[0] + 1 :]) <= set("─│┬┼┴") and row.rails[-1] == "─"
            assert set(row.rails[: touched[0]]) <= set(" │")
        else:
            assert set(row.rails[:-1]) <= set(" │") and row.rails[-1] == "╶"
        for at in begins:
            assert at not in owners, "two lines in one place"
            owners[at] = me
    assert not owners, "a line leads nowhere"
    return found


@st.composite
def acts(draw: st.DrawFn) -> Act:
    count = draw(st.integers(1, 12))
    waits = [draw(st.lists(st.integers(1, n), max_size=4)) if n else [] for n in range(count)]
    return act(*(" ".join(map(str, each)) for each in waits))


@settings(max_examples=examples(400))
@given(acts(), st.integers(0, 12))
def test_the_lines_say_who_waits_for_whom(some: Act, most: int) -> None:
    rows = act_rows(some, most)
    assert sorted(row.position for row in rows) == list(range(len(some.actions)))
    assert len({len(row.rails) for row in rows}) == 1 and len(rows[0].rails) <= most + 1
    wanted = {(action.id, one) for action in some.actions for one in action.wait_for}
    words = {(some.actions[row.position].id, one) for row in rows for one in row.undrawn}
    lines = read(rows, some)
    assert lines | words == wanted and not lines & words
    if most == 12:
        assert not words, "twelve actions have room for every line"
    level = {some.actions[row.position].id: row.level for row in rows}
    assert all(level[one] < level[me] for me, one in wanted)
    assert [row.first for row in rows] == [n == 0 or rows[n - 1].level != row.level for n, row in enumerate(rows)]


def test_the_demo() -> None:
    scenario = load(DEMO).scenario
    assert scenario is not None
    assert drawn(scenario.acts["Greet"])[2] == "2 ╰┴┬─ 3"
