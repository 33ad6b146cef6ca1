"""A study's texts as one table for authors and translators (CSV, Excel or gettext), and back as edits."""
