"""The notes on tables and entries of scenario.toml."""

from __future__ import annotations

import pytest

from rise_engine.author.lsp.hover import setting_notes

TEXT = """[explore]
faults = 2 # runs('x')
[always]
"runs well" = "near and not (runs('R_A') or in('R', 'S'))"
[eventually]
it = { then = 'waits("R_A")', unless = "near and (" }
[keys]
end = { event = "runs(" }
"""


@pytest.mark.parametrize(
    ("here", "expected"),
    [
        ("ex|plore]", ["**[explore]**: How much “explore” looks at"]),
        ("[always|]", ["**[always]**: Properties that hold in every situation"]),
        ("fau|lts", ["**faults**: How many things go wrong on one path, 0 to 5 (default: 1)"]),
        ("# ru|ns", []),
        ('"runs| well', []),
        (
            "(ru|ns('R_A'",
            [
                "`runs('Act')`: whether this act runs, at least once",
                'read as `near and (not (runs("R_A") or in("R", "S")))`',
            ],
        ),
        ("ne|ar and not", ['read as `near and (not (runs("R_A") or in("R", "S")))`']),
        ("the|n =", ["**then**: What happens without help"]),
        ("wai|ts(", ["`waits('Act')`: whether this act waits to be run, at least once", 'read as `waits("R_A")`']),
        ("nea|r and (", []),  # cannot be read; the finding says why
        ("[ke|ys]", ["**[keys]**: What each key does"]),
        ("en|d =", []),
        ('"ru|ns("', []),
    ],
)
def test_it_is_told(here: str, expected: list[str]) -> None:
    before, _, behind = here.partition("|")
    assert TEXT.count(before + behind) == 1
    offset = TEXT.index(before + behind) + len(before)
    assert list(setting_notes(TEXT, offset)) == expected
