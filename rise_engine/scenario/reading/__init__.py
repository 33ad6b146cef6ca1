"""Readers of acts, rules, settings, tables, translations and robot profiles."""
