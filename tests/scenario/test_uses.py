"""Who names what, and exactly where."""

from __future__ import annotations

from html import unescape
from itertools import chain
from pathlib import Path

import pytest

from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.checking.uses import Use, UsedKind
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.loader import LoadResult, load
from tests.scenario.test_held_files import SCENARIOS, STUDIES, content

KINDS: tuple[UsedKind, ...] = ("act", "rule", "state", "event", "key", "action")


def all_uses(result: LoadResult) -> list[Use]:
    return [use for kind in KINDS for name in result.uses.names(kind) for use in result.uses.of(kind, name)]


def written(use: Use, files: dict[str, bytes]) -> str:
    """What stands where a use says that its name stands."""
    data = files[use.place.file]
    source = SourceFile(use.place.file, data, data.decode("utf-8-sig"))
    start = source.byte_offset(use.place.line, use.place.column)
    end = source.byte_offset(use.place.line, use.place.column + use.length)
    return unescape(data[start:end].decode())


def shown(use: Use) -> str:
    """The name as it is written: of `RULE/STATE`, the state alone."""
    return use.name.partition("/")[2] if use.kind in ("state", "action") else use.name


@pytest.mark.parametrize("name", STUDIES)
def test_each_use_of_a_study_is_where_it_says(name: str) -> None:
    result, files = load(SCENARIOS / name), content(SCENARIOS / name)
    uses = all_uses(result)
    assert len(uses) > 100
    for use in uses:
        if use.length:
            assert written(use, files) == shown(use), use
            found = result.uses.at(use.place.file, use.place.line, use.place.column)
            assert found is not None and found.place == use.place
        else:  # put together by a template
            assert use.location.template, use


@pytest.mark.parametrize("name", STUDIES)
def test_nothing_that_the_checks_know_is_missing(name: str) -> None:
    result = load(SCENARIOS / name)
    draft, uses = result.draft, result.uses
    assert set(uses.names("act")) == {*draft.acts, *(each.name for each in draft.act_mentions)}
    assert set(uses.names("rule")) == {*draft.rules, *(each.name for each in draft.rule_mentions)}
    assert set(uses.names("state")) == {
        f"{rule.name}/{state}" for rule in draft.rules.values() for state in rule.states
    }
    assert set(uses.names("event")) == {each.name for each in (*draft.awaited_topics, *draft.raised_topics)}
    assert set(uses.names("action")) == {
        f"{act.name}/{action.id}" for act in draft.acts.values() for action in act.actions
    }
    mentions = (draft.key_reads, draft.optional_key_reads, draft.key_writes, draft.part_writes, draft.bare_keys)
    others = (draft.condition_values, draft.private_keys, draft.property_reads, draft.tried_keys)
    keys = {each.name for each in chain(*mentions, *others)}
    own = {key for key in keys | set(draft.memory) if key.partition(".")[0] not in {*draft.tables, "session"}}
    assert set(uses.names("key")) == own


