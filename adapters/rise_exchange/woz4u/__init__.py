"""Converts configurations of WoZ4U to scenario folders (docs/how-to/move-from-woz4u.md)."""
