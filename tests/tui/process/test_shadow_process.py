"""A second wizard at a real terminal, who is cut off in the middle and goes on."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from rise_engine.session.shadow import ShadowKey, read_shadows, unfinished_shadow
from tests.results.analysis.cues import cue_numbers, make_session
from tests.tui.terminals import terminal

pytestmark = [pytest.mark.slow, pytest.mark.pty]


def keys(folder: Path) -> list[ShadowKey]:
    ((found,), _) = read_shadows(folder)
    return [line for line in found.lines if isinstance(line, ShadowKey)]


def test_killed_in_the_middle_it_is_gone_on_with(tmp_path: Path) -> None:
    folder = make_session(
        tmp_path, [(0.2, "cue", ""), (0.4, "act", "Praise"), (900.0, "cue", ""), (901.0, "act", "Praise")], seconds=910
    )
    with terminal("--shadow", str(folder), "--wizard", "ben", size=(80, 24)) as it:
        it.until_screen("PAUSED at 00:00:00")
        it.press(b"\x1b[19~")  # F8
        it.until_screen("cue 1 of 2")
        it.press(b"r")
        it.until_screen("kept, and sent nowhere")
        os.kill(it.process.pid, signal.SIGKILL)
        it.process.wait()
    assert [(each.behavior, each.cue) for each in keys(folder)] == [("Repeat", cue_numbers(folder)[0])]
    left = unfinished_shadow(folder, "ben")
    assert left is not None and left.resume_at == (keys(folder)[0].t, 0)
    with terminal("--shadow", str(folder), "--wizard", "ben", "--recover", size=(80, 24)) as it:
        it.until_screen("cue 1 of 2")
        it.until_screen("PAUSED at 00:00:0")
        it.press(b"\x03")
        it.until_screen("Leave the shadow?")
        it.press(b"l")
        it.until_screen("--recover")
        assert it.ended() == 0
    assert len(keys(folder)) == 1
