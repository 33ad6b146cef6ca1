"""What happened in a session or a study, on one page: as HTML, as text in a terminal."""
