"""What records a session from outside: cameras, microphones, bags, streams; started, watched and stopped with it."""
