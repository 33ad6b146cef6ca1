"""OBS: Hello and challenge, recording, its file; and an OBS that is silent, refuses, stalls or goes."""

from __future__ import annotations

import builtins
import sys
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.recorders import obs
from rise_adapters.recorders.obs import ObsRecorder

from rise_engine.ports.recorder import RecorderError, RecordingPlan
from tests.adapters.recorders.obs_server import ObsServer, obs_server

PLAN = RecordingPlan("S1", Path())


def recorder(server: ObsServer, **options: Any) -> ObsRecorder:
    return ObsRecorder("obs", {"url": server.url, **options})


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obs, "FILE_SECONDS", 0.2)


async def test_a_recording_from_its_start_to_its_file(tmp_path: Path) -> None:
    (tmp_path / "password").write_text("tell nobody\n")
    async with obs_server("tell nobody") as server:
        camera = recorder(server, password_file=str(tmp_path / "password"))
        assert await camera.prepare(PLAN) == "OBS 30.2.3, scene Lab"
        assert server.identified["rpcVersion"] == 1 and server.identified["eventSubscriptions"] == 64
        assert await camera.start() == server.path and server.recording
        first, second = await camera.status(), await camera.status()
        assert first.recording and (first.bytes, second.bytes, first.seconds) == (5000, 10000, 1.2)
        assert await camera.stop() == server.path and not server.recording
        await camera.close()


async def test_the_password_is_asked_for_and_proved_and_never_sent(tmp_path: Path) -> None:
    (tmp_path / "wrong").write_text("guessed")
    async with obs_server("tell nobody") as server:
        for options, why in (
            ({}, "OBS asks for its password"),
            ({"password_file": str(tmp_path / "wrong")}, "OBS did not accept the password"),
            ({"password_file": str(tmp_path / "none")}, "the file with the password of OBS cannot be read"),
        ):
            camera = recorder(server, **options)
            with pytest.raises(RecorderError, match=why):
                await camera.prepare(PLAN)
            await camera.close()
        assert "guessed" not in str(server.identified)


async def test_what_somebody_else_records_is_neither_taken_nor_stopped() -> None:
    async with obs_server() as server:
        server.recording = True
        camera = recorder(server)
        await camera.prepare(PLAN)
        with pytest.raises(RecorderError, match="OBS is already recording: stop that first"):
            await camera.start()
        assert await camera.stop() == "" and server.recording and "StopRecord" not in server.requests
        await camera.close()


async def test_a_silent_one_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obs, "ANSWER_SECONDS", 0.3)
    async with obs_server() as server:
        server.mute = {"Hello"}
        camera = recorder(server)
        with pytest.raises(RecorderError, match=r"OBS did not answer within 0.3 s at ws://127.0.0.1"):
            await camera.prepare(PLAN)
        server.mute = {"StartRecord"}
        await camera.prepare(PLAN)
        with pytest.raises(RecorderError, match=r"OBS did not answer within 0.3 s \(StartRecord\)"):
            await camera.start()
        server.recording = True  # it had begun after all: what may be ours is stopped
        assert await camera.stop() == server.path and not server.recording
        await camera.close()


async def test_what_it_refuses_is_said_in_its_words() -> None:
    async with obs_server() as server:
        server.refuse = {"StartRecord": (702, "The output is not configured.")}
        camera = recorder(server)
        await camera.prepare(PLAN)
        with pytest.raises(RecorderError, match=r"OBS refused StartRecord \(code 702\): The output is not configured."):
            await camera.start()
        await camera.close()


async def test_a_cut_connection_is_made_again_and_the_recording_goes_on() -> None:
    async with obs_server() as server:
        camera = recorder(server)
        await camera.prepare(PLAN)
        await camera.start()
        await server.drop()
        assert (await camera.status()).recording
        assert await camera.stop() == server.path
        await camera.close()


async def test_one_that_stands_still_shows_the_same_size() -> None:
    async with obs_server() as server:
        camera = recorder(server)
        await camera.prepare(PLAN)
        await camera.start()
        await camera.status()
        server.grows = False
        assert (await camera.status()).bytes == (await camera.status()).bytes == 5000
        server.recording = False  # somebody has pressed its button
        assert not (await camera.status()).recording
        with pytest.raises(RecorderError, match="OBS refused StopRecord"):
            await camera.stop()
        await camera.close()


async def test_one_that_is_not_there_and_one_that_is_something_else() -> None:
    async with obs_server() as server:
        gone = server.url
    camera = ObsRecorder("obs", {"url": gone})
    with pytest.raises(RecorderError, match=r"OBS cannot be reached at ws://127.0.0.1.*is it running"):
        await camera.prepare(PLAN)
    await camera.close()


async def test_without_its_package_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name == "aiohttp":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.delitem(sys.modules, "aiohttp")
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecorderError, match=r'pip install "rise-tui\[obs\]"'):
        await ObsRecorder("obs", {}).prepare(PLAN)
