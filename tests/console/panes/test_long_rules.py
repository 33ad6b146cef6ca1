"""A rule of forty states: the present one and the reasons stay in view; the wizard may look elsewhere."""

from __future__ import annotations

from msgspec.structs import replace

from rise_engine.scenario.model import Rule, Scenario, State, Transition
from tests.console.conftest import console
from tests.console.fake import FakeClient, demo


def long() -> Scenario:
    states = {f"s{n}": State(f"s{n}", (), (), (Transition(f"e{n}", target=f"s{(n + 1) % 40}"),)) for n in range(40)}
    return replace(demo(), rules={"Long": Rule("Long", "s0", states)})


async def test_the_present_state_comes_into_view_and_the_reason_stays() -> None:
    async with console(client=FakeClient(long()), size=(80, 24)) as it:
        pane = it.pane("rule")
        graph = pane.graph  # type: ignore[attr-defined]

        def in_view() -> str:
            top = graph.scroll_offset.y
            return "\n".join(graph.text.splitlines()[top : top + graph.size.height])

        for n in (30, 3, 39):
            it.client.rule("Long", "entered", f"s{n}", previous=f"s{n - 1}", trigger=f"/e{n - 1}", transition=0)
            await it.until(lambda n=n: f"● s{n}  here" in in_view(), f"s{n} is not in view")  # type: ignore[misc]
            assert f"waits for event e{n}" in it.text("rule")
        it.screen.pane_layout.focus_pane("rule")
        before = graph.scroll_offset.y
        await it.press("pageup")
        await it.until(lambda: graph.scroll_offset.y < before, "the wizard cannot look at other states")
        it.client.task("raiseEventTopic", "other", "SUCCEEDED")
        await it.pilot.pause(0.2)
        assert graph.scroll_offset.y < before, "looking elsewhere was undone without need"


async def test_what_the_robot_does_stands_above_the_acts() -> None:
    async with console(size=(80, 24)) as it:
        it.client.act("Greet")
        await it.until(lambda: "► Greet" in it.pane("acts").title.text)
