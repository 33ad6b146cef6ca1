"""The link between a session and its clients (other languages: docs/reference/link.md)."""
