"""Widgets that take data and post messages; none of them knows the app."""
