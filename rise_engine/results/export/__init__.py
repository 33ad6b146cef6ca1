"""Sessions as files of other programs: tables, BIDS, ELAN, Praat, BORIS, MCAP, XDF. Each format is a module.
`format` lists them, and `writing` makes sure that no file is overwritten and no incomplete export remains."""
