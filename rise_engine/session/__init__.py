"""A session on disk: its folder, its journal, and what can be made of them (docs/reference/sessions.md)."""
