"""Templates: what is wrong with them and where that stands, and that they are read as what they stand for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.scenario.files.xml import TextPiece, text_pieces
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.reading import expansion
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from rise_engine.scenario.shipped_studies import shipped_studies
from tests.commands import typed
from tests.scenario.folders import SPEECH, act, found, in_state, loaded, rule

SAY = """<Template name="Say"><parameter name="id"/><parameter name="text"/><parameter name="after" default=""/>
<Speech><actionID>${id}</actionID><waitForActions>${after}</waitForActions><message>${text}</message></Speech>
</Template>"""


def acts(body: str) -> str:
    return f"<Dialogs>\n{body}\n</Dialogs>\n"


def in_act(body: str, template: str = SAY) -> str:
    """A template, and an act that begins two lines below."""
    return acts(f'{template}\n<Dialog name="A">{body}</Dialog>')


def model(result: LoadResult) -> Any:
    """A scenario without the places where things stand, and without what identifies its files."""
    assert result.scenario is not None, [str(each) for each in result.diagnostics]
    return without_places(msgspec.json.decode(encode_scenario(result.scenario)))


def without_places(value: Any) -> Any:
    if isinstance(value, dict):
        gone = ("place", "hash", "folder")
        return {name: without_places(each) for name, each in value.items() if name not in gone}
    return [without_places(each) for each in value] if isinstance(value, list) else value


# --- what is wrong ---------------------------------------------------------------------------------------------------

# By name: an acts file, and what is found: line, column, code and a part of the message.
FAULTS: dict[str, tuple[str, list[tuple[str, str]]]] = {
    "nothing": (acts(f'{SAY}\n<Dialog name="A"><use template="Say" id="1" text="Hi"/></Dialog>'), []),
    "unknown template": (
        acts(
            f'{SAY}\n<Dialog name="A">\n<use template="Sya" id="1" text="Hi"/>'
            f'<use template="Say" id="2" text="x"/></Dialog>'
        ),
        [("6:16 unknown-template", "there is no template `Sya`; did you mean `Say`?")],
    ),
    "every bad use at once": (
        in_act('\n<use template="Say" id="1"/>\n<use template="Say" idd="1" text="a"/>\n<use/>'),
        [
            ("6:1 missing-parameter", "the template `Say` (acts/a.xml, line 2) needs `text`"),
            ("7:21 unknown-parameter", "the template `Say` has no parameter `idd`; did you mean `id`?"),
            ("8:1 missing-attribute", '`<use>` needs a template: <use template="..."/>'),
        ],
    ),
    "an argument too many": (
        acts(f'{SAY}\n<Dialog name="A">\n<use template="Say" id="1" text="a" speed="2"/></Dialog>'),
        [("6:37 unknown-parameter", "has no parameter `speed`; known: `id`, `text`, `after`")],
    ),
    "twice": (
        acts(f'{SAY}\n{SAY}<Dialog name="A"><use template="Say" id="1" text="Hi"/></Dialog>'),
        [("5:17 duplicate-name", "there is another template `Say` in acts/a.xml, line 2")],
    ),
    "a parameter twice": (
        acts(
            '<Template name="T"><parameter name="a"/><parameter name="a"/><Dialog name="${a}"/></Template>'
            '<use template="T" a="A"/>'
        ),
        [
            ("2:58 duplicate-parameter", "the parameter `a` is given twice here"),
            ("2:94 empty-act", "in the template `T`"),
        ],
    ),
    "unused": (acts(SAY + act(SPEECH)), [("2:17 unused-template", "nothing uses the template `Say`")]),
    "an unused parameter": (
        acts(
            f'<Template name="T"><parameter name="a"/>{SPEECH}</Template>'
            f'<Dialog name="A"><use template="T" a="A"/></Dialog>'
        ),
        [("2:37 unused-parameter", "the template `T` makes no use of its parameter `a`")],
    ),
    "a parameter that there is not": (
        acts('<Template name="T"><parameter name="name"/><Dialog name="R_${nmae}"/></Template>' + act(SPEECH)),
        [
            ("2:17 unused-template", "nothing uses"),
            ("2:37 unused-parameter", "`name`"),
            ("2:60 unknown-parameter", "the template `T` has no parameter `nmae`; did you mean `name`?"),
        ],
    ),
    "an open brace": (
        acts('<Template name="T"><parameter name="name"/><Dialog name="R_${name"/></Template>' + act(SPEECH)),
        [("2:17 unused-template", "nothing uses"), ("2:60 template", "a `${` without its `}`; write `$${`")],
    ),
    "a circle": (
        acts(
            '<Template name="T"><use template="U"/></Template>\n<Template name="U"><use template="T"/></Template>\n'
            '<Dialog name="A"><use template="T"/></Dialog>'
        ),
        [("2:17 cycle", "these templates use each other: T -> U -> T; none of them would ever end")],
    ),
    "itself": (
        acts('<Template name="T"><use template="T"/></Template>\n<Dialog name="A"><use template="T"/></Dialog>'),
        [("2:17 cycle", "T -> T")],
    ),
    "a template in a template": (
        acts(
            f'<Template name="T"><Template name="U"/>{SPEECH}</Template><Dialog name="A"><use template="T"/></Dialog>'
        ),
        [("2:20 unknown-element", "`<Template>` is not allowed here; it belongs beside the acts or rules of a file")],
    ),
    "a template in an act": (
        act(f'<Template name="T"/>{SPEECH}'),
        [("2:1 unknown-element", "`<Template>` is not allowed here")],
    ),
    "a use that holds something": (
        acts(f'{SAY}\n<Dialog name="A"><use template="Say" id="1" text="Hi"><Wait/></use> loud </Dialog>'),
        [
            ("5:55 unknown-element", "nothing is allowed inside `<use>`"),
            ("5:69 unexpected-text", "text is not allowed here: `loud`"),
        ],
    ),
    "text behind a template": (
        acts(f'{SAY} loud <Dialog name="A"><use template="Say" id="1" text="Hi"/></Dialog>'),
        [("4:13 unexpected-text", "text is not allowed here: `loud`")],
    ),
    "a use in a text": (
        acts(
            f'{SAY}\n<Dialog name="A"><Speech><actionID>1</actionID>'
            f'<message><use template="Say"/></message></Speech></Dialog>'
        ),
        [
            ("5:48 missing-parameter", "`message` is empty"),
            ("5:57 misplaced", "`<use>` is not allowed in `<message>`; it belongs where acts, actions, rules,"),
        ],
    ),
    "what a template needs": (
        acts('<Template><parameter/><parameter name="a b"/><parameter name="template"/><x/></Template>' + act(SPEECH)),
        [
            ("2:1 missing-attribute", "a template needs a name"),
            ("2:11 missing-attribute", "a parameter needs a name"),
            ("2:40 bad-name", "not `a b`"),
            ("2:63 bad-name", "`template` says which template is used"),
        ],
    ),
    "a default of parameters": (
        acts(
            '<Template name="T"><parameter name="a" default="R_${b}"/><Dialog name="${a}"/></Template>\n'
            '<!-- check: allow empty-act: short -->\n<use template="T" a="A"/>'
        ),
        [("2:51 template", "a default is a plain text; it cannot name other parameters")],
    ),
    "an empty template": (
        acts('<Template name="T"/><Dialog name="A">' + SPEECH + '<use template="T"/></Dialog>'),
        [("2:1 no-effect", "the template `T` holds nothing")],
    ),
    "a template named by a parameter": (
        acts(
            f'{SAY}<Template name="T"><parameter name="a"/><use template="${{a}}"/></Template>\n'
            '<Dialog name="A"><use template="Say" id="1" text="a"/><use template="T" a="Say"/></Dialog>'
        ),
        [("4:67 wrong-value", "write the template's name itself, without `${...}`")],
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_with_templates(tmp_path: Path, name: str) -> None:
    text, expected = FAULTS[name]
    result = loaded(tmp_path, {"acts/a.xml": text})
    assert found(result) == [f"acts/a.xml:{place}" for place, _ in expected]
    for diagnostic, (_, part) in zip(result.diagnostics, expected, strict=True):
        assert part in diagnostic.message


# --- where it stands -------------------------------------------------------------------------------------------------


def test_a_finding_stands_in_the_value_that_is_wrong_and_names_the_line_of_the_template(tmp_path: Path) -> None:
    texts: dict[str, str | bytes] = {
        "acts/t.xml": acts(SAY),
        "acts/u.xml": acts(
            '<Dialog name="A">\n<use template="Say" id="1" text="Dear &amp; {nobody}" after="7"/></Dialog>'
        ),
    }
    result = loaded(tmp_path, texts)
    assert found(result) == ["acts/u.xml:3:45 unset-key", "acts/u.xml:3:62 unknown-id"]
    assert result.diagnostics[0].message.endswith("(in the template `Say`: acts/t.xml, line 3)")


def test_through_two_templates(tmp_path: Path) -> None:
    text = acts(
        f'{SAY}\n<Template name="Greet">\n<parameter name="who"/><Dialog name="R_${{who}}">\n'
        '<use template="Say" id="1" text="Hi ${who}"/></Dialog></Template>\n<use template="Greet" who="a {b"/>'
    )
    result = loaded(tmp_path, {"acts/a.xml": text})
    assert found(result) == ["acts/a.xml:8:30 template"]
    assert result.diagnostics[0].message.endswith("(in the template `Say`: acts/a.xml, line 3)")


def test_what_is_wrong_in_a_template_is_told_once(tmp_path: Path) -> None:
    text = acts(
        '<Template name="T"><parameter name="name"/>\n<Dialog name="${name}"><Speach><actionID>1</actionID></Speach>'
        '</Dialog></Template>\n<use template="T" name="A"/>\n<use template="T" name="B"/>'
    )
    result = loaded(tmp_path, {"acts/a.xml": text})
    assert found(result) == ["acts/a.xml:4:1 unknown-action"]
    assert result.diagnostics[0].message.endswith("(in the template `T`: acts/a.xml, line 3; used 2 times)")


def test_what_a_failed_use_leaves_out_is_no_finding_of_its_own(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "acts/a.xml": acts('<use template="Nobody" name="R_Hello"/>'),
        "rules/r.xml": rule(
            '<State id="S"><onEntry><function startCommunicationRobotAct="R_Hello"/></onEntry>'
            '<transition ended="R_Hello" target="Next"/></State>\n<use template="Nobody" id="Next"/>'
        ),
    }
    assert found(loaded(tmp_path, files)) == ["acts/a.xml:2:16 unknown-template", "rules/r.xml:3:16 unknown-template"]


@pytest.mark.parametrize("where", ["use", "template"])
def test_a_warning_is_silenced_at_the_use_or_in_the_template(tmp_path: Path, where: str) -> None:
    silence = "<!-- check: allow unset-key: the camera node -->"
    in_template, at_use = (silence, "") if where == "template" else ("", silence)
    text = acts(
        f'<Template name="T"><parameter name="a"/><Speech><actionID>1</actionID>'
        f"{in_template}<message>{{${{a}}}}</message>"
        f'</Speech></Template><Dialog name="A">{at_use}<use template="T" a="k"/></Dialog>'
    )
    result = loaded(tmp_path, {"acts/a.xml": text})
    assert found(result) == [] and len(result.suppressed) == 1


def test_json_says_where_in_the_template(tmp_path: Path) -> None:
    loaded(tmp_path, {"acts/a.xml": acts(f'{SAY}<Dialog name="A"><use template="Say" id="1" text="{{k}}"/></Dialog>')})
    output = typed("check", tmp_path, "--json").output
    (row,) = msgspec.json.decode(output)["findings"]
    assert (row["line"], row["template"]) == (4, {"name": "Say", "file": "acts/a.xml", "line": 3, "column": 85})


# --- what they stand for ---------------------------------------------------------------------------------------------


def test_acts_rules_states_transitions_and_functions(tmp_path: Path) -> None:
    with_templates: dict[str, str | bytes] = {
        "acts/a.xml": acts(f'{SAY}<Template name="Greeting"><parameter name="name"/><Dialog name="R_${{name}}">'
                           '<use template="Say" id="1" text="Hello ${name}"/>'
                           '<use template="Say" id="2" text="!" after="1"/>'
                           '</Dialog></Template><use template="Greeting" name="Anna"/>'),
        "rules/r.xml": (
            '<InteractionRules>\n<Template name="Waits"><parameter name="id"/><parameter name="then"/>'
            '<State id="${id}">'
            '<use template="Start"/><use template="Way" to="${then}"/></State></Template>'
            '<Template name="Start"><onEntry><use template="Do"/></onEntry></Template>'
            '<Template name="Do"><function startCommunicationRobotAct="R_Anna"/></Template>'
            '<Template name="Way"><parameter name="to"/><parameter name="how" default="succeeded"/>'
            '<transition ended="R_Anna" outcome="${how}" target="${to}"/></Template>'
            '<Template name="Rule"><InteractionRule name="R" initial="S"><use template="Waits" id="S" then="T"/>'
            '<State id="T"/></InteractionRule></Template><use template="Rule"/></InteractionRules>'
        ),
    }  # fmt: skip
    by_hand: dict[str, str | bytes] = {
        "acts/a.xml": act(
            "<Speech><actionID>1</actionID><message>Hello Anna</message></Speech>"
            "<Speech><actionID>2</actionID><waitForActions>1</waitForActions><message>!</message></Speech>",
            "R_Anna",
        ),
        "rules/r.xml": rule(
            '<State id="S"><onEntry><function startCommunicationRobotAct="R_Anna"/></onEntry>'
            '<transition ended="R_Anna" outcome="succeeded" target="T"/></State><State id="T"/>'
        ),
    }
    result = loaded(tmp_path / "short", with_templates)
    assert {**model(result), "title": ""} == {**model(loaded(tmp_path / "long", by_hand)), "title": ""}
    assert result.diagnostics == []
    assert decode_scenario(encode_scenario(result.scenario)) == result.scenario


def test_a_template_may_lie_in_a_file_of_its_own(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {"acts/say.xml": SAY, "acts/a.xml": act('<use template="Say" id="1" text="Hi"/>')}
    result = loaded(tmp_path, files)
    assert found(result) == [] and list(result.scenario.acts) == ["A"]


def test_outside_of_templates_a_dollar_means_nothing(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "acts/a.xml": act(SPEECH.replace("Hello", "It costs $${price} or ${price}")),
        "memory.json": '{"price": 5}',
    }
    call = loaded(tmp_path, files).scenario.acts["A"].actions[0].calls[0]
    assert call.parameters["message"].fill({"price": 5}) == "It costs $$5 or $5"


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("", []),
        ("plain $ {x} }", [("plain $ {x} }", None)]),
        ("a${b}c", [("a", None), ("${b}", "b"), ("c", None)]),
        ("$${b}${ b }", [("${", None), ("b}", None), ("${ b }", "b")]),
        ("${b", [("${b", "b")]),
        ("${a${b}", [("${a", "a"), ("${b}", "b")]),
    ],
)
def test_the_parts_of_a_text(written: str, expected: list[tuple[str, str | None]]) -> None:
    pieces = list(text_pieces(written))
    assert [(piece.text, piece.parameter) for piece in pieces] == expected
    assert all(written.startswith(piece.text.removeprefix("${"), piece.start + 2 * (piece.text == "${")) or
               written.startswith(piece.text, piece.start) for piece in pieces)  # fmt: skip


@given(st.text(alphabet="${}ab\n ", max_size=30))
def test_text_without_parameters_stays_as_it_is(written: str) -> None:
    pieces = list(text_pieces(written))
    assert "".join("$${" if piece == TextPiece(piece.start, "${") else piece.text for piece in pieces) == written


SSML = """<Template name="T"><parameter name="who"/>
<Dialog name="R_${who}"><Speech><actionID>1</actionID><message><speak>Hello <break time="500ms"/> ${who}, and
 <emphasis>you</emphasis> {nobody|} <s/></speak></message></Speech></Dialog>
