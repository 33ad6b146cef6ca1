"""A study as one folder for others: an RO-Crate with everything to run it again."""
