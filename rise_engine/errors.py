"""The base of every error that the packages of rise-tui raise on purpose."""


class RiseError(Exception):
    """What went wrong, in a sentence for the people who run a study; every error of these packages is one of these.

    ``except RiseError`` therefore catches what a caller can tell its users about, and leaves mistakes of the program
    alone.
    """
