"""`rise-tui`: the command line. `main` reads it, `start` does what is asked for."""
