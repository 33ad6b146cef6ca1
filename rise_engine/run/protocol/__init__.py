"""The link between a session and its clients: interface, messages and registry (other languages:
docs/reference/link.md)."""
