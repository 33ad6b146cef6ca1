"""What the program itself can look at before a session (`auto` of a `[[check]]` in study.toml)."""

from __future__ import annotations

AUTOMATIC: dict[str, str] = {
    "robot": "the robot answers and offers every action that the scenario uses",
    "disk": "there is room for the session (`min` says how much)",
    "clock": "this computer's clock is set by a time server",
    "sound": "the robot says a word, and somebody has heard it",
    "consent": "everything in `[consent] needed` has a date",
    "participant": "the participant is in participants.csv, is not excluded, and has not done this run",
    "scenario": "the scenario is the one that the plan was made with",
    "wizard": "the wizard has given a name",
    "replay": "the last session replays identically",
}
"""Each automatic check and what it finds out."""
