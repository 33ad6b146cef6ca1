"""Protection of people in a session's data: private values, export levels, redaction, sharing."""
