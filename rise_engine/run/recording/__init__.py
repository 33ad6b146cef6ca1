"""Recorders of a session: cameras, microphones, bags, streams; they start, run and stop with it."""
