"""The texts of files and the places in them: read without loss, edited, and written in the usual layout.

Nothing here knows what a study is. Places are offsets in characters.
"""
