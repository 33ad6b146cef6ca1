"""Shared code of all packages: texts, errors, JSON, names and exit statuses."""
