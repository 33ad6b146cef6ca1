"""Widgets that take data and post messages. None of them knows the app."""
