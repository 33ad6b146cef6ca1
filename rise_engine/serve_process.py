"""A session's process, as `rise_engine.link.spawn` starts it: with an order, and a descriptor for the one word back."""

from __future__ import annotations

import sys


def main() -> None:
    import msgspec

    from rise_engine.serve import Order, serve, to_starter
    from rise_engine.text import meant_all

    _, order, descriptor = sys.argv
    meant = msgspec.convert(meant_all(msgspec.json.decode(order)), Order)
    sys.exit(serve(meant, to_starter(int(descriptor))))


if __name__ == "__main__":
    main()
