"""A running session as others reach it: its socket, who is attached, and its process."""
