"""The engine of rise-tui: runs sessions, with or without a console (docs/explanation/architecture.md)."""

__version__ = "0.1.0"
