"""`rise-tui`: the command line. `main` reads it; `start` carries it out."""
