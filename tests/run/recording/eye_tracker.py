"""A stand-in for an eye tracker that streams: `python -m tests.run.recording.eye_tracker SOURCE_ID`.

A stream as that of Pupil Labs Neon (https://docs.pupil-labs.com/neon/data-collection/lab-streaming-layer), of an eye
that rests where it was told to look: each line of standard input is the pixel `x`. It goes on until that ends.
"""

from __future__ import annotations

import os
import select
import sys
import tempfile
from pathlib import Path

from tests.run.recording.lab_recorder import SETTINGS

PERIOD = 0.01
"""Seconds between samples, or more on a busy machine; each has its own time."""


def main(source: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "lsl_api.cfg"
        settings.write_text(SETTINGS)
        os.environ["LSLAPICFG"] = str(settings)
        import pylsl  # it reads the settings when it is loaded

        info = pylsl.StreamInfo("Stand-in_Neon Gaze", "Gaze", 2, pylsl.IRREGULAR_RATE, pylsl.cf_float32, source)
        channels = info.desc().append_child("channels")
        for label in ("x", "y"):
            channels.append_child("channel").append_child_value("label", label)
        outlet = pylsl.StreamOutlet(info)
        print("streaming", flush=True)
        x = float("nan")
        while True:
            if select.select([sys.stdin], [], [], PERIOD)[0]:
                line = sys.stdin.readline()
                if not line:
                    return
                x = float(line)
                print(f"looks at {x:g}", flush=True)
            outlet.push_sample([x, 300.0], pylsl.local_clock())


if __name__ == "__main__":
    main(*sys.argv[1:])
