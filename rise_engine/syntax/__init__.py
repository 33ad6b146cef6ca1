"""Texts of files and what stands where in them: read without loss, changed in places, written in the usual layout.

Nothing here knows what a study is. Places are offsets in characters.
"""
