"""What the editor's screens show and ask, as plain values. No Textual in here."""
