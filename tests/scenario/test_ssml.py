"""Messages with pauses and emphasis: what is read, what is heard of them, how long they take (semantics.md 2.6)."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.editor_schemas import act_schema_text
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.reading.robot_profiles import builtin_robot
from rise_engine.scenario.reading.ssml_checks import find_ssml_problems
from rise_engine.scenario.speech.ssml import (
    begins_as_ssml,
    change_words,
    escape_value,
    literal_ssml,
    parse_ssml,
    pause_seconds,
    plain_words,
)
from rise_engine.scenario.speech.template import TemplateError, parse_template
from tests.commands import typed

from .folders import found, loaded

TIMED = '<speak>Hello <break time="500ms"/> you</speak>'


def files(message: str, robot: str = "generic", memory: str = "{}") -> dict[str, str | bytes]:
    """A scenario that says a message, which begins in line 2, column 1."""
    speech = f"<Speech><actionID>1</actionID><message>\n{message}\n</message></Speech>"
    return {
        "scenario.toml": f'robot = "{robot}"\n',
        "acts/a.xml": f'<Dialog name="A">{speech}</Dialog>',
        "memory.json": memory,
    }


def read(path: Path, message: str, memory: str = "{}") -> Scenario:
    scenario, findings = loaded(path, files(message, memory=memory))
    assert scenario is not None and findings == [], findings
    return scenario


def sent(scenario: Scenario, memory: dict[str, Any] | None = None) -> str:
    call = scenario.acts["A"].actions[0].calls[0]
    spec = scenario.robot.actions["Speech"]
    return str(fill_parameters(call, spec, scenario.memory if memory is None else memory)["message"])


# --- reading --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "expected"),
    {
        "as an element": (TIMED, TIMED),
        "as a text": (f"<![CDATA[{TIMED}]]>", TIMED),
        "with entities": ("&lt;speak>Tom &amp;amp; I&lt;/speak>", "<speak>Tom &amp; I</speak>"),
        "over several lines": ("<speak>\n  Hello\n  <s>you</s>\n</speak>", "<speak> Hello <s>you</s> </speak>"),
        "comments and CDATA": ("<speak>a<!-- no --> <![CDATA[<b> & c]]></speak>", "<speak>a &lt;b&gt; &amp; c</speak>"),
        "attributes": (
            "<speak xml:lang='en' x='\"&lt;&apos;'>a</speak>",
            '<speak xml:lang="en" x="&quot;&lt;&#x27;">a</speak>',
        ),
        "nothing in it": ("<speak></speak>", "<speak/>"),
        "another word": ("&lt;speaker> on", "<speaker> on"),
        "not at the beginning": ("Hello &lt;speak>", "Hello <speak>"),
    }.values(),
)
def test_what_is_read(tmp_path: Path, written: str, expected: str) -> None:
    message = sent(read(tmp_path, written))
    assert message == expected
    assert (parse_ssml(message) is not None) == expected.startswith(("<speak>", "<speak ", "<speak/"))


@pytest.mark.parametrize(
    ("written", "expected"),
    {
        "not closed": ("<![CDATA[<speak>Hello]]>", ["2:10 ssml"]),
        "closed in another order": ("<![CDATA[<speak><s>Hello</speak></s>]]>", ["2:25 ssml"]),
        "the second of two": ("<![CDATA[<speak><s>a</s> <s>b</p></speak>]]>", ["2:30 ssml"]),
        "an ampersand": ("<![CDATA[<speak>you & me</speak>]]>", ["2:21 ssml"]),
        "an entity of HTML": ("<![CDATA[<speak>{n|you}&nbsp;me</speak>]]>", ["2:24 ssml"]),
        "a comparison": ("<![CDATA[<speak>a < b</speak>]]>", ["2:19 ssml"]),
        "no quotation marks": ("<![CDATA[<speak><break time=5s/></speak>]]>", ["2:29 ssml"]),
        "an attribute twice": ('<![CDATA[<speak><s a="1" a="2"/></speak>]]>', ["2:26 ssml"]),
        "more behind it": ("<![CDATA[<speak>Hello</speak> you]]>", ["2:31 ssml"]),
        "a prefix of a maker": ("<![CDATA[<speak><x:y/></speak>]]>", []),
        "a prolog": ("<![CDATA[<?xml version='1.0'?><speak>Hello</speak>]]>", ["2:10 ssml"]),
        "a value as a tag": ("<![CDATA[<speak><{n|s}/></speak>]]>", ["2:17 ssml"]),
        "a tag for a value": ("<speak>{n|<break/>}</speak>", ["2:11 ssml"]),
        "a tag beside a value": ('<![CDATA[<speak>{"<break/>" n}</speak>]]>', ["2:17 unset-key", "2:19 ssml"]),
        "a quotation mark within a tag": ('<![CDATA[<speak><s x="{n|a"b}"/></speak>]]>', ["2:26 ssml"]),
        "a quotation mark for a word": ('<speak>{n|"a"}</speak>', []),
        "a value in a comment": ("&lt;speak>{n|a}&lt;!-- {n|a} -->&lt;/speak>", ["2:16 ssml"]),
        "a value in CDATA": ("&lt;speak>&lt;![CDATA[{n|a}]]&gt;&lt;/speak>", ["2:11 ssml"]),
        "a value in an instruction": ("<![CDATA[<speak><?x {n|a}?></speak>]]>", ["2:10 ssml"]),
        "a comment": ("<![CDATA[<speak>{n|a}<!-- b --></speak>]]>", []),
        "an ampersand for a value": ("<![CDATA[<speak>{n|a & b}</speak>]]>", ["2:20 ssml"]),
        "an unknown element": ("<speak>\n <s>a</s> <brake/></speak>", ["3:11 ssml"]),
        "an unknown element in a text": ("<![CDATA[<speak> <brake/> <brake/></speak>]]>", ["2:18 ssml"]),
        "no time": ('<speak>a<break strength="weak" time="500"/></speak>', ["2:38 ssml"]),
        "a time from the memory": ('<speak>a<break time="{n|500ms}"/></speak>', []),
        "an element of a maker": ('<speak xmlns:x="urn:x">a<x:whisper>b</x:whisper></speak>', []),
        "with SSML's namespace": (
            '<speak xmlns="http://www.w3.org/2001/10/synthesis" version="1.1">a<brake/></speak>',
            ["2:67 ssml"],
        ),
        "tags without speak": ("Say <emphasis>this</emphasis>", ["2:5 unknown-element"]),
        "two of them": ("<speak>a</speak><speak>b</speak>", ["2:1 unknown-element", "2:17 unknown-element"]),
        "text beside it": ("Hello <speak>a</speak>", ["2:1 unexpected-text"]),
        "a slot that is none": ("<speak>\n <s>{n!}</s></speak>", ["3:5 template"]),
        "a key that nobody sets": ("<speak>\n <s>{nobody}</s></speak>", ["3:5 unset-key"]),
    }.values(),
)
def test_what_is_found(tmp_path: Path, written: str, expected: list[str]) -> None:
    assert found(loaded(tmp_path, files(written))) == [f"acts/a.xml:{each}" for each in expected]


def test_errors_refuse_and_warnings_do_not(tmp_path: Path) -> None:
    assert loaded(tmp_path, files("<![CDATA[<speak>]]>")).scenario is None
    result = loaded(tmp_path, files("<speak><brake/></speak>"))
    assert result.scenario is not None
    assert result.diagnostics[0].message == "SSML has no element `<brake>`; did you mean `break`?"


def test_a_warning_that_is_meant_can_be_silenced(tmp_path: Path) -> None:
    meant = files("<!-- check: allow ssml: our voice has it --><puff/>".join(("<speak>a", "</speak>")))
    result = loaded(tmp_path, meant)
    assert found(result) == [] and [each.reason for each in result.suppressed] == ["our voice has it"]
    assert result.scenario is not None and sent(result.scenario) == "<speak>a<puff/></speak>"


def test_a_robot_that_takes_none_is_told_of_once(tmp_path: Path) -> None:
    result = loaded(tmp_path, files(TIMED, "pepper"))
    assert result.scenario is not None and found(result) == ["acts/a.xml:1:48 no-ssml"]
    again = files(TIMED, "pepper")
    again["acts/b.xml"] = str(again["acts/a.xml"]).replace('"A"', '"B"')
    (finding,) = loaded(tmp_path, again).diagnostics
    assert finding.message.startswith(
        "the robot Pepper (`pepper`) does not take SSML: it gets only the words (here, and in 1 further message)"
    )
    again["scenario.toml"] = 'robot = "pepper"\n[actions.Speech]\nssml = true\n'
    assert loaded(tmp_path, again).diagnostics == []


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("[actions.Speech]\nssml = 1\n", ["2:8 wrong-type"]),
        ("[actions.Emotion]\nssml = true\n", ["2:1 wrong-type"]),
        ('[actions.Announce]\nssml = true\nparameters.message = { type = "text" }\n', []),
    ],
)
def test_which_actions_can_take_it(tmp_path: Path, table: str, expected: list[str]) -> None:
    assert found(loaded(tmp_path, {"scenario.toml": table})) == [f"scenario.toml:{each}" for each in expected]


def test_a_robot_that_is_built_in_takes_what_the_generic_one_does(tmp_path: Path) -> None:
    generic = loaded(tmp_path, {}).scenario
    assert generic is not None
    assert builtin_robot().actions["Speech"].ssml and generic.robot.actions["Speech"].ssml
    assert not core_actions()["Speech"].ssml


def test_languages_within_it_are_languages_of_the_study(tmp_path: Path) -> None:
    lexicon: dict[str, str | bytes] = {"lexicon.toml": '[fr]\nRise = "raïse"\n'}
    french = '<speak>Hello <lang xml:lang="fr-CA">Rise</lang></speak>'
    assert found(loaded(tmp_path, {**files(french), **lexicon})) == []
    assert found(loaded(tmp_path, {**files(french.replace("fr-CA", "{tongue|en}")), **lexicon})) == []
    assert found(loaded(tmp_path, {**files(french.replace("fr-CA", "de")), **lexicon})) == [
        "lexicon.toml:1:2 no-effect"
    ]


def test_editors_know_it() -> None:
    schema = etree.RelaxNG(etree.fromstring(act_schema_text(builtin_robot().actions).encode()))
    for message in ("Hello", TIMED, '<speak xmlns="http://www.w3.org/2001/10/synthesis" a="b"><s>a</s>b</speak>'):
        act = etree.fromstring(str(files(message)["acts/a.xml"]))
        assert schema.validate(act), (message, schema.error_log)
    assert not schema.validate(etree.fromstring(str(files("<b>Hello</b>")["acts/a.xml"])))


# --- memory values --------------------------------------------------------------------------------------------------


def test_values_are_words_and_no_markup(tmp_path: Path) -> None:
    scenario = read(tmp_path, '<speak><s x="{n}">{"&lt;" n}</s>{m|a &amp; b}</speak>', '{"n": "\\"A\\" & <B>"}')
    message = sent(scenario)
    assert (
        message == '<speak><s x="&quot;A&quot; &amp; &lt;B&gt;">&lt;&quot;A&quot; &amp; &lt;B&gt;</s>a &amp; b</speak>'
    )
    assert plain_words(message) == '<"A" & <B> a & b'
    plain = read(tmp_path / "plain", "Hello {n}", '{"n": "<speak>A & B</speak>"}')
    assert sent(plain) == "Hello <speak>A & B</speak>", "in any other text nothing is changed"


def test_a_whole_message_from_the_memory_is_what_it_is(tmp_path: Path) -> None:
    scenario = read(tmp_path, "{n}", '{"n": "<speak>A <break time=\\"2s\\"/> B</speak>"}')
    assert plain_words(sent(scenario)) == "A B" and pause_seconds(sent(scenario)) == 2.0
    assert plain_words(sent(scenario, {"n": "<speak>A & B"})) == "<speak>A & B"


VALUES = st.one_of(st.text(max_size=20), st.integers(), st.booleans(), st.lists(st.text(max_size=3), max_size=3))


@given(VALUES, VALUES)
def test_no_value_breaks_it(one: Any, two: Any) -> None:
    template = parse_template('<speak a="{one}"><s>{two}</s>{one}</speak>')
    root = parse_ssml(template.fill({"one": one, "two": two}))
    assert root is not None and [element.tag for element in root.walk()] == ["speak", "s"]


@given(st.text(max_size=30))
def test_a_text_can_be_said_as_it_stands(text: str) -> None:
    root = parse_ssml(literal_ssml(text))
    assert root is not None and len(root) == 0
    assert plain_words(literal_ssml(text)).split() == escape_free(text).split()


def escape_free(text: str) -> str:
    """What is left of a text in XML: characters that it cannot hold are marks, line ends are line feeds."""
    return "".join(character if escape_value(character) != "\ufffd" else "\ufffd" for character in text)


PIECES = (
    *("<speak>", "</speak>", "<s>", "</s>", "<break/>", '<break time="1s"/>', '<s x="', "'", '"', ">", "<", "/>", "&"),
    *("{one}", "{two|a}", "{two|", "}", '{"<" one}', '{one "&amp;"}', "{{", "a", " ", "\n", "<!--", "-->", "<?", "?>"),
    *("<![CDATA[", "]]>", "</", "x:", "&#10;", "&nbsp;", "&amp;", "\u00e9", "\U0001f600", "\x01", "\ue000"),
)
MESSAGES = st.lists(st.sampled_from(PIECES), max_size=8).map(lambda pieces: "".join(("<speak>", *pieces, "</speak>")))


@pytest.mark.slow
@given(MESSAGES, VALUES, VALUES)
def test_what_is_accepted_stays_well_formed(message: str, one: Any, two: Any) -> None:
    """Whatever the memory holds, also nothing."""
    try:
        template = parse_template(message)
    except TemplateError:
        return
    if any(problem.is_error for problem in find_ssml_problems(template)):
        return
    for memory in ({"one": one, "two": two}, {"one": one}):
        text = template.fill(memory)
        assert parse_ssml(text) is not None, text


@pytest.mark.slow
@given(MESSAGES)
def test_every_message_is_read_or_refused_with_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, message: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "messages"
    for written in (message, escape(message), f"<![CDATA[{message}]]>"):
        for diagnostic in loaded(path, files(written)).diagnostics:
            assert diagnostic.message and "mistake of this program" not in diagnostic.message


# --- what is heard --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words", "pause"),
    [
        ("Hello <b>you", "Hello <b>you", 0.0),
        ("<speak>Hello <b>you", "<speak>Hello <b>you", 0.0),
        ("<speaker>a</speaker>", "<speaker>a</speaker>", 0.0),
        (TIMED, "Hello you", 0.5),
        ('<speak>Hello<break time="1.5s"/>you<break time=".5s"/>, there<break/>.</speak>', "Hello you, there.", 2.0),
        ("<speak><p><s>One.</s><s>Two.</s></p><p>Three</p></speak>", "One. Two. Three", 0.0),
        ("<speak>un<emphasis>believ</emphasis>able</speak>", "unbelievable", 0.0),
        ('<speak><sub alias="World Wide Web">WWW</sub>, <sub>x</sub></speak>', "World Wide Web, x", 0.0),
        ('<speak>a<audio src="x"><desc>a bell</desc>ding</audio><mark name="m"/>b</speak>', "adingb", 0.0),
        ('<speak><metadata>who</metadata><lexicon uri="x"/>a</speak>', "a", 0.0),
        ("<speak>&lt;b&gt; &amp; c<!-- d --><?e?></speak>", "<b> & c", 0.0),
        ('<speak xmlns="http://www.w3.org/2001/10/synthesis">a<break time="1s"/>b</speak>', "a b", 1.0),
        ('<speak><break time="soon"/><break strength="strong"/><break time="9s9"/></speak>', "", 0.0),
        ("<speak>&undefined;</speak>", "<speak>&undefined;</speak>", 0.0),
        ("<speak>\ud800</speak>", "<speak>\ud800</speak>", 0.0),
    ],
)
def test_what_is_heard(text: str, words: str, pause: float) -> None:
    assert plain_words(text) == words and pause_seconds(text) == pause


def test_no_entity_is_ever_filled_in(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("known to nobody")
    attack = f'<speak><!DOCTYPE speak [<!ENTITY x SYSTEM "{tmp_path}/secret">]>&x;</speak>'
    assert plain_words(attack) == attack and parse_ssml(attack) is None
    bomb = '<!DOCTYPE speak [<!ENTITY a "aaaa">]><speak>&a;</speak>'
    assert plain_words(bomb) == bomb and not begins_as_ssml(bomb)


def test_very_deep_markup_is_a_text() -> None:
    deep = "<speak>" + "<s>" * 5_000 + "</s>" * 5_000 + "</speak>"
    assert plain_words(deep) == deep


def test_how_long_it_takes() -> None:
    speech = builtin_robot().actions["Speech"]
    words = expected_seconds(speech, {"message": "Hello you"})
    assert expected_seconds(speech, {"message": TIMED}) == pytest.approx(words + 0.5)
    assert expected_seconds(core_actions()["Speech"], {"message": TIMED}) == words, "it makes no breaks"
    assert expected_seconds(speech, {"message": '<speak><break time="9e9s"/></speak>'}) == 0.5
    assert expected_seconds(speech, {"message": f'<speak><break time="{"9" * 400}s"/></speak>'}) == 86_400.0


def test_words_are_changed_between_the_tags_only() -> None:
    def change(text: str, language: str) -> str:
        return text.replace("Rise", f"rize{language}")

    ssml = (
        '<speak>Rise <s xml:lang="de">Rise<emphasis level="Rise">Rise</emphasis></s> Rise <sub alias="Rise">Rise</sub>'
        '<say-as interpret-as="characters">Rise</say-as><phoneme ph="Rise">Rise</phoneme>Rise</speak>'
    )
    assert change_words(ssml, change) == (
        '<speak>rize <s xml:lang="de">rizede<emphasis level="Rise">rizede</emphasis></s> rize '
        '<sub alias="Rise">Rise</sub>'
        '<say-as interpret-as="characters">Rise</say-as><phoneme ph="Rise">Rise</phoneme>rize</speak>'
    )
    untouched = "<speak  a='1'>nothing<break></break></speak>"
    assert change_words(untouched, change) == untouched
    assert change_words("<speak>Rise", change) is None and change_words("Rise", change) is None
    assert change_words("<speak>Rise</speak>", lambda text, _: "a<b&c") == "<speak>a&lt;b&amp;c</speak>"


# --- templates ------------------------------------------------------------------------------------------------------

TEMPLATES = """<Dialogs>
<Template name="Ask"><parameter name="what"/><parameter name="pause" default="1s"/>
<Speech><actionID>1</actionID><message>
<speak>Is it <break time="${pause}"/> ${what}?<brake/> {name|you}</speak>
</message></Speech></Template>
<Dialog name="A">
<use template="Ask" what="a &lt;fork> &amp; $me"/>
</Dialog>
</Dialogs>"""


def test_a_template_may_have_it(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"acts/a.xml": TEMPLATES})
    assert result.scenario is not None and found(result) == ["acts/a.xml:7:1 ssml"]
    place = result.diagnostics[0].location.template
    assert place is not None and (place.line, place.column) == (4, 47)
    message = sent(result.scenario, {})
    assert message == '<speak>Is it <break time="1s"/> a &lt;fork&gt; &amp; $me?<brake/> you</speak>'
    assert plain_words(message) == "Is it a <fork> & $me? you"


def test_what_expand_prints_is_the_same_act(tmp_path: Path) -> None:
    folder = tmp_path / "templates"
    before = loaded(folder, {"acts/a.xml": TEMPLATES}).scenario
    printed = typed("expand", folder)
    assert printed.exit_code == 0, printed.output
    text = printed.stdout[printed.stdout.index("<Dialogs>") : printed.stdout.index("</Dialogs>") + len("</Dialogs>")]
    after = loaded(tmp_path / "plain", {"acts/a.xml": text}).scenario
    assert before is not None and after is not None and sent(before, {}) == sent(after, {})


def test_a_parameter_behind_a_tag_is_checked_too(tmp_path: Path) -> None:
    wrong = TEMPLATES.replace("${what}?", "${waht}?")
    codes = [diagnostic.code for diagnostic in loaded(tmp_path, {"acts/a.xml": wrong}).diagnostics]
    assert "unknown-parameter" in codes and "unused-parameter" in codes
