"""The process of one browser's console: takes its pty as its terminal, then is `rise-tui` as anybody else starts it."""

from __future__ import annotations

import fcntl
import sys
import termios


def main() -> None:
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # from now on it is told when the terminal changes its size or is hung up
    from rise_tui.cli import main as console

    console(sys.argv[1:], prog_name="rise-tui")


if __name__ == "__main__":
    main()
