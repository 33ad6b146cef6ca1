"""What the program itself can look at before a session (`auto` of a `[[check]]` in study.toml)."""

from __future__ import annotations

AUTOMATIC: dict[str, str] = {
    "robot": "the robot answers and offers every action that the scenario uses",
    "disk": "there is room for the session",
    "clock": "this computer's clock is right",
    "sound": "the robot says a word, and somebody hears it",
    "consent": "the participant has consented",
    "participant": "the participant may take part now",
    "scenario": "the scenario is the one that the plan was made with",
    "wizard": "the wizard has given a name",
    "recorder": "everything that records the session records, and its files grow",
    "replay": "the last session replays identically",
    "explored": "what can happen in this condition and language was looked at, and nothing gets stuck or fails",
}
"""Each automatic check and what it looks at, in words that stand on screens and in records."""
OF_THE_PARTICIPANT = frozenset({"consent", "participant"})
"""Those about one participant: that they passed for another one says nothing (so `every` is not for them), and nobody
can skip them in a session that counts."""
