"""Checks across files, and who uses which name."""
