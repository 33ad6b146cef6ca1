"""The checks of the robot: it answers, offers what the scenario needs, and can be heard."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from msgspec.structs import replace

from rise_engine.base.errors import AdapterError
from rise_engine.base.text import pluralize
from rise_engine.checks.child import ChildRequest
from rise_engine.checks.outcome import Finding
from rise_engine.kernel.inputs import RobotChanged, Submit
from rise_engine.kernel.records import FINAL, AnyRecord, TaskRecord
from rise_engine.kernel.speech import SPEECH, why_not_speak
from rise_engine.ports.robot import Robot, RobotReport
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import RobotOptionsError, driver_name_for, make_robot, open_bridge, profile_findings
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import SIMULATED, RobotProfile, Scenario

ANSWER_SECONDS = 30.0
"""How long to wait for the robot's answer."""
SETTLE_SECONDS = 1.0
"""How long a link must stay unchanged: a second program of the same name may appear, or a part may go again."""
WORD_SECONDS = 40.0
"""How long to wait for the end of the word."""
_WORDS = """
    ar مرحبا  cs Ahoj  da Hej  de Hallo  el Γεια  en Hello  es Hola  fi Hei  fr Bonjour  he שלום  hi नमस्ते  it Ciao
    ja こんにちは  ko 안녕하세요  nb Hei  nl Hallo  pl Cześć  pt Olá  ru Здравствуйте  sv Hej  tr Merhaba  zh 你好
"""
WORDS = dict(zip(_WORDS.split()[::2], _WORDS.split()[1::2], strict=True))
"""The word that the robot says, by the scenario's language."""


async def look_at_robot(request: ChildRequest) -> Finding:
    """Check that the scenario's robot answers and offers every action that the scenario uses, without sending any."""
    try:
        scenario = _load(request)
        needed = needed_actions(scenario)
        profile = narrow_profile(scenario.robot, needed)
        found_in_profile = [] if _is_simulated(scenario) else profile_findings(profile)
        if problems := [each.sentence for each in found_in_profile if each.refuses]:
            return Finding(False, reason="; ".join(problems))
        unstoppable = [each.where.split(".")[1] for each in found_in_profile if each.kind == "unstoppable"]
        changes = _RobotChanges()
        async with _connected_robot(request, scenario, profile) as (robot, _):
            robot.connect(changes.take)
            found = await changes.wait()
    except AdapterError as error:
        return Finding(False, reason=str(error))
    if found is None:
        return Finding(False, reason=f"{profile.title} did not answer within {ANSWER_SECONDS:g} s")
    if found.status != "connected":
        return Finding(False, reason=found.detail or f"{profile.title} is {found.status}")
    what = found.detail or f"{profile.title} is connected"
    if not _is_simulated(scenario):
        what += f": {pluralize(len(needed), 'action')} offered"
    return Finding(True, f"{what}; F9 cannot stop {', '.join(unstoppable)}" if unstoppable else what)


async def say_word(request: ChildRequest) -> Finding:
    """Make the robot say a word, in a session that is not stored; a person says whether it was heard."""
    try:
        scenario = _load(request)
        if why := why_not_speak(scenario):
            return Finding(False, reason=why)
        if _is_simulated(scenario):
            return Finding(True, "the robot is simulated: there is nothing to hear")
        word = word_for(scenario.language)
        # Only the voice is needed: another check reports parts that are not there yet.
        profile = narrow_profile(scenario.robot, frozenset({_sent_as(scenario.robot, SPEECH)}))
        async with _connected_robot(request, scenario, profile) as (robot, clock):
            ended = await _say(replace(scenario, robot=profile), robot, clock, word)
    except AdapterError as error:
        return Finding(False, reason=str(error))
    if ended is None:
        return Finding(False, reason=f"the robot did not come to the end of “{word}” within {WORD_SECONDS:g} s")
    if ended.status != "SUCCEEDED":
        return Finding(False, reason=f"the robot could not say “{word}”: {ended.reason or ended.status}")
    return Finding(True, f"the robot said “{word}”", question=f"The robot said “{word}”, and it was heard")


def word_for(language: str) -> str:
    """Return the word for a scenario's language; the English one if the language is unknown or not set."""
    return WORDS.get(language.lower().partition("-")[0], WORDS["en"])


