"""The possible values of columns in tables, with their meanings, as in docs/reference/exports.md."""

STATUS = {
    "PENDING": "it still waits: the record ends before its turn",
    "ACTIVE": "it still runs: the record ends before it does",
    "SUCCEEDED": "done to its end",
    "ABORTED": "failed",
    "CANCELED": "stopped, interrupted, or taken out of the queue",
    "REJECTED": "refused at once, with a reason",
}
ACTION_STATUS = {
    "started": "sent to the robot; the record ends before it confirms",
    "accepted": "confirmed by the robot; the record ends before it does",
    "succeeded": "done to its end",
    "failed": "the robot could not do it",
    "canceled": "stopped before its end",
    "timed-out": "the robot reported no end in time",
    "lost": "it is not known what became of it",
    "skipped": "never begun",
}
ACTORS = {
    "wizard": "a person at a console",
    "rule": "an interaction rule by itself, as after a time",
    "program": "a node, a client, the command line",
    "engine": "the engine by itself, as for fillers that it starts",
}
MARKS = {
    "wrong": "it was the wrong one",
    "late": "it came too late",
    "early": "it came too early",
    "double": "it was asked for twice",
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
    "real": "for a robot; driver in sessions.csv says whether there was one",
    "debug": "the robot was simulated: no data of a participant",
}
CUE_STATES = {
    "answered": "an act answered it",
    "undone": "it was taken back",
    "open": "nothing answered it",
}
TRIAL_ENDS = {
    "trial": "the next one began",
    "rule": "the rule ended, whose state had begun it",
    "key": "the memory key that had begun it is gone or null",
    "record": "the record ended",
}
PHASE_ENDS = {
    "ended": "the rule came to its end in it",
    "stopped": "the rule was stopped in it",
    "faulted": "the rule was stopped for a fault in it",
}
CHECK_RESULTS = {
    "passed": "as it should be",
    "failed": "not as it should be",
    "skipped": "not looked at, with a reason",
}
RECORDING_STATES = {
    "started": "told to record",
    "running": "it records",
    "stalled": "it says that it records, and its file did not grow",
    "stopped": "ended as it should",
    "failed": "it did not record, or not to its end",
}
MEDIA_KINDS = {
    "video": "video, perhaps with sound",
    "audio": "sound",
    "bag": "a bag of ROS 2",
    "streams": "streams of LSL",
    "other": "something else",
}
ALIGNMENTS = {
    "marks": "by marks that were found in it",
    "given": "somebody said it",
    "start": "by when its recorder was started; that is not the time of the first frame",
}
EVENT_KINDS = {
    "act": "an act, from when its turn came to its end; name: the act; value: how it ended",
    "phase": "a rule in a state; name: the rule; value: the state",
    "cue": "the participant's turn ended; value: what the wizard said of it",
    "note": "a note; value: its text",
    "mistake": "a wizard's mark at an act; name: the mark; value: the act",
    "stop": "stop-all; name: requested, latched, let-go or released",
    "sync": "a mark for recordings; name: its number; value: sound or flash",
    "event": "an event; name: its topic; value: the rule that took it",
    "memory": "a memory value was set; name: the key; value: what it is now",
    "control": "who may act; name: what happened; value: who has control now",
    "robot": "the link to the robot; name: its state",
    "fault": "an act, a rule or an expression failed; name: which; value: why",
    "check": "something was looked at; name: which check; value: the result",
    "recovery": "another engine went on with the session; outage_s: for how long it had none",
}
