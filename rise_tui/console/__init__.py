"""One session on one terminal: the path of keys in, the rhythm of frames out, and the dialogs above both."""
