"""How anybody outside takes part in a session: the messages, and where sessions are reached."""
