"""A rule as a drawing: everything is in it once, rails begin and end where they should, and nothing moves."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len

from rise_engine.author.drawing.state_graph import GraphEdge, GraphLayout, find_state_order, lay_out_graph, most_lanes
from rise_engine.expression import Expression
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Delay, Rule, State, Transition
from rise_tui.model.states import HERE, GraphPosition, draw_state_graph
from rise_tui.rendering.text import plain_text
from tests.chance import examples


def rule(**ways: str) -> Rule:
    """A rule from lines like `a="next b, after c, stay -"`: for each state its transitions, event and target."""
    states = {}
    for name, text in ways.items():
        pairs = [part.split() for part in text.split(",") if part.strip()]
        states[name] = State(
            name, transitions=tuple(Transition(event, target=None if to == "-" else to) for event, to in pairs)
        )
    return Rule("R", next(iter(ways)), states)


def forty() -> Rule:
    """Ten tasks of three steps each, with repetitions, a way to each task, breaks, and a goodbye from everywhere."""
    states = {"start": State("start", transitions=tuple(Transition(f"to_{n}", target=f"t{n}a") for n in range(10)))}
    for n in range(10):
        later = f"t{n + 1}a" if n < 9 else "goodbye"
        plan = {"a": (f"t{n}b",), "b": (f"t{n}c", f"t{n}a"), "c": (later, f"t{n}a")}
        for letter, targets in plan.items():
            names = ("next", "repeat")
            ways = [Transition(names[at], target=target) for at, target in enumerate(targets)]
            states[f"t{n}{letter}"] = State(f"t{n}{letter}", transitions=(*ways, Transition("stop", target="goodbye")))
    for n in range(7):
        states[f"pause{n}"] = State(f"pause{n}", transitions=(Transition(None, after=Delay("", 5), target=f"t{n}a"),))
        states[f"t{n}c"] = State(
            f"t{n}c", transitions=(*states[f"t{n}c"].transitions, Transition("break", target=f"pause{n}"))
        )
    states["goodbye"] = State("goodbye", transitions=(Transition("R_Goodbye_end", target="over"),))
    states["over"] = State("over")
    assert len(states) == 40
    return Rule("Forty", "start", states)


def texts(layout: GraphLayout, now: GraphPosition | None = None) -> list[str]:
    return [plain_text(row.line) for row in draw_state_graph(layout, now or GraphPosition())]


# --- drawings that somebody has looked at ---------------------------------------------------------------------------


def test_five_states() -> None:
    five = rule(
        instruct="R_Instruct_end waiting",
        waiting="next instruct, repeat again, nod -, enough goodbye",
        again="R_Again_end waiting",
        goodbye="R_Goodbye_end over",
        over="",
    )
    assert [line.rstrip() for line in texts(lay_out_graph(five, 60), GraphPosition("waiting", ("instruct", 0)))] == [
        "   ╭►◎ instruct  maybe next  start",
        "   │ ↓ R_Instruct_end  last step",
        " ╭─│►● waiting  here",
        " │ ╰─┤ next",
        " │   ↺ nod  stays",
        " │ ╭─┤ enough",
        " │ │ ↓ repeat",
        " │ │ ◎ again  maybe next",
        " ╰─│─╯ R_Again_end",
        "   ╰►◎ goodbye  maybe next",
        "     ↓ R_Goodbye_end",
        "     ○ over  end",
    ]


def test_the_rule_of_the_paper() -> None:
    """Listing 2: ask again until somebody interacts."""
    states = {
        "State 1": State("State 1", transitions=(Transition("R_Greeting_end", target="State 2"),)),
        "State 2": State(
            "State 2",
            transitions=(
                Transition("H_no_interaction", target="State 3"),
                Transition("R_ResponseToUser_end", target="State 4"),
            ),
        ),
        "State 3": State("State 3", transitions=(Transition("R_RequestInteraction_end", target="State 2"),)),
        "State 4": State("State 4"),
    }
    paper = Rule("Interaction Loop", "State 1", states, priority=1)
    assert [line.rstrip() for line in texts(lay_out_graph(paper, 50), GraphPosition("State 3", ("State 2", 0)))] == [
        "     ○ State 1  start",
        "     ↓ R_Greeting_end",
        " ╭──►◎ State 2  maybe next",
        " │ ╭─┤ R_ResponseToUser_end",
        " │ │ ↓ H_no_interaction  last step",
        " │ │ ● State 3  here",
        " ╰─│─╯ R_RequestInteraction_end",
        "   ╰►○ State 4  end",
    ]


def test_one_rail_for_all_that_come_back() -> None:
    """It begins with the nearest of them, so that it stands inside although it is the longest in the end."""
    rooms = rule(hall="ask think, to_a a, to_b b, to_c c", think="x hall", a="x hall", b="x hall", c="x hall")
    assert [line.rstrip() for line in texts(lay_out_graph(rooms, 80))] == [
        "     ╭──►○ hall  start",
        "     │ ╭─┤ to_a",
        "   ╭─│─│─┤ to_b",
        " ╭─│─│─│─┤ to_c",
        " │ │ │ │ ↓ ask",
        " │ │ │ │ ○ think",
        " │ │ ├─│─╯ x",
        " │ │ │ ╰►○ a",
        " │ │ ├───╯ x",
        " │ ╰─│──►○ b",
        " │   ├───╯ x → hall",
        " ╰───│──►○ c",
        "     ╰───╯ x → hall",
    ]


@pytest.mark.parametrize("width", [40, 80, 120])
def test_forty_states(width: int) -> None:
    """The drawings in the folder `drawings`, as they were looked at."""
    drawn = texts(lay_out_graph(forty(), width), GraphPosition("t2b", ("t2a", 0)))
    looked_at = (Path(__file__).parent / "drawings" / f"forty_{width}.txt").read_text("utf-8")
    assert [line.rstrip() for line in drawn] == looked_at.splitlines()


def test_the_rule_of_the_study() -> None:
    """Forty-five states: each instruction and the repetition of it are together, and nothing is said in words."""
    scenario = load(str(Path(__file__).parents[3] / "scenarios" / "lablinking")).scenario
    assert scenario is not None
    layout = check(scenario.rules["Table setting"], 80)
    drawn = [line.rstrip() for line in texts(layout, GraphPosition("After the welcome", ("Welcome", 0)))]
    assert drawn[:11] == [
        "           ○ Start  start                           ↓ at once",
        "       ╭───┤   task = 1",
        "     ╭─│───┤   task = 2 → Task 2, introduction",
        "   ╭─│─│───┤   task = 3 → Task 3, introduction",
        " ╭─│─│─│───┤   task = 4 → Task 4, introduction",
        " │ │ │ │ ╭►◎ Welcome  maybe next                    ↓ R_Welcome ended  last step",
        " │ │ │ │ │ ● After the welcome  here                ↓ next",
        " │ │ │ │ ╰─┤   repeat",
        " │ │ │ ├──►◎ Task 1, introduction  maybe next       ↓ R_Task1_Intro ended",
        " │ │ │ │   ○ After task 1, introduction             ↓ next",
        " │ │ │ ╰───┤   repeat",
    ]
    assert {edge.kind for edge in layout.edges.values()} == {"down", "rail"}


# --- properties -----------------------------------------------------------------------------------------------------

NAMES = st.text("abz 日é\n", min_size=1, max_size=24)


@st.composite
def rules(draw_: st.DrawFn) -> Rule:
    names = draw_(st.lists(NAMES, min_size=1, max_size=14, unique=True))
    states = {}
    for name in names:
        ways = []
        for _ in range(draw_(st.integers(0, 4))):
            target = draw_(st.sampled_from([*names, None]))
            event, after = draw_(
                st.sampled_from([("next", None), ("a_long_name_of_an_event_end", None), (None, 2.5), (None, None)])
            )
            condition = draw_(st.sampled_from([None, "task = 4 and understood"])) if event or after else "ready"
            ways.append(
                Transition(
                    event,
                    Expression.parse(condition) if condition else None,
                    after=Delay("", after) if after else None,
                    target=target,
                )
            )
        states[name] = State(name, transitions=tuple(ways))
    return Rule("R", draw_(st.sampled_from(names)), states)


STROKES = {"│": "ud", "╭": "dr", "╰": "ur", "├": "udr", "─": "lr", "►": "l", " ": ""}


def follow(layout: GraphLayout, drawn: list[str], edge: GraphEdge) -> int:
    """The row at which a way's rail has its arrow, read from the characters alone."""
    column, row = layout.gutter, edge.row
    assert drawn[row][column] in "┤╯"
    column -= 1
    while drawn[row][column] in "─│":  # a rail that crosses is drawn over the way
        column -= 1
    assert drawn[row][column] in "╭╰├"
    found = []
    for step, stroke, back in ((-1, "u", "d"), (1, "d", "u")):
        at = row
        while stroke in STROKES[drawn[at][column]]:
            at += step
            assert back in STROKES[drawn[at][column]], "a rail is interrupted"
            if drawn[at][column] in "╭╰├" and drawn[at][layout.gutter - 1] == "►":
                assert set(drawn[at][column + 1 : layout.gutter - 1]) <= {"─", "│"}
                found.append(at)
    assert len(found) == 1, "a rail has exactly one arrow"
    return found[0]


