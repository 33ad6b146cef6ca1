"""What of a session is about people: private values, export levels, redaction, sessions for others."""
