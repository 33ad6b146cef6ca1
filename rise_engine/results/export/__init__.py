"""Exports of sessions for other programs: tables, BIDS, ELAN, Praat, BORIS, MCAP, XDF. Each format is a module.
`format` lists them. `writing` makes sure that no file is overwritten and no incomplete export remains."""
