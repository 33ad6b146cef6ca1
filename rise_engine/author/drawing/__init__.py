"""Rules, acts and keys for people: their wording, the layout in the console, and pictures."""
