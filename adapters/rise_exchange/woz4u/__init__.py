"""Configurations of WoZ4U as scenario folders (docs/how-to/move-from-woz4u.md)."""
