"""The robot before a session: whether it answers, offers what is needed, and is heard."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.checks.devices import (
    ANSWER_SECONDS,
    WORD_SECONDS,
    check_robot,
    check_sound,
    word_for,
)
from rise_engine.checks.outcome import Finding
from rise_engine.ports.bridge import ProfileFinding
from rise_engine.run.engine.drivers import narrow_profile, needed_actions, robot_warnings
from rise_engine.scenario.loader import load
from tests.checks.robots import ACTIONS, Lamp, scenario


def use(monkeypatch: pytest.MonkeyPatch, **behaviour: object) -> type[Lamp]:
    kind = type("LampOfTest", (Lamp,), behaviour)
    monkeypatch.setattr("rise_engine.run.engine.drivers.find_driver", lambda name: kind)
    monkeypatch.setattr("rise_engine.run.engine.drivers.driver_names", lambda: {"lamp"})
    return kind


async def test_one_that_answers_has_passed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = use(monkeypatch)
    assert await check_robot(scenario(tmp_path)) == Finding(True, "Lamp on a wire: 2 actions offered")
    assert kind.made.closed and not hasattr(kind.made, "said")


async def test_what_nothing_stops_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch)
    said = [ProfileFinding("cannot be stopped", "actions.Speech.carrier.topic", "unstoppable")]
    monkeypatch.setattr("rise_engine.checks.devices.profile_findings", lambda profile: said)
    found = await check_robot(scenario(tmp_path))
    assert found == Finding(True, "Lamp on a wire: 2 actions offered; F9 cannot stop Speech")
    said.append(ProfileFinding("no such field", "actions.Speech.carrier.message.x"))
    assert await check_robot(scenario(tmp_path / "two")) == Finding(False, reason="no such field")


@pytest.mark.parametrize(
    ("mode", "driver", "said"),
    [
        ("debug", "lamp", []),
        ("real", "lamp", ["F9 cannot stop Speech: keep a hand on the robot's own switch"]),
        ("real", "simulated", ["the mode is real, but the robot profile 'lamp' has only the simulated driver: "]),
    ],
)
def test_what_people_know_of_the_robot_before_a_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: Any, driver: str, said: list[str]
) -> None:
    use(monkeypatch)
    found = [ProfileFinding("cannot be stopped", "actions.Speech.carrier.topic", "unstoppable")]
    monkeypatch.setattr("rise_engine.run.engine.drivers.profile_findings", lambda profile: found)
    loaded = load(scenario(tmp_path).scenario, mode=mode).scenario
    assert loaded is not None
    told = robot_warnings(replace(loaded, robot=replace(loaded.robot, driver=driver)))
    assert len(told) == len(said) and all(each.startswith(part) for each, part in zip(told, said, strict=True))


async def test_one_that_is_not_there_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, links=((3.0, "lost", "the lamp is dark"),))
    assert await check_robot(scenario(tmp_path)) == Finding(False, reason="the lamp is dark")
    use(monkeypatch, links=((3.0, "degraded", "one bulb is dark"),))
    assert await check_robot(scenario(tmp_path / "two")) == Finding(False, reason="one bulb is dark")


async def test_what_it_says_last_within_a_moment_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, links=((1.0, "lost", "not yet"), (1.5, "connected", "here"), (2.2, "degraded", "two of them")))
    assert await check_robot(scenario(tmp_path)) == Finding(False, reason="two of them")
    use(monkeypatch, links=((1.0, "lost", "not yet"), (1.5, "connected", "here"), (9.0, "lost", "later")))
    assert (await check_robot(scenario(tmp_path / "two"))).passed


async def test_one_that_never_says_anything_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = use(monkeypatch, links=())
    loop = asyncio.get_running_loop()
    began = loop.time()
    assert await check_robot(scenario(tmp_path)) == Finding(False, reason="Lamp did not answer within 30 s")
    assert ANSWER_SECONDS <= loop.time() - began < ANSWER_SECONDS + 1 and kind.made.closed


async def test_one_whose_link_flickers_is_no_endless_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flickering = tuple((0.5 * n, ("lost", "connected")[n % 2], "flickers") for n in range(1, 200))
    use(monkeypatch, links=flickering)
    loop = asyncio.get_running_loop()
    began = loop.time()
    await check_robot(scenario(tmp_path))
    assert loop.time() - began < ANSWER_SECONDS + 2


async def test_a_driver_that_is_not_there_or_wants_other_options(tmp_path: Path) -> None:
    found = await check_robot(scenario(tmp_path))
    assert not found.passed and found.reason.startswith("the robot driver 'lamp' is not installed: a driver is")
    simulated = scenario(tmp_path / "two", profile='driver = "simulated"\n[options]\nlatency = "soon"\n' + ACTIONS)
    found = await check_robot(replace(simulated, mode="debug"))
    assert found == Finding(False, reason="the robot profile 'lamp': latency must be a number from 0 to 60")


async def test_a_simulated_robot_passes_in_debug_and_says_so(tmp_path: Path) -> None:
    request = replace(scenario(tmp_path), mode="debug")
    assert await check_robot(request) == Finding(True, "simulated Lamp: nothing leaves this machine")
    assert await check_sound(request) == Finding(True, "the robot is simulated: there is nothing to hear")


async def test_a_simulated_robot_fails_when_it_is_to_be_real(tmp_path: Path) -> None:
    request = scenario(tmp_path, profile=f'title = "Lamp"\n{ACTIONS}')
    for look in (check_robot, check_sound):
        found = await look(request)
        assert found == Finding(
            False,
            reason="the robot lamp is only simulated, and the mode is real: no robot would move; name the real one "
            "(`robot` in study.toml or scenario.toml)",
        )


async def test_a_scenario_with_errors_is_told(tmp_path: Path) -> None:
    request = scenario(tmp_path)
    (tmp_path / "scenario" / "acts" / "broken.xml").write_text("<Dialog>")
    found = await check_robot(request)
    assert not found.passed and found.reason.startswith("the scenario has errors: acts/broken.xml:1:")


def test_what_the_scenario_does_not_use_need_not_be_there(tmp_path: Path) -> None:
    folder = tmp_path / "scenario"
    request = scenario(tmp_path, profile=f'driver = "lamp"\n{ACTIONS}[actions.PointAt]\nsubstitute = "LookAt"\n')
    (folder / "acts" / "greet.xml").write_text(
        '<Dialog name="Greet"><PointAt><actionID>1</actionID><pointx>1</pointx><pointy>0</pointy><pointz>1</pointz>'
        "</PointAt></Dialog>"
    )
    loaded = load(request.scenario).scenario
    assert loaded is not None
    needed = needed_actions(loaded)
    assert needed == {"Speech", "LookAt"}  # it points with its gaze, and waiting is the engine's
    narrow = narrow_profile(loaded.robot, needed)
    kept = {name for name, spec in narrow.actions.items() if spec.supported and not spec.engine and not spec.substitute}
    assert kept == needed and narrow.actions["PointAt"].substitute == "LookAt"


async def test_a_word_is_said_and_somebody_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = use(monkeypatch)
    request = scenario(tmp_path, 'language = "de-AT"\n')
    assert await check_sound(request) == Finding(
        True, "the robot said “Hallo”", question="The robot said “Hallo”, and it was heard"
    )
    assert kind.made.said == "Hallo" and kind.made.closed
    assert {name for name, spec in kind.made.profile.actions.items() if spec.supported and not spec.engine} == {
        "Speech"
    }


async def test_a_word_that_fails_is_nobodys_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, ending="failed", reason="no loudspeaker")
    found = await check_sound(scenario(tmp_path))
    assert not found.passed and not found.question
    assert found.reason.startswith("the robot could not say “Hello”: ") and "no loudspeaker" in found.reason


async def test_a_word_that_does_not_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    profile = 'title = "Lamp"\ndriver = "lamp"\n[actions.LookAt]\n[actions.Speech]\nlimit = 600\n'
    kind = use(monkeypatch, ending=None)
    found = await check_sound(scenario(tmp_path, profile=profile))
    assert found.reason == f"the robot did not come to the end of “Hello” within {WORD_SECONDS:g} s"
    assert kind.made.closed


async def test_a_robot_without_a_voice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch)
    request = scenario(tmp_path, profile='driver = "lamp"\n[actions.LookAt]\n')
    (tmp_path / "scenario" / "acts" / "greet.xml").unlink()
    (tmp_path / "scenario" / "acts" / "chat.xml").unlink()
    (tmp_path / "scenario" / "rules" / "rules.xml").unlink()
    assert await check_sound(request) == Finding(False, reason="lamp cannot speak")


def test_the_word_is_of_the_scenarios_language() -> None:
    assert [word_for(language) for language in ("", "en-GB", "ja", "PT-br", "gsw")] == [
        "Hello", "Hello", "こんにちは", "Olá", "Hello",
    ]  # fmt: skip
