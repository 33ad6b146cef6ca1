"""One session on one terminal: the way of keys in, the rhythm of frames out, and what opens over both."""
