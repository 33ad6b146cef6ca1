"""A study: its design, its plan, its participants, and the results of its sessions (docs/reference/study.md)."""
