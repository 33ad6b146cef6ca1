"""What the columns of a BIDS export mean: the sidecars of its tables (BIDS 1.11.1, "Tabular files").

https://bids-specification.readthedocs.io/en/v1.11.1/
"""

from __future__ import annotations

from typing import Any

Description = dict[str, Any]

CONFIRMED = "The robot's own confirmation; the first sound or movement comes later."

TRIAL_TYPES: dict[str, str] = {
    "robot_act": "An act of the robot, or free speech, from the robot's confirmation of its first action to its end.",
    "robot_action": "One action of an act, from the robot's confirmation to its end.",
    "cue": "The participant's turn ended; it lasts until the robot began to answer, or until it was taken back.",
    "rule_state": "A rule of the scenario was in a state.",
    "event": "An event that rules can react to.",
    "memory": "A value of the scenario's memory changed.",
    "note": "A remark for the record.",
    "mistake": "A wizard said that something was a mistake.",
    "stop": "The robot was stopped, or released.",
    "sync": "A mark that recordings show.",
    "control": "Among several consoles, who may act changed.",
    "robot": "The link to the robot changed.",
    "fault": "Something went wrong.",
    "check": "Something was looked at before or after the session.",
    "recovery": "Another engine went on with the session; outage_s says for how long it had none.",
}
"""What the rows of `_events.tsv` are."""

EVENT_COLUMNS: dict[str, Description] = {
    "onset": {
        "LongName": "Onset",
        "Description": "Seconds since the session began, on a monotonic clock. Of robot_act and robot_action: "
        f"when the robot confirmed it. {CONFIRMED} An act that the robot never confirmed has the time of its turn.",
        "Units": "s",
    },
    "duration": {
        "LongName": "Duration",
        "Description": "Seconds; 0 for what happens at one moment, n/a for what had not ended with the record.",
        "Units": "s",
    },
    "trial_type": {"LongName": "What it is", "Description": "The kind of the row.", "Levels": TRIAL_TYPES},
    "response_time": {
        "LongName": "Response time",
        "Description": "Only of a robot_act that answered a cue and was asked for after it: seconds from the cue to "
        "the confirmation of the first action that takes the robot's voice, or of its first action where it does not "
        "speak.",
        "Units": "s",
    },
    "actor": {
        "LongName": "Who",
        "Description": "Who did it: wizard:NAME, rule:NAME, a program; of a robot_act, whose key, event or rule caused "
        "it, through any number of rules; of a robot_action: robot.",
    },
    "name": {
        "LongName": "Name",
        "Description": "The act, the type of the action, RULE.STATE, the event's topic, the memory key, the check.",
    },
    "value": {"LongName": "Value", "Description": "What was said or written, as the export's level tells it."},
    "channel": {
        "LongName": "Channel",
        "Description": "Of a robot_action: what of the robot it takes (speech, gaze, face, body, arms), joined by +.",
    },
    "status": {"LongName": "Status", "Description": "How an act or an action ended; `filler` follows after a blank."},
    "task_id": {"LongName": "Task", "Description": "Number of the task in the session's record that it belongs to."},
    "mark": {
        "LongName": "Mark",
        "Description": "What a wizard said was wrong about the act.",
        "Levels": {
            "wrong": "It was the wrong act.",
            "late": "It came too late.",
            "early": "It came too early.",
            "double": "It was started twice.",
        },
    },
    "outage_s": {
        "LongName": "Without engine",
        "Description": "Seconds by the wall clock within the duration, or before a recovery, for which the session "
        "had no engine. Its time stood still: the duration does not count them.",
        "Units": "s",
    },
    "condition": {"LongName": "Condition", "Description": "Of the session: the levels of its factors, joined by +."},
}
"""Of `_events.tsv`."""

_SECONDS: dict[str, str] = {
    "cue_at": "When the participant's turn ended that the act answers or bridges.",
    "key_at": "When the key was pressed that caused it.",
    "accepted_at": "When the program took the task.",
    "started_at": "When its turn came.",
    "robot_at": f"When the robot confirmed its first action. {CONFIRMED}",
    "voice_at": f"When the robot confirmed its first action that takes the voice. {CONFIRMED}",
    "ended_at": "When it had ended.",
    "wizard_s": "Cue to key: the wizard.",
    "way_s": "Key to the program; from the cue, where no key was pressed.",
    "queue_s": "In the queue.",
    "robot_s": "From its turn until the robot confirms.",
    "voice_s": "From the first confirmed action to the first that takes the voice.",
    "response_time": "Cue to answer, of an act that answered one: the sum of the parts before it.",
}

