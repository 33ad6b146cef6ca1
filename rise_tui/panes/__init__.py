"""The console's lists and panes. Each reads the store, paints rows, and posts the wizard's requests."""
