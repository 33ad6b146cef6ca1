"""The editor's content: rows, fields and sentences from a study's draft. Nothing here has a screen."""