</Template>
<use template="T" who="Anna"/>"""


def test_parameters_between_the_tags_of_ssml(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "acts/a.xml": acts(SSML),
        "scenario.toml": "title = 't'\nactions.Speech.ssml = true",
    }
    result = loaded(tmp_path / "short", files)
    message = result.scenario.acts["R_Anna"].actions[0].calls[0].parameters["message"]
    assert message.text == (
        '<speak>Hello <break time="500ms"/> Anna, and <emphasis>you</emphasis> {nobody|} <s/></speak>'
    )
    assert found(result) == []
    done = typed("expand", tmp_path / "short", "-o", tmp_path / "plain")
    assert done.exit_code == 0 and model(load(tmp_path / "plain")) == model(result)


def test_a_fault_in_ssml_stands_in_the_use(tmp_path: Path) -> None:
    text = acts(SSML.replace('time="500ms"', 'time="${who}"').replace("{nobody|}", "{no.body}"))
    result = loaded(tmp_path, {"acts/a.xml": text, "scenario.toml": "actions.Speech.ssml = true"})
    assert found(result) == ["acts/a.xml:6:1 unset-key", "acts/a.xml:6:24 ssml"]
    assert "line 4)" in result.diagnostics[0].message and "line 3)" in result.diagnostics[1].message


# --- limits ----------------------------------------------------------------------------------------------------------


def test_templates_that_double_each_other_are_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expansion, "MAX_ELEMENTS", 4_000)
    body = "".join(
        f'<Template name="T{n}"><use template="T{n + 1}"/><use template="T{n + 1}"/></Template>\n' for n in range(40)
    )
    text = acts(f'{body}<Template name="T40">{SPEECH}</Template>\n<Dialog name="A">\n<use template="T0"/></Dialog>')
    result = loaded(tmp_path, {"acts/a.xml": text})
    assert [each for each in found(result) if "too-large" in each] == ["acts/a.xml:44:1 too-large"]


@pytest.mark.parametrize(("limit", "code"), [("MAX_CHARACTERS", "too-large"), ("MAX_LEVELS", "too-deep")])
def test_other_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, code: str) -> None:
    monkeypatch.setattr(expansion, limit, 2)
    text = acts(f'{SAY}<Dialog name="A"><use template="Say" id="1" text="{"a" * 50}"/></Dialog>')
    assert [each.split()[1] for each in found(loaded(tmp_path, {"acts/a.xml": text}))] == [code]


# --- rise-engine expand ----------------------------------------------------------------------------------------------

names = st.sampled_from(["x", "Müller & Söhne", 'He said "no"', "a < b", "two\nlines", " blanks  between ", "$", "]]>"])


@given(st.lists(st.tuples(names, st.booleans()), min_size=1, max_size=5), st.booleans())
def test_what_expand_writes_is_the_same_scenario(texts: list[tuple[str, bool]], in_own_file: bool) -> None:
    from tempfile import TemporaryDirectory
    from xml.sax.saxutils import quoteattr

    uses = "".join(
        f'<!-- act {n} -->\n  <Dialog name="A{n}"><use template="Say" id="1" text={quoteattr(text)}/>'
        + (f'\n    <use template="Say" id="2" text={quoteattr(text)} after="1"/>' if twice else "")
        + "</Dialog>\n"
        for n, (text, twice) in enumerate(texts)
    )
    with TemporaryDirectory() as where:
        old, new = Path(where) / "old", Path(where) / "new"
        files: dict[str, str | bytes] = {
            "acts/a.xml": acts(("" if in_own_file else f"<!-- it says -->\n{SAY}\n") + uses)
        }
        if in_own_file:
            files["acts/say.xml"] = SAY
        result = loaded(old, files | {"scenario.toml": "title = 't'"})
        done = typed("expand", old, "-o", new)
        assert done.exit_code == 0, done.output
        assert model(load(new)) == model(result)
        text = (new / "acts" / "a.xml").read_text("utf-8")
        assert "Template" not in text and "<use" not in text and "<!-- act 0 -->" in text
        assert "it says" not in text and not (new / "acts" / "say.xml").exists()


@pytest.mark.parametrize("study", shipped_studies())
def test_the_shipped_studies_are_the_same_without_templates(tmp_path: Path, study: str) -> None:
    new = tmp_path / study
    assert typed("expand", study, "-o", new).exit_code == 0
    assert model(load(new)) == model(load(shipped_studies()[study]))
    written = "".join(path.read_text("utf-8") for path in new.rglob("*.xml"))
    assert "<use" not in written and "<Template" not in written and "${" not in written


def test_expand_prints_and_says_what_is_beyond_rise(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "acts/a.xml": acts(f'{SAY}\n<Dialog name="A"><use template="Say" id="1" text="Hi"/></Dialog>'),
        "rules/r.xml": in_state(
            '<function startCommunicationRobotAct="A"/>', '<transition ended="A" target="S"/><transition after="2s"/>'
        ),
    }
    loaded(tmp_path, files)
    done = typed("expand", tmp_path)
    assert done.exit_code == 0
    assert '<!-- acts/a.xml -->\n<Dialogs>\n<Dialog name="A"><Speech>\n' in done.stdout
    assert "<!-- rules/r.xml -->" in done.stdout and "Template" not in done.stdout
    assert done.stderr.strip() == (
        "beyond RISE itself, these acts and rules have: `after` of `<transition>` (1), "
        "`ended` of `<transition>` (1), transitions without `target` (1)"
    )


def test_expand_refuses(tmp_path: Path) -> None:
    loaded(tmp_path / "bad", {"acts/a.xml": acts("<use/>")})
    done = typed("expand", tmp_path / "bad")
    assert done.exit_code == 1 and "missing-attribute" in done.stderr and done.stdout == ""
    loaded(tmp_path / "good", {"acts/a.xml": act(SPEECH)})
    done = typed("expand", tmp_path / "good", "-o", tmp_path / "bad")
    assert done.exit_code == 1 and "is not empty; name a new folder" in done.stderr
    assert typed("expand", tmp_path / "none").exit_code == 2
