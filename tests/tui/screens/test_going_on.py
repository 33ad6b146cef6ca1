"""A wizard goes on after a stop in the middle of a study: the console with the kernel that an engine has behind it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from copy import copy
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.run.protocol.client import ClientInput, Reply
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_tui.screens.dialog import ReleaseDialog
from tests.kernel.harness import Session
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient

pytestmark = pytest.mark.slow  # many keys each

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"


class KernelClient(FakeClient):
    """Whatever is sent goes to a kernel, whose records come back; the test plays the robot."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.session = Session(scenario)
        self._shown = len(self.session.records)

    async def send(self, message: ClientInput) -> Reply:
        if isinstance(message, Submit):
            self.sent.append(message)
            self.session.do(message)
            self.show()
        return Reply(True)

    def show(self) -> None:
        """Let the console have what has been recorded."""
        new, self._shown = self.session.records[self._shown :], len(self.session.records)
        self.emit(*map(copy, new))

    def speaking(self) -> str:
        """What the robot says now, word for word."""
        goals = self.session.goals.values()
        return next((goal.parameters["message"] for goal in goals if "message" in goal.parameters), "")

    def finish(self) -> None:
        """The robot does what it was asked, to its end."""
        session = self.session
        while session.goals or session.timers:
            if session.goals:
                session.report(next(iter(session.goals)))
            else:
                session.wait(max(session.timers.values()) - session.t)
        self.show()


@asynccontextmanager
async def study(size: tuple[int, int]) -> AsyncIterator[tuple[Console, KernelClient]]:
    scenario = load(LABLINKING).scenario
    assert scenario is not None
    client = KernelClient(scenario)
    async with console(size=size, client=client, ready="Welcome") as it:
        yield it, client


async def test_four_keys_after_the_stop_the_cut_sentence_is_said() -> None:
    async with study((80, 24)) as (it, client):
        session = client.session
        await it.press("t")
        for _ in range(40):
            if session.states.get("Table setting", "").startswith("Task 2, step"):
                break
            client.finish()
            await it.press("n")
            await it.pilot.pause(1)  # beyond the time in which a second press is the same one
        cut = client.speaking()
        assert cut, "the robot speaks in the middle of the second task"
        await it.press("f9")
        await it.sent("stopAll", "")
        for goal in list(session.goals):
            session.report(goal, "canceled")
        session.confirm_stop("all")
        client.show()
        await it.until(lambda: "STOPPED" in it.bars.status_line.text)
        keys = ["ctrl+r", "e", "r"]
        await it.press(keys[0])
        await it.until(lambda: isinstance(it.app.screen, ReleaseDialog))
        await it.press(*keys[1:])
        await it.until(lambda: client.speaking() == cut, "the sentence that was cut is said again")
        assert session.states["Table setting"].startswith("Task 2, step")
        client.finish()
        await it.press("n")
        await it.until(lambda: client.speaking() not in ("", cut), "the study goes on with the next one")
