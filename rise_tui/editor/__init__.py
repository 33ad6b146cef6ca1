"""The editor of a study's files in the terminal: a frame (`screen`), and a page for each thing that is changed."""
