"""The settings from the user's own files and the command line: keys, preferences, display, the scenario to start."""
