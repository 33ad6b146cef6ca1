"""The console's knowledge, and its consequences: no widget, no terminal, no clock."""
