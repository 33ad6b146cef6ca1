"""What the editor shows and asks for: rows, fields and sentences from a study's draft. Nothing of it has a screen."""
