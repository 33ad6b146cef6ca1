"""`rise-tui`, also as `python -m rise_tui`."""

from __future__ import annotations

from rise_tui.cli.main import main as command


def main() -> None:
    """Run the command line; ends the process."""
    command(prog_name="rise-tui")


if __name__ == "__main__":
    main()
