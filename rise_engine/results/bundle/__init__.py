"""A study as one folder for others: an RO-Crate, and what runs it again."""
