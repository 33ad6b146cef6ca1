"""The files of a scenario: where they are, what may be read and written, and where things stand in them."""
