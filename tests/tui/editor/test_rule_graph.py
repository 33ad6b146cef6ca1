"""A rule's graph with a cursor, and the list of what a state does."""

from __future__ import annotations

from rise_engine.author.edit.edits import (
    CallForm,
    MoveStatement,
    MoveTransition,
    RemoveStatement,
    RemoveTransition,
    StatementAddress,
)
from rise_tui.editor.model.rule_graph import (
    GraphSpot,
    beside,
    draw_rule,
    lay_out_rule,
    parse_spot,
    row_spots,
    valid_spot,
)
from rise_tui.editor.model.state_parts import (
    PartRow,
    movement,
    removal,
    state_parts,
    use_of,
)
from rise_tui.rendering.text import plain_text
from tests.tui.editor.small_study import FILES, outline_of, small_study

OUTLINE = small_study().outline
COURSE = OUTLINE.rules[0]
START, WAIT = COURSE.states[:2]
PARTS = state_parts("Course", START)
NOD = CallForm("startCommunicationRobotAct", "R_Nod")


def drawing(width: int = 60, spot: GraphSpot | None = None) -> list[str]:
    layout = lay_out_rule(COURSE, width)
    assert layout is not None
    return [plain_text(row.line).rstrip() for row in draw_rule(layout, spot, {GraphSpot("Start", 1): "error"})]


def part(text: str, nth: int = 0) -> PartRow:
    return [row for row in PARTS if row.text.startswith(text)][nth]


def at(place: str, *path: int, transition: int = 0) -> StatementAddress:
    return StatementAddress("Course", "Start", place, transition, path)  # type: ignore[arg-type]


def test_every_state_and_every_way_is_drawn_and_can_be_chosen() -> None:
    layout = lay_out_rule(COURSE, 60)
    assert layout is not None
    spots = [spot for row in layout.rows for spot in row_spots(row)]
    expected = {GraphSpot(state.id) for state in COURSE.states}
    expected |= {GraphSpot(state.id, number) for state in COURSE.states for number in range(len(state.transitions))}
    assert set(spots) == expected and len(spots) == len(expected)
    assert all(parse_spot(spot.id) == spot for spot in spots)


def test_a_finding_stands_beside_its_way() -> None:
    (marked,) = (line for line in drawing() if line.startswith("✗"))
    assert "skip if step < 4 and not happy" in marked


def test_the_cursor_on_a_way_lights_its_rail() -> None:
    layout = lay_out_rule(COURSE, 60)
    assert layout is not None
    spot = next(GraphSpot(*key) for key, edge in layout.edges.items() if edge.kind == "rail")
    lit = [row for row in draw_rule(layout, spot, {}) if any(role == "accent" for _, role in row.line)]
    assert len(lit) >= 2
    assert not any(role == "accent" for row in draw_rule(layout, None, {}) for _, role in row.line)


def test_in_a_long_rule_a_state_and_its_way_share_a_row() -> None:
    states = "".join(f'<State id="S{i}"><transition eventTopic="/e" target="S{i + 1}"/></State>' for i in range(20))
    rule = f'<InteractionRule name="Long" initial="S0">{states}<State id="S20"/></InteractionRule>'
    outline = outline_of({**FILES, "rules/long.xml": rule.encode()})
    layout = lay_out_rule(outline.rules[-1], 78)
    assert layout is not None
    state, transition = GraphSpot("S3"), GraphSpot("S3", 0)
    assert (
        beside(layout, state, 1) == transition
        and beside(layout, transition, 1) == transition
        and beside(layout, transition, -1) == state
    )
    ids = [row.id for row in draw_rule(layout, transition, {})]
    assert transition.id in ids and state.id not in ids
    assert valid_spot(layout, outline.rules[-1], GraphSpot("S3", 5)) == state
    assert valid_spot(layout, outline.rules[-1], GraphSpot("gone")) == GraphSpot("S0")


def test_what_is_wrong_is_drawn_as_it_is_written() -> None:
    broken = (
        FILES["rules/course.xml"]
        .replace(b"step &lt; 4 and not happy", b"step &lt; and")
        .replace(b'target="End">', b'target="Endd">')
    )
    rule = outline_of({**FILES, "rules/course.xml": broken}).rules[0]
    layout = lay_out_rule(rule, 70)
    assert layout is not None
    text = "\n".join(plain_text(row.line) for row in draw_rule(layout, None, {}))
    assert "skip if step < and → Endd" in text


def test_a_rule_without_states_has_no_drawing() -> None:
    rule = outline_of({**FILES, "rules/course.xml": b'<InteractionRule name="E" initial="a"/>'}).rules[0]
    assert lay_out_rule(rule, 60) is None


