"""The real behaviour of a simulated robot, one JSON object per line, for tests that compare it with a session's record.

    {"t": 12.5, "wall": 1795460000.1, "event": "begun", "action": "Speech", "goal": "4f1c..."}

`t` is in seconds of `time.monotonic`, which no change of the date affects; `wall` is in seconds since 1970. Events of
an action: arrived, accepted, rejected, begun, cancel-asked, ended (`how`: succeeded, failed, canceled, vanished). Of a
topic: begun (without repetitions), ended with its `reset`. Of the robot: appeared, vanished, inactive, active.
"""

from __future__ import annotations

import json
import time
from typing import TextIO


class RobotLog:
    """Writes the entries, each immediately. Without a file it writes nothing."""

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = file

    def note(self, event: str, action: str = "", goal: str = "", **more: object) -> None:
        if self._file is not None:
            row = {"t": time.monotonic(), "wall": time.time(), "event": event, "action": action, "goal": goal, **more}
            self._file.write(json.dumps(row) + "\n")
            self._file.flush()
