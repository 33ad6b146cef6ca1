"""The possible values of columns in tables, with their meanings, as in docs/reference/exports.md."""

STATUS = {
    "PENDING": "still waiting: the record ends before its turn",
    "ACTIVE": "still running: the record ends before it does",
    "SUCCEEDED": "completed",
    "ABORTED": "failed",
    "CANCELED": "stopped, interrupted, or taken out of the queue",
    "REJECTED": "refused at once, with a reason",
}
ACTION_STATUS = {
    "started": "sent to the robot; the record ends before the confirmation",
    "accepted": "confirmed by the robot; the record ends before the action",
    "succeeded": "completed",
    "failed": "the robot could not do it",
    "canceled": "stopped before it was complete",
    "timed-out": "the robot reported no end in time",
    "lost": "nobody knows what became of it",
    "skipped": "never begun",
}
ACTORS = {
    "wizard": "a person at a console",
    "rule": "an interaction rule by itself, for example after a time",
    "program": "a node, a client, the command line",
    "engine": "the engine by itself, for example a filler",
}
EVENT_ACTORS = {
    **ACTORS,
    "rule": "an interaction rule; an act: by itself; anything else: perhaps because of a person's key",
    "program": "a node, a client, the command line, a file of the study",
}
MARKS = {
    "wrong": "it was the wrong one",
    "late": "it came too late",
    "early": "it came too early",
    "double": "it was requested twice",
}
OUTCOMES = {
    "complete": "the run counts",
    "aborted": "it was broken off",
    "excluded": "the participant does not count",
}
PURPOSES = {
    "counted": "data of the study",
    "pilot": "a trial run with a person; does not count",
    "training": "of a wizard; does not count",
    "debug": "with a simulated robot; does not count",
}
MODES = {
    "real": "a robot was meant; `driver` says whether there was one",
    "debug": "the robot was simulated: not a participant's data",
}
CUE_STATES = {
    "answered": "an act answered it",
    "unheard": "an act began to answer it, and ended before the robot confirmed the answer",
    "undone": "it was taken back",
    "open": "nothing answered it",
}
TRIAL_ENDS = {
    "trial": "the next one began",
    "rule": "the rule whose state began it ended",
    "key": "the memory key that began it was deleted or became null",
    "record": "the record ended",
}
PHASE_ENDS = {
    "ended": "the rule ended by itself",
    "stopped": "the rule was stopped",
    "faulted": "a fault stopped the rule",
}
INTERRUPTIONS = {
    "outage": "the session had no engine for a while, or its computer was suspended",
    "standstill": "the engine stood still or could record nothing for a while: what happened then is recorded late",
    "stop": "everything was stopped for a while",
}
CHECK_RESULTS = {
    "passed": "as it should be",
    "failed": "not as it should be",
    "skipped": "not done, with a reason",
}
RECORDING_STATES = {
    "started": "asked to record",
    "running": "it records",
    "stalled": "the recorder reports that it records, but its file does not grow",
    "stopped": "ended as it should",
    "failed": "it did not record, or not until the end",
}
MEDIA_KINDS = {
    "video": "video, perhaps with sound",
    "audio": "sound",
    "bag": "a bag of ROS 2",
    "streams": "streams of LSL",
    "other": "something else",
}
ALIGNMENTS = {
    "marks": "by marks in the recording",
    "given": "somebody entered it",
    "start": "by the start of its recorder, which is not the time of the first frame",
}
EVENT_KINDS = {
    "act": "an act from its turn to its end; name: the act; value: how it ended",
    "phase": "a rule in a state; name: the rule; value: the state",
    "cue": "the participant's turn ended; value: what the wizard said about it",
    "note": "a note; value: its text",
    "mistake": "a wizard marked an act as a mistake; name: the mark; value: the act",
    "stop": "stop-all; name: requested, latched, let-go or released",
    "sync": "a mark for recordings; name: its number; value: sound or flash",
    "event": "an event; name: its topic; value: the rule that took it",
    "memory": "a memory value was set; name: the key; value: the new value",
    "control": "control changed; name: what happened; value: who has control now",
    "robot": "the link to the robot; name: its state",
    "fault": "an act, a rule or an expression failed; name: which; value: why",
    "check": "a check; name: its id; value: the result",
    "scenario": "the session went on with changed files of its scenario; value: what changed",
    "recovery": "another engine continued the session; outage_s: how long there was none",
}
