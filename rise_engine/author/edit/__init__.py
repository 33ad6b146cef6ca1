"""Changes of a study's files: `files + Edit -> files`, as splices of bytes that leave everything else unchanged.

The console's editor, the commands, the language server and programs all change a study through this package.
"""
