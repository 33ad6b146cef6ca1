"""Explores all situations that a scenario can reach, before the first participant comes."""
