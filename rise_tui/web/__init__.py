"""`rise-tui --web`: the console in browsers on this machine, for those who only watch."""
