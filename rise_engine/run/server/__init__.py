"""A running session's server: its socket, its attached clients, and its process."""
