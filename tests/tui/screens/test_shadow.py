"""The console of a second wizard, to whom the cues of a recorded session are played (docs/how-to/two-wizards.md)."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from rise_engine.results.analysis.reading import read_session
from rise_engine.run.client.shadow import ShadowClient
from rise_engine.session.shadow import ShadowKey, ShadowMark, ShadowNote, read_shadows
from rise_tui.config.preferences import typed_command
from rise_tui.console.app import ConsoleApp
from tests.results.analysis.cues import ACT, cue_numbers, make_session
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, FakeLauncher, demo


@asynccontextmanager
async def shadow(folder: Path, size: tuple[int, int] = (120, 40), **options: object) -> AsyncIterator[Console]:
    client = ShadowClient(folder, "ben", **options)  # type: ignore[arg-type]
    fake = FakeClient(demo())
    app = ConsoleApp(client, wizard="ben", launcher=FakeLauncher(fake))
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        found = Console(pilot, fake, FakeLauncher(fake))
        await found.until(lambda: "Praise" in found.text("acts"))
        yield found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_session(tmp_path, wizard="anna")


def kept(folder: Path) -> list[ShadowKey]:
    ((found,), _) = read_shadows(folder)
    return [line for line in found.lines if isinstance(line, ShadowKey)]


def started(c: Console) -> list[str]:
    """What the console shows as started."""
    return [task.behavior for task in c.screen.store.view.tasks.values()]


async def play_until(c: Console, at: float) -> None:
    """Wait for a session time; a moment more, for the screen."""
    await c.pilot.pause(max(0.0, at - c.app._session.store.now()))  # type: ignore[union-attr]
    await c.pilot.pause(0.2)


@pytest.mark.slow
async def test_it_cannot_be_taken_for_a_session_and_paused_no_key_is_kept(folder: Path) -> None:
    async with shadow(folder, (80, 24)) as c:
        line, bar = c.bars.status_line, c.bars.shadow_bar
        assert " SHADOW " in line.text
        assert "REC" not in line.text and "DEBUG" not in line.text
        assert bar.has_class("-on")
        for size in ((120, 40), (80, 24)):
            await c.pilot.resize_terminal(*size)
            await c.until(lambda: "PAUSED at 00:00:00   F8 resumes here" in bar.text)
            assert "cue 0 of 5" in bar.text
        await c.press("p")
        assert "paused: F8 resumes it" in c.notice
        await c.press("f8")
        await c.until(lambda: "F8 pauses" in bar.text)
        for action in ("settings", "memory.save"):  # nothing of the first session can be changed
            c.screen.action_do(action)
            assert "shadow of a finished session" in c.screen.store.notice.text  # type: ignore[union-attr]
        await play_until(c, 1.1)
        assert "cue 1 of 5" in bar.text
        assert "recorded, not sent" in bar.text
        assert "cue" in line.text
        await c.press("ctrl+y")  # the twin
        await c.until(lambda: "PAUSED at 00:00:01" in bar.text)
        await c.pilot.pause(30)
        assert "PAUSED at 00:00:01" in bar.text
        await c.press("p")
        assert "paused" in c.notice
    assert kept(folder) == []


@pytest.mark.slow
async def test_keys_are_kept_with_the_care_of_the_console_and_then_what_the_first_wizard_did_is_seen(
    folder: Path,
) -> None:
    async with shadow(folder) as c:
        await c.press("f8")
        await play_until(c, 4.0)
        assert "Praise" not in started(c)
        await c.press("r")
        await c.until(lambda: "kept, and sent nowhere" in c.notice)
        assert "s after the cue" in c.notice and "Repeat" in c.notice
        await c.until(lambda: "Praise" in started(c))
        assert not c.screen.store.sent
        await play_until(c, 10.5)
        await c.press("i")
        assert "again" in c.notice, "an act that needs two presses needs them here"
        await c.pilot.pause(1)
        assert len(kept(folder)) == 1
        await c.press("enter")
        await c.until(lambda: len(kept(folder)) == 2)
        await c.press("ctrl+x", "p")
        assert "SAFE" in c.notice
    first, second = cue_numbers(folder)[:2]
    assert [(key.behavior, key.cue) for key in kept(folder)] == [("Repeat", first), ("Hint", second)]
    assert {key.function for key in kept(folder)} == {ACT}


@pytest.mark.slow
async def test_stop_speech_notes_and_marks_are_kept_too(folder: Path) -> None:
    async with shadow(folder) as c:
        await c.press("f8")
        await play_until(c, 10.5)  # the cue is what anna did last, and no deed that is judged
        await c.press("exclamation_mark")
        await c.press("l")
        await c.press("ctrl+o", *"odd", "enter")
        await c.press("ctrl+t", *"Well", "enter")
        await c.until(lambda: len(kept(folder)) == 1)
        await c.press("f9")
        await c.until(lambda: len(kept(folder)) == 2)
        assert not c.screen.store.stopping
    ((found,), _) = read_shadows(folder)
    assert [(key.function, key.behavior) for key in kept(folder)] == [("say", "Well"), ("stopAll", "")]
    praise = next(each.task for each in read_session(folder).acts if each.act == "Praise")
    marks = [(each.task, each.mark) for each in found.lines if isinstance(each, ShadowMark)]
    assert marks == [(praise, "wrong"), (praise, "late")]
    assert [each.text for each in found.lines if isinstance(each, ShadowNote)] == ["odd"]


async def left(c: Console) -> None:
    await c.press("ctrl+c")
    await c.until(lambda: c.app.screen.has_class("-quit"))
    await c.press("l")
    await c.until(lambda: c.app.exit_message)


@pytest.mark.slow
async def test_who_leaves_is_told_how_to_go_on_and_before_it_began_leaves_nothing(folder: Path) -> None:
    async with shadow(folder) as c:
        await left(c)
        assert c.app.exit_message == "nothing was played, and nothing is kept"
    assert not (folder / "shadow").exists()
    async with shadow(folder) as c:
        await c.press("f8")
        await play_until(c, 12)
        await left(c)
        assert c.app.exit_message.endswith("--recover")
        assert f"/shadow; to continue: {typed_command()} --shadow" in c.app.exit_message
    assert read_shadows(folder)[0][0].resume_at == (10.0, cue_numbers(folder)[1])


@pytest.mark.slow
async def test_at_the_end_it_says_what_to_do_next(folder: Path) -> None:
    async with shadow(folder, (80, 24)) as c:
        await c.press("f8")
        await play_until(c, 51)
        await c.until(lambda: "all cues were shown" in c.bars.shadow_bar.text)
        await c.press("ctrl+c")
        await c.until(lambda: c.app.exit_message)
        assert "Compare: rise-engine agree" in c.app.exit_message
    assert read_shadows(folder)[0][0].complete


async def test_elsewhere_there_is_no_pause() -> None:
    async with console() as c:
        c.screen.action_do("pause")
        await c.until(lambda: "this is not a shadow of a session" in c.notice)
        assert not c.bars.shadow_bar.has_class("-on")
