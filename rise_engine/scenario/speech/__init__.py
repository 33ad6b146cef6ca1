"""What a scenario says to people: templates of texts, languages and SSML."""
