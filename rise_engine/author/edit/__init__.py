"""Changing a study's files: `files + Edit -> files`, as splices of bytes, and nothing else in them changes.

The console's editor, the commands, the language server and programs all change a study through this package.
"""
