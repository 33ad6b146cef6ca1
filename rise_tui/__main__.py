"""`rise-tui`, also as `python -m rise_tui`."""

from __future__ import annotations

import gc


def main() -> None:
    gc.disable()  # until a console is painted: nothing of what starting makes is garbage
    from rise_tui.cli import main

    main(prog_name="rise-tui")


if __name__ == "__main__":
    main()
