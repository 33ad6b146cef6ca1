"""Scenario folders: text files in, one checked and immutable `Scenario` out, or findings with file, line and column.

`rise_engine.scenario.loader.load` is the door. This module imports nothing, so that whoever needs the model alone gets
no reader of XML.
"""
