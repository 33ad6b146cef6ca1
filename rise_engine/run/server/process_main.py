"""The main program of a session's process, started by `spawn` with its options and a descriptor for its report."""

from __future__ import annotations

import sys

import msgspec

from rise_engine.base.text import restore_all_surrogates
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.process import report_to_pipe, serve


def main() -> None:
    """Run `python -m rise_engine.run.server.process_main OPTIONS DESCRIPTOR`."""
    _, options, descriptor = sys.argv
    session = msgspec.convert(restore_all_surrogates(msgspec.json.decode(options)), SessionOptions)
    sys.exit(serve(session, report_to_pipe(int(descriptor))))


if __name__ == "__main__":
    main()