FILES = {
    "acts/a.xml": (
        '\ufeff<Dialogs><Dialog name=" R_A&amp;B ">\r\n<Speech><actionID> 1 </actionID>'
        "<message>Hi <!-- {no} -->{who.name}, {{no}} <![CDATA[{n}]]> {items[i].text|{}</message></Speech>\r"
        "<Wait><actionID>2</actionID><waitForActions>1, x</waitForActions><duration>pause</duration></Wait>\r"
        "<Variants><actionID>x</actionID>"
        "<Speech><message><speak>ä {n} <!-- {no} --></speak></message></Speech></Variants>"
        "</Dialog></Dialogs>"
    ),
    "rules/r.xml": (
        "<InteractionRules><InteractionRule name='R' initial='S &lt; T'>\n"
        '<transitions in="S &lt; T |U">'
        '<transition eventTopic=" /go_end" target="U" cond="n&gt;1 and n &lt; pause"/></transitions>\n'
        '<State id="S &lt; T"><onEntry><if cond="defined(who.name)"><function startCommunicationRobotAct="R_A&amp;B"/>'
        "<else><function assignValue=\"items[n].text = who.name + 'n'\"/></else></if>"
        "<oneOf><function assignValue='{&quot;n&quot;: 2}'/><function assignValue='n = loud'/></oneOf>"
        '<function startInteractionRule="R" state="U"/></onEntry></State>\n'
        '<State id="U"><onExit><function raiseEventTopic="/go"/><function assignValue="n = pause"/></onExit>'
        '<transition ended="R_A&amp;B" after="{pause}ms" target="S &lt; T"/></State>\n'
        "</InteractionRule></InteractionRules>"
    ),
    "scenario.toml": (
        'private = ["who", \'n\']\n[keys]\n"1" = { act = "R_A\\u0026B", label = "x" }\n'
        '2 = { rule = \'R\', state = \' U\' }\n3 = { event = """\n/go""" }\n4 = { set = "n = \\"x\\" + pause" }\n'
        '[act."R_A&B"]\nfiller = true\n[act."R_*"]\nhold = false\n[conditions.A]\nmemory = { n = 1 }\n'
        '[[check.allow]]\ncode = "unset-key"\nkey = "n"\nreason = "x"\n'
    ),
    "memory.json": '{"WorkingMemory": [{"n": 1}, {"pa\\u0075se": 2},\n{"who": {"name": "x"}, "items": []}]}',
}
EXPECTED = """\
act R_A&B: acts/a.xml:1:25+9! act R_A&B | rules/r.xml:3:98+9 rule R, state S < T, on entry | \
rules/r.xml:4:119+9 rule R, state U, transition 1 | scenario.toml:3:16+10 key 1 | \
scenario.toml:8:7+5 settings of the act R_A&B
action R_A&B/1: acts/a.xml:2:20+1! act R_A&B | acts/a.xml:2:174+1 act R_A&B, action 2
action R_A&B/2: acts/a.xml:2:146+1! act R_A&B
action R_A&B/x: acts/a.xml:2:249+1! act R_A&B | acts/a.xml:2:177+1 act R_A&B, action 2
event go: rules/r.xml:4:51+2 rule R, state U, on exit | scenario.toml:6:2+2 key 3
event go_end: rules/r.xml:2:57+6 rule R, transitions of several states, transition 1
"""


def listed(result: LoadResult, kinds: tuple[UsedKind, ...]) -> str:
    def line(kind: UsedKind, name: str) -> str:
        uses = result.uses.of(kind, name)
        places = (f"{use.place}+{use.length}{'!' * use.defines} {use.where}" for use in uses)
        return f"{kind} {name}: {' | '.join(places)}\n"

    return "".join(line(kind, name) for kind in kinds for name in result.uses.names(kind))


def test_uses_in_all_ways_of_writing() -> None:
    files = {name: text.encode() for name, text in FILES.items()}
    result = load("/nowhere", held=files)
    for use in all_uses(result):
        if use.place.file.endswith(".xml"):
            assert written(use, files) == shown(use), use
    assert listed(result, ("act", "action", "event")) == EXPECTED
    keys = {name: [str(use.place) for use in result.uses.of("key", name)] for name in result.uses.names("key")}
    assert sorted(keys) == ["i", "items", "n", "pause", "who", "who.name"]
    assert [name.partition(":")[0] for name in keys["n"]] == [
        *("memory.json", "acts/a.xml", "acts/a.xml"),
        *("rules/r.xml",) * 6,
        *("scenario.toml",) * 4,
    ]
    assert [(use.where, use.may_be_text, use.length) for use in result.uses.of("key", "pause")] == [
        ("start value", False, 10),
        ("act R_A&B, action 2: duration", False, 5),
        ("rule R, transitions of several states, transition 1", False, 5),
        ("rule R, state U, on exit", True, 5),
        ("rule R, state U, transition 1", False, 5),
        ("key 4", False, 5),
    ]
    states = {name: len(result.uses.of("state", name)) for name in result.uses.names("state")}
    assert states == {"R/S < T": 4, "R/U": 5}
    assert [use.of for use in result.uses.of("state", "R/U")] == ["R", "R", "R", "R", ""]


