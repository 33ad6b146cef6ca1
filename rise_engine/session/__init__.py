"""A session on disk: its folder, its journal, and what is read from them (docs/reference/sessions.md)."""
