"""The screens: they contain the panes, connect them to the session, and know the layout."""
