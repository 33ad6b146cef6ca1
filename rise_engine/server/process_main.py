"""A session's process, as `rise_engine.server.spawn` starts it: with its options, and a descriptor for its report."""

from __future__ import annotations

import sys

import msgspec

from rise_engine.protocol.session_options import SessionOptions
from rise_engine.server.process import report_to_pipe, serve
from rise_engine.text import restore_all_surrogates


def main() -> None:
    """`python -m rise_engine.server.process_main OPTIONS DESCRIPTOR`."""
    _, options, descriptor = sys.argv
    session = msgspec.convert(restore_all_surrogates(msgspec.json.decode(options)), SessionOptions)
    sys.exit(serve(session, report_to_pipe(int(descriptor))))


if __name__ == "__main__":
    main()
