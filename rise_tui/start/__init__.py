"""How a console comes up: what the command line asks for, what is kept for this user, what session it opens on."""
