"""Tutorials, played as their readers play them: what a page says to press and to type is pressed and typed."""