ACT_COLUMNS: dict[str, Description] = {
    "task_id": EVENT_COLUMNS["task_id"],
    "act": {"LongName": "Act", "Description": "The act; `say` for free speech."},
    "actor": {
        "LongName": "Who",
        "Description": "Whose doing it is: the wizard, the program or the rule by itself that caused it.",
    },
    "actor_kind": {
        "LongName": "Kind of actor",
        "Description": "Whose doing it is, in one word.",
        "Levels": {
            "wizard": "A person at a console.",
            "rule": "A rule of the scenario by itself.",
            "program": "A node, a client or a command line.",
            "engine": "The program itself.",
        },
    },
    "via": {"LongName": "Rules between", "Description": "The rules between actor and act, joined by ` > `."},
    "status": {
        "LongName": "Ending",
        "Description": "How it ended.",
        "Levels": {
            "SUCCEEDED": "As it was meant to.",
            "ABORTED": "It failed.",
            "CANCELED": "It was stopped.",
            "REJECTED": "It was never begun.",
            "ACTIVE": "It ran when the record ended.",
            "PENDING": "It waited when the record ended.",
        },
    },
    "filler": {
        "LongName": "Filler",
        "Description": "Whether it bridged the time of a cue; then it is no answer to it.",
        "Levels": {"true": "It was one.", "false": "It was none."},
    },
    "before_cue": {
        "LongName": "Asked for before the cue",
        "Description": "Whether it waited already when the cue came that it answered; then nobody reacted to the cue.",
        "Levels": {"true": "It did.", "false": "It did not."},
    },
    **{name: {"LongName": name, "Description": text, "Units": "s"} for name, text in _SECONDS.items()},
    "mark": EVENT_COLUMNS["mark"],
    "condition": EVENT_COLUMNS["condition"],
}
"""Of `_beh.tsv`: a row for each act, in the order in which they were asked for."""

SESSION_COLUMNS: dict[str, Description] = {
    "filename": {"LongName": "File", "Description": "The table of events of the session, in the participant's folder."},
    "acq_time": {
        "LongName": "Begin",
        "Description": "When the session began, in the time of the place where it ran.",
    },
    "session": {"LongName": "Session", "Description": "What rise-tui calls it."},
    "condition": EVENT_COLUMNS["condition"],
    "run": {"LongName": "Run", "Description": "Which of the participant's runs it is, from 1."},
    "attempt": {"LongName": "Attempt", "Description": "The how-manieth session of that run, from 1."},
    "purpose": {
        "LongName": "Purpose",
        "Description": "Why it was run.",
        "Levels": {
            "counted": "It is a session of the study.",
            "pilot": "It was to try the study, and does not count.",
            "training": "The wizard practised, and it does not count.",
            "debug": "The robot was simulated, and it does not count.",
        },
    },
    "mode": {
        "LongName": "Mode",
        "Description": "Whether there was a robot.",
        "Levels": {"real": "There was one.", "debug": "It was simulated: this is no data of a participant."},
    },
    "outcome": {
        "LongName": "Outcome",
        "Description": "How it counts.",
        "Levels": {
            "complete": "The run counts.",
            "aborted": "It was broken off.",
            "excluded": "The participant does not count.",
        },
    },
    "robot": {"LongName": "Robot", "Description": "The robot's profile."},
    "scenario_hash": {"LongName": "Scenario", "Description": "SHA-256 of everything that the scenario says."},
    "session_duration": {"LongName": "Duration", "Description": "Until the last record.", "Units": "s"},
    "downtime": {
        "LongName": "Downtime",
        "Description": "By the wall clock, between parts of a recovered session; onsets do not count it.",
        "Units": "s",
    },
}
"""Of `_scans.tsv`: a row for each session of a participant. Factors come after `condition`."""


def factor_column(name: str, levels: dict[str, str]) -> Description:
    """The description of a factor's column. `levels`: what each does."""
    description: Description = {"LongName": name, "Description": f"The level of the factor {name}."}
    return {**description, "Levels": levels} if levels else description
