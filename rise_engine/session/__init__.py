"""A session on disk: its folder, its journal, and their contents (docs/reference/sessions.md)."""