def check(some: Rule, width: int) -> GraphLayout:
    layout = lay_out_graph(some, width)
    drawn = texts(layout)
    assert sorted(layout.row_of) == sorted(some.states)
    wanted = {(name, index) for name, state in some.states.items() for index in range(len(state.transitions))}
    shown = [(row.edge.source, row.edge.number) for row in layout.rows if row.edge is not None]
    assert sorted(shown) == sorted(wanted), "every transition is there exactly once"
    assert {(edge.source, edge.number) for edge in layout.edges.values()} == wanted
    states = [at for at, row in enumerate(layout.rows) if row.is_state]
    for at, row in enumerate(layout.rows):
        assert cell_len(drawn[at]) <= width
        assert drawn[at].startswith(row.rails) and len(row.rails) == layout.gutter <= 2 * most_lanes(width) + 1
        assert sum(character in "╭╰├" for character in row.rails) <= 1
        edge = row.edge
        if edge is None:
            continue
        assert edge.row == at and some.states[edge.source].transitions[edge.number].target == edge.target
        below = next((one for one in states if one > at), None)
        match edge.kind:
            case "rail":
                assert layout.rows[follow(layout, drawn, edge)].state == edge.target
            case "down":
                assert below is not None and layout.rows[below].state == edge.target and "↓" in drawn[at]
            case "word":
                assert " → " in drawn[at] and drawn[at][layout.gutter] in "├╰"
            case "again":
                assert edge.target == edge.source and drawn[at].endswith("  again") and drawn[at][layout.gutter] == "↺"
            case "stays":
                assert edge.target is None and drawn[at].endswith("  stays") and drawn[at][layout.gutter] == "↺"
    return layout


