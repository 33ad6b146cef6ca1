"""The events of sessions in the form for analysis: acts with latencies, cues, phases, marks, recordings."""
