"""The usual layout: nothing that is read changes, no comment goes, and a second time nothing moves."""

from __future__ import annotations

import json
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.formatting import format_file, format_memory, format_toml, lay_out
from rise_engine.author.edit.plan import EditRefused
from rise_engine.syntax.xml import comments_of
from rise_engine.syntax.xml_writing import format_xml
from tests.author.edit.guard import changed_paths
from tests.author.edit.samples import NAMES, SPELLINGS, state_of, study_files
from tests.syntax.test_toml_edits import documents


@pytest.mark.parametrize("name", NAMES)
def test_the_shipped_studies_are_in_the_usual_layout(name: str) -> None:
    layout = lay_out(study_files(name))
    assert (layout.changed, layout.problems) == ({}, {})


@pytest.mark.parametrize(("name", "spelling"), [("lablinking", "crlf"), *(("greeting", each) for each in SPELLINGS)])
def test_however_a_study_is_written_it_means_the_same_laid_out(name: str, spelling: str) -> None:
    files = study_files(name, spelling)
    layout = lay_out(files)
    assert layout.problems == {}
    after = {**files, **layout.changed}
    before, now = state_of(files, name), state_of(after, name)
    assert list(changed_paths(before, now)) == []
    assert [(each.code, each.message) for each in now.checked.diagnostics] == [
        (each.code, each.message) for each in before.checked.diagnostics
    ]
    for file, data in after.items():
        assert format_file(file, after) == data if file in layout.changed else True
        if file.endswith(".xml"):
            old, new = (list(comments_of(each[file].decode("utf-8-sig"))) for each in (files, after))
            assert old == new
            assert data.startswith(b"\xef\xbb\xbf") == files[file].startswith(b"\xef\xbb\xbf")
            if spelling == "crlf":
                assert data.count(b"\n") == data.count(b"\r\n") > 0


@pytest.mark.parametrize("spelling", ["bom_tabs", "cr", "quotes"])
def test_layouts_that_differ_only_in_blanks_come_out_as_they_were_shipped(spelling: str) -> None:
    files, shipped = study_files("greeting", spelling), study_files("greeting")
    after = {**files, **lay_out(files).changed}
    for file, data in after.items():
        if file.endswith(".xml"):
            written = data.decode("utf-8-sig").replace("\r", "\n").expandtabs(2)  # within values tabs stay
            if spelling == "quotes":
                written = written.replace("'", '"')
                assert written == shipped[file].decode().replace("'", '"')
            else:
                assert written == shipped[file].decode()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("<Dialogs/>", "<Dialogs/>\n"),
        (
            '<Dialogs><Dialog name = "A"  ><Speech><actionID>1</actionID><message> Hi  you </message></Speech></Dialog>'
            "</Dialogs>",
            '<Dialogs>\n<Dialog name="A">\n  <Speech><actionID>1</actionID><message> Hi  you </message></Speech>\n'
            "</Dialog>\n</Dialogs>\n",
        ),
        (
            "<Dialog name='A'>\n<Speech>\n<actionID>1</actionID>\n\n\n<message>a<!-- b -->c</message> <!-- why -->\n"
            "</Speech>\n"
            "<!-- two\n     lines -->\n</Dialog>",
            "<Dialog name='A'>\n  <Speech>\n    <actionID>1</actionID>\n\n"
            "    <message>a<!-- b -->c</message> <!-- why -->\n"
            "  </Speech>\n  <!-- two\n       lines -->\n</Dialog>\n",
        ),
        (
            "<A>\n <P><x>0</x> <y>1</y>\n <z>2</z></P>\n</A>",
            "<A>\n  <P>\n    <x>0</x> <y>1</y>\n    <z>2</z>\n  </P>\n</A>\n",
        ),
        ('<R>\n <t a="1"\n    b="2"/>\n</R>', '<R>\n  <t a="1" b="2"/>\n</R>\n'),
        (
            f'<R>\n<t a="{"x" * 70}"\n b="{"y" * 70}" c="1"/>\n</R>',
            f'<R>\n  <t a="{"x" * 70}"\n     b="{"y" * 70}" c="1"/>\n</R>\n',
        ),
        ("<?xml version='1.0'?>\r\n<!-- a -->\r\n<A/>", "<?xml version='1.0'?>\r\n<!-- a -->\r\n<A/>\r\n"),
        ("<A><B><![CDATA[ <x> ]]></B><C>t</C></A>", "<A><B><![CDATA[ <x> ]]></B><C>t</C></A>\n"),
    ],
)
def test_xml(before: str, after: str) -> None:
    assert format_xml(before) == after
    assert format_xml(after) == after


