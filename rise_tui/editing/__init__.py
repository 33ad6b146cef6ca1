"""Changing a study in the terminal: its own screens, on the one engine of edits (`rise_engine.edit`)."""
