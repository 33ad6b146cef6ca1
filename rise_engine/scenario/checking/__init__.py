"""Checks across files, and the uses of names."""