@pytest.mark.parametrize("text", ["<A>", "<A></A></A>", "<A b=1/>", "a", "<A"])
def test_what_is_no_xml_stays(text: str) -> None:
    files = {"acts/a.xml": text.encode()}
    layout = lay_out(files)
    assert layout.changed == {} and "acts/a.xml" in layout.problems


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("", ""),
        ("\n\na=1\n\n\n\n  b  =  'x'   # why  \n", "a = 1\n\nb = 'x'   # why\n"),
        ("a   = 1\nbbb = 2\nc    = 3\n", "a   = 1\nbbb = 2\nc = 3\n"),
        (
            "[a]\n  # of b\n  b = 1\n# of c\n[c]\nd=[\n 1,\n\n\n 2,\n]",
            "[a]\n# of b\nb = 1\n\n# of c\n[c]\nd = [\n 1,\n\n\n 2,\n]\n",
        ),
        ('a = """\n  x  \n\n\n  y = 1\n[b]\n"""\n', 'a = """\n  x  \n\n\n  y = 1\n[b]\n"""\n'),
        ("[a]\r\nb=1\r\n[[c]]\r\n[[c]]\r\n", "[a]\r\nb = 1\r\n\r\n[[c]]\r\n\r\n[[c]]\r\n"),
    ],
)
def test_toml(before: str, after: str) -> None:
    assert format_toml(before) == after
    assert format_toml(after) == after


@pytest.mark.slow
@given(documents(), st.sampled_from(["\n", "\r\n"]), st.sampled_from(["", "  ", "\t"]))
def test_any_toml(text: str, newline: str, margin: str) -> None:
    text = newline.join(line if line.startswith((" ", "]")) else margin + line for line in text.split("\n"))
    after = format_toml(text)
    assert repr(tomllib.loads(after)) == repr(tomllib.loads(text))
    assert format_toml(after) == after
    assert (
        [line.strip() for line in after.split("\n") if line.strip()] and after.count("#") == text.count("#")
        if text.strip()
        else True
    )


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("{}", "{}\n"),
        ('{"a":1.50,\n\n\n"b" : [1,2,{"c":"\\u00e9"}]}', '{\n  "a": 1.50,\n\n  "b": [1, 2, {"c": "\\u00e9"}]\n}\n'),
        ('{"WorkingMemory":[{"a":1},{"b":2,"c":3}]}', '{"WorkingMemory":\n[\n  {"a": 1},\n  {"b": 2, "c": 3}\n]\n}\n'),
        ('{"WorkingMemory":[]}\r\n', '{"WorkingMemory":\r\n[\r\n]\r\n}\r\n'),
    ],
)
def test_memory(before: str, after: str) -> None:
    assert format_memory(before) == after
    assert format_memory(after) == after


@given(
    st.dictionaries(
        st.text("ab\n", min_size=1, max_size=2),
        st.recursive(
            st.none() | st.integers(-9, 9) | st.text('a"\n', max_size=40),
            lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("xy", max_size=2), inner, max_size=4),
            max_leaves=8,
        ),
        max_size=4,
    ),
    st.sampled_from([None, 1, "\t"]),
)
def test_any_memory(memory: dict[str, object], indent: int | str | None) -> None:
    text = json.dumps(memory, indent=indent)
    after = format_memory(text)
    assert json.loads(after) == memory and format_memory(after) == after


def test_files_that_have_no_layout_are_left_alone() -> None:
    files = {"README.md": b"a  \n", "session.jsonl": b"{ }\n", "other/a.xml": b"<a ></a>", "tables/a.csv": b"a ,b\n"}
    assert lay_out(files).files == 0
    with pytest.raises(EditRefused, match="has no layout here"):
        format_file("README.md", files)
