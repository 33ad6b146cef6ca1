"""LabRecorder's own code in a process: `python -m tests.run.recording.lab_recorder FILE SOURCE_ID...`.

It goes on until its standard input ends. LabRecorder itself prints `Started data collection` when it does.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

SETTINGS = (
    "[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n[ports]\nIPv6 = disable\n[log]\nlevel = -2\n"
)
"""Where the loopback has no multicast, only one program is found without `KnownPeers`."""
FIND_SECONDS = 60.0


def main(file: str, *sources: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "lsl_api.cfg"
        settings.write_text(SETTINGS)
        os.environ["LSLAPICFG"] = str(settings)
        import labrecorder  # both read the settings when they are loaded
        import pylsl

        streams = []
        for source in sources:
            found = pylsl.resolve_byprop("source_id", source, timeout=FIND_SECONDS)
            assert len(found) == 1, found
            streams += found
        recording = labrecorder.Recording(file, streams)
        sys.stdin.read()
        recording.stop()


if __name__ == "__main__":
    main(*sys.argv[1:])
