"""Rules as SCXML documents: the same as SCION has run, refused and lost by name, written whole or not at all."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rise_exchange.scxml.export import HELPERS, RESERVED, event_name, export_rule, helpers_for, key_name
from rise_exchange.scxml.limits import LOSSES, REFUSALS, find_losses, find_refusals

from tests.commands import typed
from tests.exchange.scxml.traces import FILE, STUDIES, kept_cases
from tests.kernel.harness import dialog, read, speech, write

SCXML = "{http://www.w3.org/2005/07/scxml}"


# --- beside SCION ---


@pytest.mark.slow
def test_the_kernel_does_what_scion_did_with_these_very_documents() -> None:
    kept = json.loads(FILE.read_text("utf-8"))
    seeds = [int(name.removeprefix("random/")) for name in kept if name.startswith("random/")]
    cases = {case.name: case for case in kept_cases(seeds)}
    assert list(cases) == list(kept)
    assert {name: case.digest for name, case in cases.items()} == {
        name: each["document"] for name, each in kept.items()
    }
    for name, case in cases.items():
        assert case.played.lines == kept[name]["trace"], name


# --- names ---


@given(st.text(min_size=1), st.text(min_size=1))
def test_no_two_topics_have_one_name_and_none_is_part_of_another(one: str, other: str) -> None:
    assert (event_name(one) == event_name(other)) == (one == other)
    assert "." not in event_name(one)
    assert event_name(one) not in RESERVED


@given(st.text(min_size=1))
def test_a_key_comes_back_out_of_the_name_of_its_event(key: str) -> None:
    name = key_name(key)
    assert not re.search(r"\s", name)
    assert re.sub(r"_x([0-9A-F]+)_", lambda found: chr(int(found[1], 16)), name) == key


# --- what a document is made of ---


def study(
    tmp_path: Path, rules: str, *, memory: dict[str, object] | None = None, toml: str = "", acts: str = ""
) -> Path:
    return write(tmp_path, acts=acts or dialog("A", speech(1)), rules=rules, memory=memory, toml=toml)


def rule_of(state: str, name: str = "R") -> str:
    return (
        f'<InteractionRule name="{name}" initial="S"><State id="S">{state}</State><State id="End"/></InteractionRule>'
    )


OUT = '<transition eventTopic="/out" target="End"/>'


def document(folder: Path, name: str = "R") -> ElementTree.Element:
    scenario = read(folder)
    return ElementTree.fromstring(export_rule(scenario, scenario.rules[name]))


def sent(root: ElementTree.Element, function: str) -> list[dict[str, str]]:
    found = root.iterfind(f".//{SCXML}send[@event='{function}']")
    return [{each.attrib["name"]: each.attrib["expr"] for each in send} for send in found]


def test_states_are_flat_and_carry_their_names(tmp_path: Path) -> None:
    root = document(study(tmp_path, rule_of(OUT)))
    assert [(child.tag.removeprefix(SCXML), child.attrib.get("id")) for child in root] == [
        ("state", "s0"),
        ("final", "s1"),
    ]
    assert [child.attrib["{urn:x-rise}name"] for child in root] == ["S", "End"]
    (result,) = root.iterfind(f".//{SCXML}donedata/{SCXML}param")
    assert result.attrib == {"name": "result", "expr": "'/R_End'"}


def test_functions_say_everything_about_a_start_and_an_event(tmp_path: Path) -> None:
    inside = (
        '<onEntry><function startInteractionRule="Other" state="End" enter="no"/>'
        '<function raiseEventTopic="/out" keep="1.5s"/><function raiseEventTopic="/mine"/></onEntry>'
        f'{OUT}<transition eventTopic="/mine"/>'
    )
    root = document(study(tmp_path, rule_of(inside) + rule_of(OUT, "Other")))
    assert sent(root, "startInteractionRule") == [{"behavior": "'Other'", "state": "'End'", "enter": "false"}]
    assert sent(root, "raiseEventTopic") == [
        {"behavior": "'/out'", "keep": "'1.5s'"},
        {"behavior": "'/mine'", "own": "true"},
    ]
    assert [send.attrib for send in root.iterfind(f".//{SCXML}send[@event='mine']")] == [{"event": "mine"}]


def test_texts_with_every_kind_of_character_stay_what_they_are(tmp_path: Path) -> None:
    inside = """<onEntry><function assignValue='k = "It&apos;s &lt;b> &amp; \\"c\\" 𝔘"'/></onEntry>""" + OUT
    (assign,) = document(study(tmp_path, rule_of(inside))).iterfind(f".//{SCXML}onentry/{SCXML}assign")
    assert assign.attrib["expr"] == """changed('k', 'It\\'s <b> & "c" 𝔘')"""


def test_a_document_has_the_helpers_that_it_uses_and_no_others(tmp_path: Path) -> None:
    script = document(study(tmp_path, rule_of(f'<transition cond="k and j" target="End"/>{OUT}'))).find(
        f"{SCXML}script"
    )
    assert script is not None and script.text is not None
    found = set(re.findall(r"function (\w+)\(", script.text))
    assert found == {"key", "has", "inner", "isObject", "truth", "noted", "withName"}
    assert not helpers_for("s0 === 'draw()'.length")
    for name, source in HELPERS.items():
        assert source.startswith(f"function {name}(")


def test_the_same_rule_gives_the_same_bytes(tmp_path: Path) -> None:
    folder = STUDIES / "negation"
    one, other = read(folder), read(folder)
    assert export_rule(one, one.rules["Instructions"]) == export_rule(other, other.rules["Instructions"])


# --- limits ---


REFUSED = {
    "scxml-chance": '<transition cond="rand(1) > 0.5" target="End"/>',
    "scxml-number": '<transition eventTopic="/x" cond="k = 9007199254740993" target="End"/>',
    "scxml-stop": '<onEntry><function stopInteractionRule="R"/></onEntry>',
    "scxml-name": """<onEntry><function assignValue='k = {"__proto__": 1}'/></onEntry>""",
    "scxml-read-only": """<onEntry><function assignValue='session.cue = true'/></onEntry>
        <transition cond="session.speaking"/>""",
}


@pytest.mark.parametrize("code", REFUSED)
def test_what_cannot_be_said_is_refused_where_it_stands(tmp_path: Path, code: str) -> None:
    scenario = read(study(tmp_path, rule_of(REFUSED[code] + OUT), memory={"k": 1}))
    if code == "scxml-read-only":  # such a scenario has a key of its own, unless it comes from elsewhere
        import msgspec

        scenario = msgspec.structs.replace(scenario, reads_session=True)
    (found,) = find_refusals(scenario, scenario.rules["R"]).sorted()
    assert (found.severity, found.code, found.location.file) == ("error", code, "rules/all.xml")
    assert found.message.endswith(REFUSALS[code])


def test_every_refusal_has_a_case() -> None:
    assert REFUSED.keys() == REFUSALS.keys()


LOST = {
    "routing": (OUT, rule_of(OUT, "Other"), ""),
    "kept": (OUT, "", '[keys]\nk = { event = "/out", keep = "2s" }'),
    "memory-meanwhile": (
        f'<onEntry><function startInteractionRule="Other"/></onEntry>{OUT}<transition cond="k"/>',
        rule_of('<onEntry><function assignValue="k = 1"/></onEntry><transition eventTopic="/y"/>', "Other"),
        "",
    ),
    "chance": (
        f'<onEntry><oneOf><function raiseEventTopic="/y"/></oneOf></onEntry>{OUT}',
        rule_of('<onEntry><function assignValue="j = rand(1)"/></onEntry><transition eventTopic="/y"/>', "Other"),
        "",
    ),
    "digits": (f'<transition eventTopic="/x" cond="sin(k) > 0.5"/>{OUT}', "", ""),
    "letters": (f'<transition eventTopic="/x" cond="lower(k) = \'a\'"/>{OUT}', "", ""),
    "size": (f'<onEntry><function assignValue="k = range(3)"/></onEntry>{OUT}', "", ""),
    "fractions": (f'<transition after="1.5ms" target="End"/>{OUT}', "", ""),
    "circle": (
        f'<onEntry><function raiseEventTopic="/x"/></onEntry><transition eventTopic="/x" target="S"/>{OUT}',
        "",
        "",
    ),
    "beginning": (OUT, "", '[keys]\nk = { rule = "R", state = "End" }'),
    "stopped": (
        f'<onEntry><function startInteractionRule="Other"/></onEntry>{OUT}',
        rule_of('<onEntry><function stopInteractionRule="R"/></onEntry><transition eventTopic="/y"/>', "Other"),
        "",
    ),
}


@pytest.mark.parametrize("code", LOST)
def test_what_is_lost_has_a_name(tmp_path: Path, code: str) -> None:
    state, others, toml = LOST[code]
    scenario = read(study(tmp_path, rule_of(state) + others, toml=toml, memory={"k": 1}))
    (loss,) = find_losses(scenario, scenario.rules["R"])
    assert (loss.code, loss.location.file) == (code, "rules/all.xml")
    assert f"- {code}: " in export_rule(scenario, scenario.rules["R"]).split("<scxml")[0]


def test_every_loss_has_a_case_and_nothing_is_lost_of_a_plain_rule(tmp_path: Path) -> None:
    assert LOST.keys() == LOSSES.keys()
    plain = '<onEntry><function startCommunicationRobotAct="A"/></onEntry><transition after="2s" target="End"/>'
    scenario = read(study(tmp_path, rule_of(plain)))
    assert find_losses(scenario, scenario.rules["R"]) == []


# --- the command ---


def convert(*arguments: str) -> tuple[int, str, str]:
    done = typed("convert", "to-scxml", *arguments)
    return done.exit_code, done.stdout, done.stderr


def test_a_study_becomes_a_folder_of_documents(tmp_path: Path) -> None:
    folder = study(tmp_path / "study", rule_of(OUT, "A/b") + rule_of(OUT, "a_b"))
    target = tmp_path / "out"
    status, said, lost = convert(str(folder), "-o", str(target))
    assert (status, said) == (0, f"{target}: 2 documents\n")
    assert lost.count("loss routing") == 2
    assert sorted(path.name for path in target.iterdir()) == ["A_b.scxml", "a_b 2.scxml"]
    status, text, _ = convert(str(folder), "--rule", "a_b")
    assert (status, text) == (0, (target / "a_b 2.scxml").read_text("utf-8"))


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        ((), 2, "these are 2 rules; name a folder with -o, or one of them with --rule"),
        (("-o", "one.scxml"), 2, "these are 2 rules"),
        (("--rule", "Goood"), 2, "there is no rule `Goood`; did you mean `Good`?"),
        (("--rule", "Good", "-o", "memory.json"), 2, "memory.json is not a folder"),
        (("-o", "out"), 1, "nothing was written: 1 error"),
        (("--rule", "Good", "-o", "out", "--strict"), 1, "nothing was written, because of --strict: 1 loss"),
        (("--rule", "Good", "-o", "memory.json/x.scxml"), 74, "cannot be written"),
    ],
)
def test_nothing_is_written_when_it_cannot_all_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], status: int, said: str
) -> None:
    monkeypatch.chdir(study(tmp_path, rule_of(OUT + REFUSED["scxml-stop"], "R") + rule_of(OUT, "Good")))
    before = sorted(tmp_path.rglob("*"))
    code, out, error = convert(".", *arguments)
    assert (code, out) == (status, "")
    assert said in error
    assert sorted(tmp_path.rglob("*")) == before
