"""Where keys and values stand in a TOML file, also in lists of tables."""

from __future__ import annotations

import pytest

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.toml_files import read_toml

TEXT = """\
a = 1
[[check]]
id = "x"
[[check]]
  id = "y"
[check.more]
z = 3
[[check.parts]]
q = 1
[[check.parts]]
q = 2
[[check]]
parts = [{ q = 3 }, { q = 4 }]
"""


@pytest.mark.parametrize(
    ("path", "key", "value"),
    [
        ("a", "1:1", "1:5"),
        ("check.0", "2:1", "2:1"),
        ("check.0.id", "3:1", "3:6"),
        ("check.1", "4:1", "4:1"),
        ("check.1.id", "5:3", "5:8"),
        ("check.1.more.z", "7:1", "7:5"),
        ("check.1.parts.0.q", "9:1", "9:5"),
        ("check.1.parts.1.q", "11:1", "11:5"),
        ("check.2.parts.1.q", "13:23", "13:27"),
        ("check.2.nothing", "12:1", "12:1"),
    ],
)
def test_places_in_lists_of_tables(path: str, key: str, value: str) -> None:
    file = read_toml(SourceFile("f", TEXT.encode(), TEXT), Diagnostics())
    assert file is not None
    parts = path.split(".")
    assert (str(file.key_location(*parts)), str(file.value_location(*parts))) == (f"f:{key}", f"f:{value}")


def test_a_number_that_is_none_is_told_where_it_stands() -> None:
    text = "[[a]]\nx = 1\n[[a]]\nx = nan\n"
    diagnostics = Diagnostics()
    read_toml(SourceFile("f", text.encode(), text), diagnostics)
    assert [str(each.location) for each in diagnostics.sorted()] == ["f:4:5"]