@pytest.mark.slow
@settings(max_examples=examples(300))
@given(rules(), st.integers(34, 130))
def test_everything_is_there_once_and_rails_lead_where_they_should(some: Rule, width: int) -> None:
    layout = check(some, width)
    assert layout == lay_out_graph(some, width)


@pytest.mark.slow
@settings(max_examples=examples(150))
@given(rules(), st.integers(34, 130), st.data())
def test_only_marks_change(some: Rule, width: int, data: st.DataObject) -> None:
    layout = lay_out_graph(some, width)
    still = texts(layout)
    here = data.draw(st.sampled_from(sorted(some.states)))
    last = data.draw(st.sampled_from([None, *sorted(layout.edges)]))
    rows = draw_state_graph(layout, GraphPosition(here, last))
    assert [row.id for row in rows if row.id.startswith(HERE)] == [f"{HERE}:{here}"]
    assert rows[layout.row_of[here]].id == f"{HERE}:{here}"
    assert len(rows) == len(still)
    for before, row, plan in zip(still, rows, layout.rows, strict=True):
        now = plain_text(row.line)
        assert cell_len(now) <= width
        assert now[: layout.gutter] == before[: layout.gutter]
        if plan.is_state:
            assert (
                now[layout.gutter] == ("●" if plan.state == here else now[layout.gutter])
                and now[layout.gutter] in "●◎○"
            )
            assert ("  here" in now) == (plan.state == here)
            assert ("  maybe next" in now) == (now[layout.gutter] == "◎")
        else:
            assert now[layout.gutter] == before[layout.gutter]
        taken = plan.edge is not None and (plan.edge.source, plan.edge.number) == last
        assert now.rstrip().endswith("last step") == taken


