"""Widgets that take data and post messages. None of them uses the app."""
