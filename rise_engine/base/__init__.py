"""What all packages stand on: texts, errors, JSON, names and how a process ends."""
