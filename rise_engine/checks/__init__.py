"""Checks before and after a session of a study: what is looked at, and what came of it (docs/reference/study.md)."""
