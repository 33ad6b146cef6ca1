"""A running session: the engine, its protocol, its clients, its server, and its recorders."""
