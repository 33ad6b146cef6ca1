"""The spoken texts of a scenario: templates, languages and SSML."""
