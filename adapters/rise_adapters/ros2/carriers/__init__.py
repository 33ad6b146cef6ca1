"""What the mappings of a profile are made of (moves to `mapping`)."""
