"""Studies of other tools as scenario folders (docs/how-to/move-from-woz4u.md)."""
