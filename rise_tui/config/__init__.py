"""What the user's own files and the command line settle: keys, preferences, display, which scenario is started."""
