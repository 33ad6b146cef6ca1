"""Commands that run and stop sessions."""
