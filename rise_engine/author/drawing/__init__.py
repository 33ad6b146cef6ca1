"""How people see rules, acts and keys: their wording, the layout that the console shows, and pictures."""
