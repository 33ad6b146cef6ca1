"""A session that runs: the engine, its protocol, its clients, its server, and what records it."""
