"""Scenario folders: text files in; one checked, immutable `Scenario` out, or diagnostics with file, line and column.

Start at `rise_engine.scenario.loader.load`. This module imports nothing, so the model alone needs no XML reader.
"""
