"""Tools for authors of studies: editing, drawing, trying, exploring, and the language server."""
