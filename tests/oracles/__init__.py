"""Golden outputs of a tree, so that two trees can be compared: `tests/oracles/__main__.py`."""
