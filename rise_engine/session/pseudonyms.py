"""What can name a participant in a real session: a pseudonym, never a name."""

from __future__ import annotations

import re

_PSEUDONYM = re.compile(r"[A-Za-z0-9]+")


def pseudonym_problem(participant: str) -> str:
    """Why a real session cannot be recorded under this, or empty. Nobody named is right.

    >>> pseudonym_problem("P07")
    ''
    """
    if not participant or _PSEUDONYM.fullmatch(participant):
        return ""
    return (
        f"{participant!r} is no pseudonym: letters without accents and digits only, such as P07. What is recorded, the "
        "folder's name and every export carry it, so in real mode it must not be anybody's name; keep the list of who "
        "is who elsewhere"
    )
