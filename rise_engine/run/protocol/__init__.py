"""The link between a session and its clients: the client's interface, the messages, and the registry of running
sessions.

`docs/reference/link.md` describes it for other languages.
"""
