"""The screens: they hold the panes, wire them to the session, and know the layout."""