def test_what_was_taken_is_seen_beside_all_that_can_be_said_of_a_state() -> None:
    """In a long rule a state and its way share a row: `maybe next`, `never reached` and `last step` at once."""
    chain = {f"s{number}": way_to(f"s{number}", f"s{number + 1}") for number in range(14)} | {"s14": State("s14")}
    apart = {"lost": way_to("lost", "off"), "off": way_to("off", "on"), "on": way_to("on", "s0")}
    shared = 0
    for width in range(40, 80):
        layout = lay_out_graph(Rule("R", "s0", {**chain, **apart}), width)
        shared += layout.names > 0
        rows = draw_state_graph(layout, GraphPosition("lost", ("off", 0)))
        (taken,) = (row for row in map(plain_text, (row.line for row in rows)) if "last step" in row)
        assert taken.rstrip().endswith("last step"), (width, taken)
    assert shared, "it is not long enough"


def way_to(state: str, target: str) -> State:
    return State(state, transitions=(Transition("next", target=target),))


def test_forty_states_at_every_width() -> None:
    words = []
    for width in range(30, 140):
        layout = check(forty(), width)
        words.append(sum(edge.kind == "word" for edge in layout.edges.values()))
        near = [edge for edge in layout.edges.values() if edge.label == "repeat"]
        assert {edge.kind for edge in near} == {"rail"}, "a short way gives way to a long one"
    assert sorted(words, reverse=True) == words, "more room, and less is drawn"
    assert words[0] > words[-1] > 0


# --- order ----------------------------------------------------------------------------------------------------------


def order(some: Rule) -> str:
    return " ".join(find_state_order(some).states)


def test_the_usual_course_reads_from_top_to_bottom() -> None:
    assert order(rule(a="x b", b="x c, back a", c="x d", d="")) == "a b c d"
    assert order(rule(a="stop end, x b", b="x c", c="x a", end="")) == "a b c end", "ends come last"
    assert order(rule(a="yes b, no c", b="x d", c="x d", d="x a")) == "a b c d", "a meeting point after its branches"
    assert order(rule(a="one b, four e", b="x c", c="x d", d="x e", e="again b, x f", f="")) == "a b c d e f"


def test_what_no_course_reaches_stands_last_and_says_so() -> None:
    some = rule(a="x b", lost="x b, y more", b="", more="x lost")
    assert order(some) == "a b lost more" and find_state_order(some).reached == 2
    drawn = texts(lay_out_graph(some, 60))
    assert [line.split()[-1] for line in drawn if "never reached" in line] == ["reached", "reached"]
    assert "never" not in next(line for line in drawn if "○ b" in line)


@pytest.mark.slow
@given(rules())
def test_an_order_has_every_state_once_and_the_first_state_first(some: Rule) -> None:
    states, reached = find_state_order(some)
    assert sorted(states) == sorted(some.states) and states[0] == some.initial
    found = {some.initial}
    while new := {w.target for name in found for w in some.states[name].transitions if w.target} - found:
        found |= new
    assert set(states[:reached]) == found
