"""The rule pane on a screen: at every size, cheaply, and with what the clock changes."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from msgspec.structs import replace
from rich.cells import cell_len
from textual.geometry import Region

from rise_engine.kernel.records import KeptRecord, MemoryRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Rule, State, Transition
from rise_tui.model.store import Store
from rise_tui.panes.rule import RulePane
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo
from tests.tui.model.test_state_graph import forty


def pane(it: Console) -> RulePane:
    found = it.pane("rule")
    assert isinstance(found, RulePane)
    return found


def in_view(it: Console) -> list[str]:
    graph = pane(it).graph
    top = graph.scroll_offset.y
    return graph.text.splitlines()[top : top + graph.size.height]


class Painted:
    """Which rows of the graph are painted anew."""

    def __init__(self, it: Console, monkeypatch: pytest.MonkeyPatch) -> None:
        self.rows: list[int] = []
        self.whole = 0
        graph = pane(it).graph
        line, refresh = graph.refresh_line, graph.refresh

        def one(y: int) -> None:
            self.rows.append(y)
            line(y)

        def all_of_it(*regions: Region, **options: bool) -> object:
            self.whole += not regions
            return refresh(*regions, **options)

        monkeypatch.setattr(graph, "refresh_line", one)
        monkeypatch.setattr(graph, "refresh", all_of_it)


@pytest.mark.slow
async def test_it_fits_at_every_size_and_a_move_repaints_only_the_rows_whose_marks_change(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client = FakeClient(replace(demo(), rules={"Forty": forty()}))
    async with console(client=client, size=(124, 40)) as it:
        await it.focus("rule")
        await it.press("f4")
        for width, height in product((40, 60, 80, 120), (8, 24)):
            pane(it).styles.width, pane(it).styles.height = width, height
            await it.until(lambda size=(width, height): pane(it).size == size)  # type: ignore[misc]
            for state, before, index in (("t5c", "t5b", 0), ("start", "t9c", 1), ("over", "goodbye", 0)):
                client.rule("Forty", "entered", state, previous=before, trigger="/x", transition=index)
                await it.until(lambda state=state: f"in {state}" in it.text("rule"), state)  # type: ignore[misc]
                await it.until(
                    lambda state=state: any(f"● {state}  here" in row for row in in_view(it)),  # type: ignore[misc]
                    f"{state} is not in view",
                )
                assert not [row for row in it.text("rule").splitlines() if cell_len(row) > width]
                assert pane(it).graph.size.height >= 2 and pane(it).row_list.size.height >= 2
                assert pane(it).graph.region.bottom <= pane(it).region.bottom
        pane(it).styles.width, pane(it).styles.height = 68, 24
        client.rule("Forty", "entered", "t2a", previous="start", trigger="/to_2", transition=2)
        await it.until(lambda: "● t2a" in it.text("rule"))
        client.rule("Forty", "entered", "t2b", previous="t2a", trigger="/next", transition=0)
        await it.until(lambda: "● t2b" in it.text("rule"))
        painted, top = Painted(it, monkeypatch), pane(it).graph.scroll_offset.y
        lines = pane(it).graph.text.splitlines()
        client.rule("Forty", "entered", "t2a", previous="t2b", trigger="/repeat", transition=1)
        await it.until(lambda: "● t2a" in it.text("rule"))
        after = pane(it).graph.text.splitlines()
        changed = {at for at, (one, other) in enumerate(zip(lines, after, strict=True)) if one != other}
        assert pane(it).graph.scroll_offset.y == top, "it scrolled without need"
        assert changed <= set(painted.rows) and painted.whole == 0
        assert len(set(painted.rows)) <= len(changed) + 8, "rails of the old and the new way, and nothing else"
        painted.rows.clear()
        client.emit(MemoryRecord(0, 0.0, "", "task", 3, 2, "wizard:anna"))
        client.act("Greet")
        await it.pilot.pause(0.3)
        assert not painted.rows and not painted.whole
        top = pane(it).graph.scroll_offset.y
        pane(it).graph.focus()
        await it.press("pageup")
        await it.until(lambda: pane(it).graph.scroll_offset.y < top, "the wizard cannot look at other states")
        client.task("raiseEventTopic", "other", "SUCCEEDED")
        await it.pilot.pause(0.2)
        assert pane(it).graph.scroll_offset.y < top, "looking elsewhere was undone without need"


@pytest.mark.slow
async def test_marks_are_words_and_glyphs_keys_are_named_and_the_time_left_counts_down_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with console() as it:
        made: list[int] = []
        with monkeypatch.context() as counted:
            counted.setattr(RulePane, "repaint", lambda self: made.append(1))
            await it.pilot.pause(2.3)
        assert not made, "nothing is painted when nothing counts"
        label = next(one.label for one in demo().keys.values() if one.behavior == "Main")
        await it.until(lambda: f"you: {label} starts it" in it.text("rule"))
        it.client.rule("Main", "entered", "greeting", trigger="start")
        await it.until(lambda: "in greeting" in it.text("rule"))
        await it.focus("rule")
        await it.press("enter")
        await it.until(lambda: "Greet raises this event itself when it ends" in it.notice)
        assert it.client.asked() == []
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "● waiting  here" in it.text("rule"))
        text = it.text("rule")
        assert "◎ greeting  maybe next  start" in text and "◎ over  maybe next  end" in text
        assert "↓ Greet_end  last step" in text
        await it.until(lambda: "10:00 left" in it.text("rule"))
        it.client.time += 555
        await it.until(lambda: "45 s left" in it.text("rule"))
        it.client.rule("Main", "stopped", None, trigger="wizard:anna", reason="stopped by wizard:anna")
        await it.until(lambda: "here" not in it.text("rule"))
        assert "stopped by wizard:anna" in it.text("rule") and "maybe next" not in it.text("rule")
        await it.until(lambda: "starts it" in it.text("rule"))
        it.client.stop("latched")
        await it.until(lambda: "starts it" not in it.text("rule"), "nothing starts before the release")
        it.client.stop("released")
        await it.until(lambda: "starts it" in it.text("rule"))
        it.client.end_in_order("ended by wizard:anna")
        await it.until(lambda: "starts it" not in it.text("rule"), "after the end no key starts anything")


async def test_the_reasons_leave_the_graph_where_it_is() -> None:
    """A state with as many ways as most others does not move it; one with more does, and is shown whole."""
    states = {
        "a": State("a", transitions=(Transition("x", target="b"), Transition("y", target="c"))),
        "b": State("b", transitions=(Transition("x", target="a"),)),
        "c": State("c", transitions=tuple(Transition(f"e{n}", target="a") for n in range(6))),
    }
    client = FakeClient(replace(demo(), rules={"R": Rule("R", "a", states)}))
    async with console(client=client) as it:
        it.client.rule("R", "entered", "a", trigger="start")
        await it.until(lambda: "in a" in it.text("rule"))
        await it.pilot.pause()
        y = pane(it).graph.region.y
        it.client.rule("R", "entered", "b", previous="a", trigger="/x", transition=0)
        await it.until(lambda: "in b" in it.text("rule"))
        await it.pilot.pause()
        assert pane(it).graph.region.y == y
        it.client.rule("R", "entered", "c", previous="a", trigger="/y", transition=1)
        await it.until(lambda: pane(it).row_list.size.height == pane(it).row_list.count == 8)


async def test_who_only_watches_is_not_told_that_they_can_do_it() -> None:
    client = FakeClient(demo(), you="observer:bob", role="observer")
    async with console(client=client) as it:
        await it.until(lambda: "starts it" in it.text("rule"))
        assert "key: m starts it" in it.text("rule") and "you:" not in it.text("rule")
        client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "waits for event next" in it.text("rule"))
        assert "waits for event next  key: n" in it.text("rule") and "you:" not in it.text("rule")


def test_before_any_rule_has_run_the_one_with_the_first_key_is_shown() -> None:
    """LabLinking's alphabet begins with *Next*, which nobody starts first."""
    found = load(str(Path(__file__).parents[3] / "scenarios" / "lablinking")).scenario
    assert found is not None
    keys = {"d": found.keys["d"], **found.keys}
    for given, first in ((found, "Table setting"), (replace(found, keys=keys), "Noise starts")):
        client = FakeClient(given)
        store = Store(client.attach_reply(), "anna", client.now)
        pane = RulePane(store)
        assert pane._shown_rule is not None and pane._shown_rule.name == first


