"""Commands that write, check and change scenarios."""
