"""The names of a scenario's files, in a module of their own that is cheap to import."""

from __future__ import annotations

SCENARIO_FILE = "scenario.toml"
STUDY_FILE = "study.toml"
"""For a study with a design: participants, factors, sessions."""
PARTICIPANTS_FILE = "participants.csv"
LEXICON_FILE = "lexicon.toml"
TEXTS_FOLDER = "texts"
"""Contains the translations, one file per language: `texts/de.toml`."""

DEFAULT_PATHS = {"acts": "acts", "rules": "rules", "memory": "memory.json"}
"""The places of acts, rules and memory, unless `scenario.toml` names others."""
