"""Sessions as files of other programs: tables, BIDS, ELAN, Praat, BORIS, MCAP, XDF. Each format is a module of its own;
`formats` lists them, and `writing` sees to it that nothing is written over and no half of an export is left behind."""
