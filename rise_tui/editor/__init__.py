"""The editor of a study's files in the terminal: a frame (`screen`), and a page for each kind of content."""
