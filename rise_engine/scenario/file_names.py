"""What the files of a scenario are called. Apart, so that looking for one costs nothing."""

from __future__ import annotations

SCENARIO_FILE = "scenario.toml"
STUDY_FILE = "study.toml"
"""Of a study with a design: participants, factors, sessions."""
PARTICIPANTS_FILE = "participants.csv"
LEXICON_FILE = "lexicon.toml"
TEXTS_FOLDER = "texts"
"""With the translations, a file for each language: `texts/de.toml`."""

DEFAULT_PATHS = {"acts": "acts", "rules": "rules", "memory": "memory.json"}
"""Where acts, rules and memory lie, unless `scenario.toml` says otherwise."""