async def test_a_rule_that_waits_for_its_own_act_says_so_and_names_no_key() -> None:
    """A key that starts the same act by hand would not help."""
    states = {
        "Say it": State("Say it", (), (), (Transition(ended="Greet", outcomes=("failed", "stopped"), target="Over"),)),
        "Over": State("Over"),
    }
    client = FakeClient(replace(demo(), rules={"Own": Rule("Own", "Say it", states)}))
    async with console(client=client) as it:
        it.client.rule("Own", "entered", "Say it", trigger="start")
        await it.until(lambda: "waits for Greet to fail or to be stopped" in it.text("rule"))
        row = next(row for row in it.text("rule").splitlines() if "waits for Greet" in row)
        assert "you:" not in row and "→ Over" in row
        assert "Greet failed or stopped" in it.text("rule"), "the drawing names the way"


async def test_a_key_whose_event_is_kept() -> None:
    scenario = demo()
    keys = {**scenario.keys, "n": replace(scenario.keys["n"], keep=2.0)}
    async with console(client=FakeClient(replace(scenario, keys=keys))) as it:
        await it.press("n")
        await it.sent("raiseEventTopic", '{"event": "/next", "keep": "2s"}')
        task = it.client.task("raiseEventTopic", "/next", "PENDING")
        it.client.emit(KeptRecord(0, 0.0, "", task, "/next", "kept", 2.0))
        await it.until(lambda: "kept next  2 s  you: n undoes" in pane(it).row_list.text)
        assert "next is kept for 2 s" in it.notice
        it.client.emit(KeptRecord(0, 0.0, "", task, "/next", "taken-back"))
        it.client.task_record(task, "raiseEventTopic", "/next", "CANCELED")
        await it.until(lambda: "kept" not in pane(it).row_list.text)
        assert "/next is no longer kept" in it.notice
