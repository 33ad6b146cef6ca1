"""How long a test waits for what has to happen."""

PATIENCE = 120.0
"""Seconds in which any machine that works at all gets there, however busy it is. No test that passes waits for so long,
and nothing is measured by it: what has to be quick has a benchmark."""
