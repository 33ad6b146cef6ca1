"""What others implement: `robot` reaches a robot, `bridge` connects a session with a robot middleware."""
