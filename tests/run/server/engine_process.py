"""A served session in a process of its own: `python -m tests.run.server.engine_process FOLDER`.

Prints its socket, goes on until its standard input ends, and prints how late its loop was and how much its memory grew.
"""

from __future__ import annotations

import asyncio
import json
import resource
import sys
from pathlib import Path

from .serving import served


def peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


async def main(folder: Path) -> None:
    async with served(folder) as session:
        lag = session.server.lag
        before, lag.max = peak(), 0.0
        print(session.path, flush=True)
        await asyncio.to_thread(sys.stdin.read)
        view = session.hub.view
        print(json.dumps({"late": lag.max, "grown": peak() - before, "records": view.seq, "tasks": len(view.tasks)}))


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
