"""Tools for authors of studies: editing, drawing, trial runs, exploring, and the language server."""
