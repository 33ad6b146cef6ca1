"""A study: its design, its plan, who takes part, and what became of every session (docs/reference/study.md)."""
