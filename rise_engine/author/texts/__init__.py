"""A study's texts as one table for those who write and translate them: CSV, Excel or gettext, and back as edits."""
