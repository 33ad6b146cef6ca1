"""The texts of files and their places: reads them without loss, edits them, and writes the usual layout.

It does not depend on studies. Places are offsets in characters.
"""
