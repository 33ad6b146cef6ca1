"""What happened in a session, as whoever analyses it needs it: acts with their latencies, cues, phases, marks, and what
recorded it; over one session, or over those of a study."""
