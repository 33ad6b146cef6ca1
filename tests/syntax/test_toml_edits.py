"""Changes of TOML files: what is asked for, and nothing else in them."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.plan import EditRefused
from rise_engine.syntax.changes import changed_text, edits_between
from rise_engine.syntax.toml import toml_value
from rise_engine.syntax.toml_edits import remove_value, rename_key, rename_keys, set_value

STUDY = """\
# A study.

title = 'Greeting "one"'   # shown on screens
robot = "pepper"
private = [
  "name",  # of the person
  "age",   # in years
]

[keys]
# The course
n   = { rule = "Next", label = "next" } # once
"." = { act = "R_Nod" }

# What the main rule says.
[act."R_Task*"]
hold = true

[act.R_Nod]
filler = true
debounce = 1.0

# The conditions.
[conditions.A]
memory = { pause = 600, deep.er = 1 }

[[check]]
say = \"\"\"
One
two\"\"\"
[[check]]
say = "b"
"""


@pytest.mark.parametrize(
    ("path", "value", "lines"),
    [
        ("title", 'It "is"', {"""'Greeting "one"'""": """'It "is"'"""}),
        ("title", "It's", {"""'Greeting "one"'""": '"It\'s"'}),
        ("keys.n.label", "go", {'"next"': '"go"'}),
        ("keys.n.hold", True, {'label = "next"': 'label = "next", hold = true'}),
        ("keys.n", {"act": "R_Nod"}, {'rule = "Next", label = "next"': 'act = "R_Nod"'}),
        ("keys.ok", {"act": "R"}, {'{ act = "R_Nod" }\n': '{ act = "R_Nod" }\nok  = { act = "R" }\n'}),
        ("keys.longer", {"act": "R"}, {'{ act = "R_Nod" }\n': '{ act = "R_Nod" }\nlonger = { act = "R" }\n'}),
        ("keys.n", None, {'n   = { rule = "Next", label = "next" } # once\n': ""}),
        ("act.R_Nod.hold", False, {"debounce = 1.0\n": "debounce = 1.0\nhold = false\n"}),
        ("act.R_Yes.hold", True, {"debounce = 1.0\n": "debounce = 1.0\n\n[act.R_Yes]\nhold = true\n"}),
        ("act.R_Nod", None, {"\n[act.R_Nod]\nfiller = true\ndebounce = 1.0\n": ""}),
        ("act.R_Task*.hold", None, {'[act."R_Task*"]\nhold = true\n': ""}),
        ("conditions.A.memory.pause", 700, {"600": "700"}),
        ("conditions.A.memory.deep.er", None, {", deep.er = 1": ""}),
        ("conditions.A.label", "a", {"deep.er = 1 }\n": 'deep.er = 1 }\nlabel = "a"\n'}),
        (
            "conditions.B",
            {"memory": {"pause": 1}},
            {"deep.er = 1 }\n": "deep.er = 1 }\n\n[conditions.B]\nmemory = { pause = 1 }\n"},
        ),
        ("private.2", "town", {'"age",   # in years\n': '"age",   # in years\n  "town",\n'}),
        ("private.0", None, {'  "name",  # of the person\n': ""}),
        ("private", ["name"], {'  "age",   # in years\n': ""}),
        ("check.1.say", "c", {'"b"': '"c"'}),
        ("check.0.say", "One\nthree", {"two": "three"}),
        ("check.2", {"say": "x"}, {'say = "b"\n': 'say = "b"\n\n[[check]]\nsay = "x"\n'}),
        ("check.1", None, {'[[check]]\nsay = "b"\n': ""}),
        ("mode", "real", {"]\n\n[keys]": ']\nmode = "real"\n\n[keys]'}),
        ("study.participants", 3, {'say = "b"\n': 'say = "b"\n\n[study]\nparticipants = 3\n'}),
        ("language", None, None),
        ("title.deeper", 1, None),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_one_entry_changes_and_nothing_else(path: str, value: Any, lines: dict[str, str] | None, newline: str) -> None:
    text = STUDY.replace("\n", newline)
    names = tuple(path.split("."))
    if lines is None:
        with pytest.raises(EditRefused):
            _ = remove_value(text, names) if value is None else set_value(text, names, value)
        return
    expected = STUDY
    for old, new in lines.items():
        where = expected.rindex(old)
        expected = expected[:where] + new + expected[where + len(old) :]
    after = remove_value(text, names) if value is None else set_value(text, names, value)
    assert after == expected.replace("\n", newline)
    tomllib.loads(after)


@pytest.mark.parametrize(
    ("path", "name", "old", "new"),
    [
        ("keys.n", "m", "n   =", "m   ="),
        ("keys.n", "next", "n   =", "next ="),
        ("keys..", "!", '"." =', '"!" ='),
        ("act.R_Nod", "R Nod", "[act.R_Nod]", '[act."R Nod"]'),
        ("conditions", "groups", "[conditions.A]", "[groups.A]"),
        ("conditions.A.memory.pause", "wait", "pause", "wait"),
        ("check", "checks", "[[check]]", "[[checks]]"),
    ],
)
def test_an_entry_gets_another_name_in_its_place(path: str, name: str, old: str, new: str) -> None:
    names = ("keys", ".") if path == "keys.." else tuple(path.split("."))
    assert rename_key(STUDY, names, name) == STUDY.replace(old, new)


def test_a_name_that_is_taken_and_an_element_of_a_list_are_refused() -> None:
    with pytest.raises(EditRefused, match="there already"):
        rename_key(STUDY, ("keys", "n"), ".")
    with pytest.raises(EditRefused, match="has no name"):
        rename_key(STUDY, ("private", "0"), "x")


@pytest.mark.parametrize(
    ("text", "path", "value", "after"),
    [
        ("", "a", 1, "a = 1\n"),
        ("", "a.b", 1, "[a]\nb = 1\n"),
        ("", "keys.n", {"act": "R"}, '[keys]\nn = { act = "R" }\n'),
        ("[b]\nc = 1", "a", 1, "a = 1\n\n[b]\nc = 1"),
        ("# of b\n[b]\nc = 1", "a", 1, "a = 1\n\n# of b\n[b]\nc = 1"),
        ("[b]\nc = 1", "b.d", 2, "[b]\nc = 1\nd = 2"),
        ("[b]\nc = 1", "d.e", 2, "[b]\nc = 1\n\n[d]\ne = 2\n"),
        ("a.b = 1\nz = 2\n", "a.c", 3, "a.b = 1\na.c = 3\nz = 2\n"),
        ("[a.b]\nc = 1\n", "a.d", 1, "[a]\nd = 1\n\n[a.b]\nc = 1\n"),
        ("a = []\n", "a.0", "x", 'a = ["x"]\n'),
        ("a = {}\n", "a.b", 1, "a = { b = 1 }\n"),
        ("a = [1, 2, 3]\n", "a", [1, 3], "a = [1, 3]\n"),
        ("a = [1, 2]\n", "a", [1, 2, 3, 4], "a = [1, 2, 3, 4]\n"),
        ("a = [\n 1,\n 2 # two\n]\n", "a.2", 3, "a = [\n 1,\n 2, # two\n 3\n]\n"),
        ("a = [\n 1, # one\n 2 # two\n]\n", "a.1", None, "a = [\n 1, # one\n]\n"),
        ("a = 2026-01-01\nb = 1\n", "b", 2, "a = 2026-01-01\nb = 2\n"),
        ("[a]\n# why\nb = 1 # that\n\n[c]\n", "a.b", 2, "[a]\n# why\nb = 2 # that\n\n[c]\n"),
        ("[a]\nb = 1\n\n[c]\nd = 1\n", "a.b", None, "[c]\nd = 1\n"),
        ("[[a]]\nb = 1\n[a.c]\nd = 1\n[[a]]\n", "a.0.c.d", 2, "[[a]]\nb = 1\n[a.c]\nd = 2\n[[a]]\n"),
        ("[[a]]\nb = 1\n", "a.0.c.d", 2, "[[a]]\nb = 1\nc = { d = 2 }\n"),
    ],
)
def test_files_of_all_kinds(text: str, path: str, value: Any, after: str) -> None:
    names = tuple(path.split("."))
    assert (remove_value(text, names) if value is None else set_value(text, names, value)) == after


names = st.sampled_from(["a", "b", "c d", "é", "1", 'q"'])
scalars = st.booleans() | st.integers(-9, 9) | st.floats(-2, 2, width=16) | st.text("aé\"\\\n'#=", max_size=4)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3), max_leaves=5
)


@st.composite
def documents(draw: st.DrawFn) -> str:
    """A TOML file with comments everywhere; every comment is another one."""
    lines: list[str] = []
    number = iter(range(1000))

    def flip() -> bool:
        return draw(st.booleans())

    def add_pairs(used: set[str]) -> None:
        for key in draw(st.lists(names, max_size=3, unique=True)):
            if key not in used:
                used.add(key)
                if flip():
                    lines.append(f"# c{next(number)} above")
                comment = f" # c{next(number)}" if flip() else ""
                value = draw(values)
                written = toml_value(value)
                if isinstance(value, list) and value and flip():
                    inner = "".join(f"\n  {toml_value(each)}, # c{next(number)}" for each in value)
                    written = f"[{inner}\n]"
                lines.append(f"{toml_value(key)} {'  ' if flip() else ''}= {written}{comment}")
                if flip():
                    lines.append("")

    add_pairs({"T", "L"})
    for name in draw(st.lists(st.sampled_from(["T.x", "T.y", "U", "V.a.b"]), max_size=3, unique=True)):
        lines.append(f"[{name}] # c{next(number)}")
        add_pairs({"x", "y"})
    for _ in range(draw(st.integers(0, 2))):
        lines.append("[[L]]")
        add_pairs(set())
    return "\n".join(lines) + draw(st.sampled_from(["", "\n"]))


def paths(value: Any, lead: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, inner in items for found in [(*lead, str(key)), *paths(inner, (*lead, str(key)))]]


def with_value(holder: Any, path: tuple[str, ...], value: Any) -> None:
    for part in path[:-1]:
        holder = holder[int(part) if isinstance(holder, list) else part]
    if value is None:
        del holder[int(path[-1]) if isinstance(holder, list) else path[-1]]
    else:
        holder[int(path[-1]) if isinstance(holder, list) else path[-1]] = value


def without_empty(value: Any) -> Any:
    if isinstance(value, dict):
        inner = {key: without_empty(each) for key, each in value.items()}
        return {key: each for key, each in inner.items() if each not in ({}, [])}
    return [without_empty(each) for each in value] if isinstance(value, list) else value


@pytest.mark.slow
@given(documents(), st.data())
def test_any_entry_of_any_file(text: str, data: st.DataObject) -> None:
    before = tomllib.loads(text)
    found = paths(before)
    if not found:
        return
    path = data.draw(st.sampled_from(found))
    value = data.draw(st.none() | values)
    wanted = tomllib.loads(text)
    with_value(wanted, path, value)
    tables = isinstance(_value_at(before, path), dict) and path[-2:-1] == ("L",)
    if tables and not isinstance(value, dict | None):  # an element of [[L]] stays a table
        return
    after = remove_value(text, path) if value is None else set_value(text, path, value)
    assert without_empty(tomllib.loads(after)) == without_empty(wanted)
    edits = edits_between(text, after)
    assert changed_text(text, edits) == after
    assert set_value(text, path, _value_at(before, path)) == text
    for line in text.splitlines():  # comments that do not belong to what goes
        if line.startswith("# c"):
            gone = not isinstance(_value_at(before, path), dict | list)
            assert not gone or line in after.splitlines()


def _value_at(value: Any, path: tuple[str, ...]) -> Any:
    for part in path:
        value = value[int(part) if isinstance(value, list) else part]
    return value


@pytest.mark.slow
@given(
    documents(), st.lists(st.sampled_from(["a", "b", "T", "x", "U", "new", "V", "L"]), min_size=1, max_size=3), values
)
def test_any_new_entry(text: str, path: list[str], value: Any) -> None:
    before = tomllib.loads(text)
    holder: Any = before
    for part in path:
        if not isinstance(holder, dict):
            return
        holder = holder.get(part, {})
    wanted: Any = tomllib.loads(text)
    inner = wanted
    for part in path[:-1]:
        inner = inner.setdefault(part, {})
    if isinstance(inner, list):
        return
    inner[path[-1]] = value
    after = set_value(text, tuple(path), value)
    assert without_empty(tomllib.loads(after)) == without_empty(wanted)


def test_names_can_be_swapped() -> None:
    text = 'a = 1  # one\n[t."2/1"]\nx = 1\n[t."2/2"]\nx = 2\n'
    swapped = rename_keys(text, {("t", "2/1"): "2/2", ("t", "2/2"): "2/1"})
    assert swapped == 'a = 1  # one\n[t."2/2"]\nx = 1\n[t."2/1"]\nx = 2\n'
    with pytest.raises(EditRefused, match="is there already"):
        rename_keys(text, {("t", "2/1"): "2/2"})
