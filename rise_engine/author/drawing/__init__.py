"""How rules, acts and keys are shown to people: their words, the layout that the console shows, and pictures of it."""
