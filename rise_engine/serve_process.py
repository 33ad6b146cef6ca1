"""A session's process, as `rise_engine.link.spawn` starts it: with its options, and a descriptor for the word back."""

from __future__ import annotations

import sys

import msgspec

from rise_engine.serve import serve, to_starter
from rise_engine.session_options import SessionOptions
from rise_engine.text import meant_all


def main() -> None:
    """`python -m rise_engine.serve_process OPTIONS DESCRIPTOR`."""
    _, options, descriptor = sys.argv
    meant = msgspec.convert(meant_all(msgspec.json.decode(options)), SessionOptions)
    sys.exit(serve(meant, to_starter(int(descriptor))))


if __name__ == "__main__":
    main()
