"""Studies in the formats of other programs: SCXML, BML, WoZ4U. The engine finds its commands by their entry points."""
