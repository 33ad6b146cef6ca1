"""Interfaces for adapters: `robot` controls a robot, `bridge` connects a session to a robot middleware."""
