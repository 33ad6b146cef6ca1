"""The door: what `load` takes and gives, and that nothing an author writes makes it raise."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.chance import examples
from tests.scenario.folders import LISTINGS, SPEECH, act, folder, in_state, loaded, rule

TOML = """title = "T"
mode = "real"
[keys]
"1" = { act = "A" }
"." = { event = "/e" }
u = { set = "k = true" }
[act.A]
hold = true
debounce = 2
calling_type = "None"
[study]
participants = 3
"""
FILES: dict[str, str | bytes] = {
    "scenario.toml": TOML,
    "acts/a.xml": act(SPEECH),
    "rules/r.xml": rule('<State id="S"><transition eventTopic="/e" cond="k and start" target="S"/></State>'),
    "memory.json": '{"start": {"x": [1]}}',
}


def test_a_whole_scenario(tmp_path: Path) -> None:
    scenario, diagnostics = loaded(tmp_path, FILES)
    assert diagnostics == []
    assert isinstance(scenario, Scenario)
    assert (scenario.title, scenario.mode, scenario.robot.name) == ("T", "real", "generic")
    assert scenario.folder == str(tmp_path)
    assert {key: (b.label, b.function, b.behavior) for key, b in scenario.keys.items()} == {
        "1": ("1", "startCommunicationRobotAct", "A"),
        "full_stop": (".", "raiseEventTopic", "/e"),
        "u": ("u", "assignValue", "k = true"),
    }
    settings_ = scenario.settings_of("A")
    assert (settings_.hold, settings_.debounce, settings_.calling_type) == (True, 2.0, "None")
    assert scenario.study == {"participants": 3}
    assert scenario.known_keys == {"start", "k"}
    assert scenario.topics == {"e"}
    assert scenario.memory == {"start": {"x": [1]}}
    assert type(scenario.memory["start"]) is dict and type(scenario.memory["start"]["x"]) is list
    assert scenario.paths == {"acts": "acts", "rules": "rules", "memory": "memory.json"}


def test_an_empty_folder_is_a_scenario(tmp_path: Path) -> None:
    scenario, diagnostics = load(tmp_path)
    assert diagnostics == [] and scenario.title == tmp_path.name and scenario.mode == "debug"


def test_the_path_of_scenario_toml(tmp_path: Path) -> None:
    folder(tmp_path, FILES)
    first = load(tmp_path)
    for again in (load(tmp_path / "scenario.toml"), load(str(tmp_path))):
        assert (again.scenario, again.diagnostics, again.files) == (first.scenario, first.diagnostics, first.files)


def test_arguments_take_precedence(tmp_path: Path) -> None:
    folder(tmp_path, {**FILES, "other/b.xml": act(SPEECH, "B") + "", "wm.json": '{"z": 1, "start": 0}'})
    folder(tmp_path, {"robots/r.toml": "[actions.Speech]"})
    scenario, diagnostics = load(tmp_path, robot="r", mode="debug", paths={"memory": "wm.json"})
    assert diagnostics == [] and (scenario.robot.name, scenario.mode) == ("r", "debug")
    assert scenario.memory == {"z": 1, "start": 0}
    assert [f.code for f in load(tmp_path, paths={"acts": "nowhere"}).diagnostics] == ["unreadable"]
    assert [f.code for f in load(tmp_path, mode="fast").diagnostics] == ["wrong-value"]


def test_a_place_may_be_one_file(tmp_path: Path) -> None:
    scenario, _ = loaded(tmp_path, {"scenario.toml": 'acts = "all.xml"', "all.xml": act(SPEECH, "Z")})
    assert list(scenario.acts) == ["Z"]


def test_the_hash_is_that_of_the_content(tmp_path: Path) -> None:
    first = loaded(tmp_path / "a", FILES).scenario
    again = loaded(tmp_path / "b", FILES).scenario
    other = loaded(tmp_path / "c", {**FILES, "memory.json": '{"start": 1}'}).scenario
    assert first.hash == again.hash != other.hash
    assert len(first.hash) == 64


def test_findings_are_json(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": in_state("<x/>")})
    assert msgspec.json.decode(msgspec.json.encode(result.diagnostics)) == [
        {
            "severity": "error",
            "code": "unknown-element",
            "message": result.diagnostics[0].message,
            "location": {"file": "rules/r.xml", "line": 3, "column": 10},
            "end": {"file": "rules/r.xml", "line": 3, "column": 12},
        }
    ]


def test_windows_line_ends(tmp_path: Path) -> None:
    text = in_state('<if\n cond="a\n &lt; &gt;"/>').replace("\n", "\r\n")
    result = loaded(tmp_path, {"rules/r.xml": text})
    assert [str(f.location) for f in result.diagnostics if f.code == "condition"] == ["rules/r.xml:5:7"]


SEEDS = {
    "scenario.toml": TOML.encode(),
    "acts/a.xml": (LISTINGS / "listing1.xml").read_bytes(),
    "rules/r.xml": (LISTINGS / "listing2.xml").read_bytes(),
    "memory.json": (LISTINGS / "listing3.json").read_bytes(),
    "robots/generic.toml": b"[actions.Speech]\n[actions.X]\nparameters.p = { type = 'name', names = ['a'] }\n",
}
PIECES = st.one_of(
    st.binary(max_size=6),
    st.sampled_from([b"<", b"&", b">", b'"', b"'", b"{", b"}", b"\n", b"<!--", b"-->", b"<![CDATA[", b"]]>", b"&lt;"]),
    st.sampled_from(
        [b"</if>", b"<else>", b"<function/>", b'cond="', b"=", b"[", b"]", b"[[x]]", b"NaN", b"\\", b"\xff"]
    ),
)


@pytest.mark.slow
@given(name=st.sampled_from(sorted(SEEDS)), data=st.data())
@settings(max_examples=examples(300))
def test_mutated_files_never_raise(name: str, data: st.DataObject) -> None:
    content = SEEDS[name]
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        cut = data.draw(st.integers(0, 12))
        content = content[:at] + data.draw(PIECES) + content[at + cut :]
    check({**SEEDS, name: content})


@pytest.mark.slow
@given(name=st.sampled_from(sorted(SEEDS)), content=st.one_of(st.binary(max_size=80), st.text(max_size=80)))
@settings(max_examples=examples(150))
def test_random_files_never_raise(name: str, content: str | bytes) -> None:
    check({name: content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content})


def check(files: dict[str, bytes]) -> None:
    with TemporaryDirectory() as path:
        result = load(folder(Path(path), dict(files)))
    assert (result.scenario is None) == any(f.severity == "error" for f in result.diagnostics)
    for diagnostic in result.diagnostics:
        assert diagnostic.message and "\n" not in diagnostic.code
        assert diagnostic.location.line >= 1 and diagnostic.location.column >= 1
