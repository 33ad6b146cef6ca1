"""Rules as SCXML, and SCXML as rules."""