def needed_actions(scenario: Scenario) -> frozenset[str]:
    """Return the robot's actions that a scenario can use, including free speech of a wizard.

    An action of the engine does not count. An action that the robot replaces by another counts as that other one.
    """
    used = {call.type for act in scenario.acts.values() for action in act.actions for call in action.calls}
    if not why_not_speak(scenario):
        used.add(SPEECH)
    actions = scenario.robot.actions
    sent = {_sent_as(scenario.robot, name) for name in used if name in actions and not actions[name].engine}
    return frozenset(name for name in sent if name in actions and actions[name].supported)


def narrow_profile(profile: RobotProfile, needed: frozenset[str]) -> RobotProfile:
    """Restrict a robot's profile to these actions, so that other missing actions do not matter."""
    actions = {
        name: spec if name in needed or spec.engine or spec.substitute is not None else replace(spec, supported=False)
        for name, spec in profile.actions.items()
    }
    return replace(profile, actions=actions)


def _sent_as(profile: RobotProfile, action: str) -> str:
    spec = profile.actions.get(action)
    return spec.substitute if spec is not None and spec.substitute is not None else action


def _is_simulated(scenario: Scenario) -> bool:
    return driver_name_for(scenario.robot, scenario.mode) == SIMULATED


def _load(request: ChildRequest) -> Scenario:
    loaded = load(request.scenario, robot=request.robot, mode=request.mode)
    if loaded.scenario is None:
        raise AdapterError(f"the scenario has errors: {loaded.errors[0]}")
    robot = loaded.scenario.robot
    if request.mode == "real" and robot.driver == SIMULATED:
        raise AdapterError(
            f"the robot {robot.name} is only simulated, and the mode is real: no robot would move; "
            "name the real one (`robot` in study.toml or scenario.toml)"
        )
    return loaded.scenario


class _RobotChanges:
    """A robot's reports of its link."""

    def __init__(self) -> None:
        self.last: RobotChanged | None = None
        self._changed = asyncio.Event()

    def take(self, report: RobotReport) -> None:
        if isinstance(report, RobotChanged):
            self.last = report
            self._changed.set()

    async def wait(self) -> RobotChanged | None:
        """Wait until the link is stable for a moment, and return its last report; None: there was none."""
        loop = asyncio.get_running_loop()
        until = loop.time() + ANSWER_SECONDS
        while (left := until - loop.time()) > 0:
            self._changed.clear()
            settled = self.last is not None
            try:
                await asyncio.wait_for(self._changed.wait(), SETTLE_SECONDS if settled else left)
            except TimeoutError:
                return self.last
        return self.last


@asynccontextmanager
async def _connected_robot(
    request: ChildRequest, scenario: Scenario, profile: RobotProfile
) -> AsyncIterator[tuple[Robot, RealClock]]:
    """Open the robot as a session would, not connected yet, with its clock. Raises AdapterError."""
    clock = RealClock(asyncio.get_running_loop())
    try:
        bridge = await open_bridge(request.ros, profile, scenario.mode)
    except AdapterError as error:
        raise AdapterError("; ".join(error.lines)) from None
    try:
        robot = make_robot(profile, scenario.mode, clock, seed=0, bridge=bridge)
        try:
            yield robot, clock
        finally:
            robot.close()
    except (AdapterError, RobotOptionsError) as error:
        raise AdapterError(str(error)) from None
    finally:
        if bridge is not None:
            await bridge.close()


async def _say(scenario: Scenario, robot: Robot, clock: RealClock, word: str) -> TaskRecord | None:
    """Say the word, and return the last record of its task; None: it did not end."""
    ended: asyncio.Future[TaskRecord] = asyncio.get_running_loop().create_future()

    def take(record: AnyRecord) -> None:
        if isinstance(record, TaskRecord) and record.function == "say" and record.status in FINAL and not ended.done():
            ended.set_result(record)

    engine = Engine(scenario, robot, clock, seed=0, sinks=(take,))
    engine.start()
    engine.accept(Submit(function="say", behavior=word))
    done, _ = await asyncio.wait({ended}, timeout=WORD_SECONDS)
    engine.end_now("the word was said" if done else "the word did not end")
    return ended.result() if done else None
