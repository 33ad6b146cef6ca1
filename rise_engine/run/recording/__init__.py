"""Recorders of a session, such as cameras, microphones and bags. They start, run and stop with it."""
