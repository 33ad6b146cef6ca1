"""What is said between a session and those who attach to it: the client's side as a protocol, the messages, and where
the sessions of this computer are found. `docs/reference/link.md` describes it for other languages."""
