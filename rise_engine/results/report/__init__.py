"""The report of a session or a study on one page: as HTML, or as text in a terminal."""
