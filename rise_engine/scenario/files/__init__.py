"""The files of a scenario: their places, the permission to read and write them, and positions in them."""
