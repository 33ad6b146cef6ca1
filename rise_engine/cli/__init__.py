"""The command line `rise-engine` (docs/reference/rise-engine.md)."""

from rise_engine.cli.program import main

__all__ = ["main"]
