"""The events of one or several sessions in the form needed for analysis: acts with their latencies, cues, phases,
marks and recordings."""