def test_uses_in_what_exploring_looks_at() -> None:
    toml = (
        "[explore]\nend = ' R'\ntries = { n = [1], \"who\" = [2] }\n"
        '[always]\n"a b" = """\nin(\\"R\\", \'U\') and\n n > 1"""\n'
        '[reachable]\nx = \'not runs("R_A&B") or rule("R")\'\nbroken = "runs(\'R_A&B\'"\n'
        '[eventually]\ny = { after = "n = 2", then = "waits(\'R_A&B\')" }\n'
    )
    files = {**FILES, "scenario.toml": toml}
    result = load("/nowhere", held={name: text.encode() for name, text in files.items()})
    lines = toml.split("\n")
    found = [
        (str(use.place).partition(":")[2], use.kind, use.name, use.where)
        for use in all_uses(result)
        if use.place.file == "scenario.toml"
        and lines[use.place.line - 1][use.place.column - 1 :].startswith(shown(use)[: use.length])
    ]
    assert set(found) == {
        ("9:16", "act", "R_A&B", "property x"),
        ("9:33", "rule", "R", "property x"),
        ("12:16", "key", "n", "property y"),
        ("12:39", "act", "R_A&B", "property y"),
        ("2:9", "rule", "R", "end of exploring"),
        ("3:11", "key", "n", "tried when exploring"),
        ("3:21", "key", "who", "tried when exploring"),
        ("6:6", "rule", "R", "property a b"),
        ("6:12", "state", "R/U", "property a b"),
        ("7:2", "key", "n", "property a b"),
    }


def test_what_belongs_to_tables_and_to_the_engine_is_no_key_of_the_study() -> None:
    held = {
        "rules/r.xml": b'<InteractionRule name="R" initial="S"><State id="S"><transition target="S" '
        b'cond="items[n].text = session.participant and items.0.text != x"/></State></InteractionRule>',
        "tables/items.csv": b"text\na\n",
        "memory.json": b'{"n": 1, "x": 2}',
    }
    assert load("/nowhere", held=held).uses.names("key") == ["n", "x"]


def test_names_that_templates_give() -> None:
    acts = (
        '<Dialogs><Template name="Act"><parameter name="name"/><parameter name="id" default="7"/>'
        '<Dialog name="R_${name}"><Wait><actionID>${id}</actionID><duration>{${name}}</duration></Wait>'
        "<Wait><actionID>own</actionID><waitForActions>${id}</waitForActions></Wait></Dialog></Template>\n"
        '<use template="Act" name="x"/>\n<use template="Act" name="y" id="z"/></Dialogs>'
    )
    files = {"acts/a.xml": acts.encode(), "memory.json": b'{"x": 1}'}
    uses = load("/nowhere", held=files).uses
    (put_together,) = uses.of("act", "R_x")
    assert put_together.length == 0 and str(put_together.location) == "acts/a.xml:2:1"
    _, key = uses.of("key", "x")
    assert not key.in_template and written(key, files) == "x" and key.place.line == 2
    own = uses.of("action", "R_y/own")[0]
    assert own.in_template and written(own, files) == "own" and (own.location.line, own.place.line) == (3, 1)
    assert [written(use, files) for use in uses.of("action", "R_y/z")] == ["z", "z"]
    assert [use.length for use in uses.of("action", "R_x/7")] == [0, 0]


def test_uses_follow_the_edits_of_any_file(tmp_path: Path) -> None:
    files = content(SCENARIOS / "greeting")
    checker = ScenarioChecker(tmp_path)
    assert checker.check(files).uses.of("act", "R_New") == []
    files["acts/greeting.xml"] = files["acts/greeting.xml"].replace(b"R_Greeting", b"R_New")
    after = checker.check(files)
    assert [use.location.file for use in after.uses.of("act", "R_New")] == ["acts/greeting.xml"]
    assert "acts/greeting.xml" not in {use.location.file for use in after.uses.of("act", "R_Greeting")}
    assert all_uses(after) == all_uses(load(tmp_path, held=files))


def test_files_that_cannot_be_read_take_the_others_nothing() -> None:
    held = {"acts/a.xml": b"<Dialogs>", "memory.json": b"{", "rules/r.xml": FILES["rules/r.xml"].encode()}
    uses = load("/nowhere", held=held).uses
    assert uses.names("act") == ["R_A&B"] and uses.names("rule") == ["R"] and uses.names("action") == []
