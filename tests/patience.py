"""How long a test waits for what has to happen."""

PATIENCE = 120.0
"""Seconds in which any machine that works at all gets there, however busy it is. Nothing is measured by it, and a test that
passes never waits for so long: who asserts that something is quick writes a benchmark."""
