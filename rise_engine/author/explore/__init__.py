"""All situations that a scenario can reach, found before the first participant comes."""
