"""Rules in the editor: the graph with a cursor, what a state does, and the forms of both."""
