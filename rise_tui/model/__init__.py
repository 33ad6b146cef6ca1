"""What the console knows, and everything that follows from it: no widget, no terminal, no clock."""