def test_the_list_of_a_state() -> None:
    assert ["  " * row.depth + row.text for row in PARTS] == [
        "WHEN IT IS ENTERED",
        "  set step = 0",
        "  if step < 4",
        "    start the act R_Hello",
        "  otherwise, if happy",
        "    raise the event /cheer, kept for 5s if nobody waits",
        "  otherwise",
        "    nothing yet",
        "  one of these, by chance",
        "    start the act R_Hello",
        "    start the rule Other, in the state Two, without what it does on entry",
        "TRANSITIONS",
        "1 as soon as R_Hello has failed or stopped",
        "2 as soon as /skip happens",
        "    stop the act R_Hello",
        "3 when this has been true for {pause_ms}ms: happy",
        "4 at once",
        "WHEN IT IS LEFT   –",
    ]
    assert len({row.id for row in PARTS}) == len(PARTS)


def test_each_row_finds_its_statement() -> None:
    for row in PARTS:
        if row.kind == "call":
            assert row.call is not None and row.call.argument.strip("/") in row.text


def test_where_something_new_stands() -> None:
    def new(row: PartRow, *, behind: bool = False) -> StatementAddress | None:
        return row.behind if behind else row.new

    assert new(part("WHEN IT IS ENTERED")) == at("onEntry", 3)
    assert new(part("set step")) == at("onEntry", 1)
    assert new(part("if step")) == at("onEntry", 1, 0, 0)
    assert new(part("if step"), behind=True) == at("onEntry", 2)
    assert new(part("start the act R_Hello")) == at("onEntry", 1, 0, 1)
    assert new(part("start the act R_Hello"), behind=True) == at("onEntry", 2)
    assert new(part("otherwise, if")) == at("onEntry", 1, 1, 0)
    assert new(part("otherwise, if"), behind=True) == at("onEntry", 2)
    assert new(part("nothing yet")) == at("onEntry", 1, 2, 0)
    assert new(part("nothing yet"), behind=True) == at("onEntry", 2)
    assert new(part("one of these")) == at("onEntry", 2, 0)
    assert new(part("one of these"), behind=True) == at("onEntry", 3)
    assert new(part("start the act R_Hello", 1)) == at("onEntry", 2, 1)
    assert new(part("start the act R_Hello", 1), behind=True) == at("onEntry", 3)
    assert new(part("2 as soon as")) == at("transition", 1, transition=1)
    assert new(part("stop the act")) == at("transition", 1, transition=1)
    assert new(part("WHEN IT IS LEFT")) == at("onExit", 0)
    assert new(part("TRANSITIONS")) is None


def test_an_arm_stands_before_the_last_otherwise() -> None:
    for row in (part("if step"), part("start the act R_Hello"), part("otherwise, if"), part("nothing yet")):
        assert row.new_branch == at("onEntry", 1, 2) and not row.can_be_else
    assert part("set step").new_branch is None
    assert part("2 as soon as").new_branch is None


def test_what_is_taken_away_and_moved() -> None:
    assert removal(part("otherwise, if"), START, "Course") == RemoveStatement(at("onEntry", 1, 1))
    assert removal(part("if step"), START, "Course") == RemoveStatement(at("onEntry", 1))
    skip = START.transitions[1].form
    assert removal(part("2 as soon as"), START, "Course") == RemoveTransition("Course", "Start", 1, skip)
    assert removal(part("TRANSITIONS"), START, "Course") is None
    assert movement(part("2 as soon as"), START, "Course", -1) == MoveTransition("Course", "Start", 1, skip, 0)
    assert movement(part("1 as soon as"), START, "Course", -1) is None
    assert movement(part("if step"), START, "Course", 1) == MoveStatement(at("onEntry", 1), 2)
    assert movement(part("one of these"), START, "Course", 1) is None


def test_what_comes_from_a_template_is_shown_with_what_is_given_to_it() -> None:
    use = use_of(OUTLINE, WAIT)
    assert use is not None and use_of(OUTLINE, START) is None
    rows = state_parts("Course", WAIT, use)
    assert [(row.text, row.guard) for row in rows if row.kind == "parameter"] == [
        ("id = Wait", ""),
        ("then = End", ""),
        ("pause = 2s", "as the template says"),
    ]
    transitions = [row for row in rows if row.kind == "transition"]
    assert transitions[0].reason and not transitions[1].reason, "what the rule gives to the template's state is its own"
    assert removal(next(row for row in rows if row.kind == "heading" and row.at), WAIT, "Course") is None
