"""`[explore]`, `[always]`, `[reachable]` and `[eventually]` in scenario.toml."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.expression import Expression
from rise_engine.kernel import Kernel
from rise_engine.kernel.scenario_change import carry_over, changes_in_words, why_not_take_over
from rise_engine.scenario.explore_settings import ExploreSettings
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from tests.scenario.folders import SPEECH, act, found, loaded, rule

MAIN = rule(
    '<State id="S"><transition eventTopic="/go" cond="near" target="T"/></State>'
    '<State id="T"><onEntry><function startCommunicationRobotAct="A"/></onEntry></State>'
)
FILES: dict[str, str | bytes] = {
    "acts/a.xml": act(SPEECH),
    "rules/r.xml": MAIN,
    "memory.json": '{"near": false, "task": 1}',
    "tables/items.csv": "text\na\n",
}
KEYS = '[keys]\ng = { event = "/go" }\nr = { rule = "R" }\nn = { set = "near = items[0].text = \'a\'" }\n'


def study(path: Path, toml: str) -> Scenario:
    result = loaded(path, {**FILES, "scenario.toml": KEYS + toml})
    assert result.scenario is not None, result.diagnostics
    assert not result.diagnostics
    return result.scenario


def messages(path: Path, toml: str) -> list[str]:
    """Findings about these lines: line within them, column, code and sentence."""
    lines = KEYS.count("\n")
    result = loaded(path, {**FILES, "scenario.toml": KEYS + toml})
    return [
        f"{each.location.line - lines}:{each.location.column} {each.severity} {each.code}: {each.message}"
        for each in result.diagnostics
    ]


def test_without_the_tables_everything_is_as_usual(tmp_path: Path) -> None:
    scenario = study(tmp_path, "")
    assert scenario.explore == ExploreSettings() and scenario.properties == ()


def test_all_that_can_be_said(tmp_path: Path) -> None:
    scenario = study(
        tmp_path,
        """
[explore]
end = " R "
faults = 2
line = 0
beside = 5
pace = [1, 2.5]
keys = "all"
tries = { task = [2.5, "two", [1], { a = 1 }], near = [true] }

[eventually]
"it is said" = { after = "in('R', 'T')", then = "runs('A')", unless = "not rule('R')" }
[always]
near = "near or not waits('A')"
[eventually.sooner]
then = "task > 1"
[reachable]
"the end" = "not rule('R')"
""",
    )
    assert scenario.explore == ExploreSettings(
        end="R",
        faults=2,
        line=0,
        beside=5,
        pace=(1.0, 2.5),
        tries={"task": (2.5, "two", [1], {"a": 1}), "near": (True,)},
        keys="all",
    )
    texts = [
        (each.kind, each.name, each.condition.text, each.after and each.after.text, each.unless and each.unless.text)
        for each in scenario.properties
    ]
    assert texts == [
        ("eventually", "it is said", "runs('A')", "in('R', 'T')", "not rule('R')"),
        ("always", "near", "near or not waits('A')", None, None),
        ("eventually", "sooner", "task > 1", None, None),
        ("reachable", "the end", "not rule('R')", None, None),
    ]
    assert all(each.location.file == "scenario.toml" for each in scenario.properties)
    assert decode_scenario(encode_scenario(scenario)) == scenario
    assert study(tmp_path, '[explore]\npace = "any"').explore.pace is None


@pytest.mark.parametrize(
    ("line", "finding"),
    [
        ('end = "Q"', "2:8 error unknown-rule: there is no rule `Q`"),
        ('end = " "', "2:7 error missing-value: `end` is empty"),
        ("end = 3", "2:7 error wrong-type: `end` is a text"),
        ("fault = 1", "2:1 error unknown-key: unknown key `fault`; did you mean `faults`?"),
        ("faults = -1", "2:10 error out-of-range: `faults` is from 0 to 5; this is -1"),
        ("line = 6", "2:8 error out-of-range: `line` is from 0 to 5"),
        ("beside = 1.5", "2:10 error wrong-type: `beside` is a whole number: beside = 2"),
        ("faults = true", "2:10 error wrong-type: `faults` is a whole number"),
        ("pace = [2, 0.5]", "2:8 error out-of-range: the first number of `pace` is the smaller one: pace = [0.5, 2]"),
        ("pace = [0, 1]", "2:8 error out-of-range: the numbers of `pace` are more than 0"),
        ("pace = [1, 1e300]", "2:8 error out-of-range: the numbers of `pace` are more than 0 and at most 1000"),
        ("pace = [1]", "2:8 error wrong-type: `pace` is the least and greatest duration of acts"),
        ("pace = [true, 2]", "2:8 error wrong-type: `pace` is the least"),
        (
            'pace = "all"',
            "2:8 error wrong-type: `pace` is the least and greatest duration of acts, as multiples of the "
            'expected one: pace = [0.5, 3.0], or pace = "any"',
        ),
        ('keys = "hand"', '2:8 error wrong-value: `keys` is "rules", or "all"'),
        ("keys = ['all']", '2:8 error wrong-value: `keys` is "rules", or "all"'),
        ("tries = 3", "2:1 error wrong-type: `tries` lists the values that somebody may give a memory key"),
        (
            "tries = { tas = [3] }",
            "2:11 error unknown-memory-key: nothing in this scenario sets or reads the memory key "
            "`tas`; did you mean `task`?",
        ),
        ("tries = { items = [3] }", "2:11 error read-only: `items` is a table"),
        ("tries = { task = 3 }", "2:18 error wrong-type: `task` has a list of values here: task = [VALUE, VALUE]"),
        ("tries = { task = [] }", "2:18 error missing-value: no value is tried for `task`"),
        ('tries = { "task.x" = [1] }', "2:11 error unknown-memory-key: `tries` names whole memory keys: `task`, not"),
    ],
)
def test_what_is_wrong_in_explore(tmp_path: Path, line: str, finding: str) -> None:
    (only,) = messages(tmp_path, f"[explore]\n{line}\n")
    assert only.startswith(finding)


@pytest.mark.parametrize(
    ("toml", "finding"),
    [
        ("[always]\nx = \"runs('B')\"", "2:12 error unknown-act: there is no act `B`"),
        ("[always]\nx = \"waits('R')\"", "2:13 error unknown-act: there is no act `R`; it is the name of a rule"),
        ("[always]\nx = 'rule(\"Q\")'", "2:12 error unknown-rule: there is no rule `Q`"),
        ("[always]\nx = \"in('R', 'U')\"", "2:15 error unknown-state: the rule `R` has no state `U`"),
        ('[always]\nx = "in(\\"R\\", \\"U\\")"', "2:18 error unknown-state: the rule `R` has no state `U`"),
        (
            '[always]\nx = "not nearr"',
            "2:10 warning unset-key: nothing in this scenario sets the memory key `nearr`; did you mean `near`?",
        ),
        ('[always]\nx = "near > "', "2:13 error condition: something is missing after `>`"),
        (
            '[always]\nx = """\nnear\n and\n run(\'A\')"""',
            "5:2 error condition: there is no function `run`; did you mean `runs`?",
        ),
        ('[always]\nx = "in(R, S)"', "2:9 error condition: `in` takes names in quotation marks; write `'R'`"),
        ('[always]\nx = "rand(2) > 1"', "2:5 error condition: a property cannot depend on chance"),
        ("[always]\nx = true", "2:5 error wrong-type: `x` is a condition, in quotation marks"),
        ('[always]\nx = { then = "near" }', "2:5 error wrong-type: `x` is a condition, in quotation marks"),
        ('[always]\n" x" = "near"', "2:1 error bad-name: the name of a property"),
        (
            '[always]\nx = "near"\n[reachable]\nx = "near"',
            "4:1 error duplicate-name: there is another property `x` in [always]",
        ),
        ('[eventually]\nx = "near"', "2:1 error wrong-type: `then` says what happens without help"),
        ('[eventually]\nx = { after = "near" }', "2:1 error missing-value: `x` does not say what happens without help"),
        (
            '[eventually]\nx = { then = "near", afer = "near" }',
            "2:22 error unknown-key: unknown key `afer`; did you mean `after`?",
        ),
        (
            "[eventually]\nx = { then = \"near\", unless = \"in('R', 'U')\" }",
            "2:41 error unknown-state: the rule `R` has ",
        ),
        ("[eventually]\nx = { then = 3 }", "2:14 error wrong-type: `then` is a condition"),
        ("[always]\nx = \"items[3].text = 'a'\"", "2:6 error unknown-path: the table `items` has one row, 0"),
        ('[alway]\nx = "near"', "1:2 error unknown-key: unknown key `alway`; did you mean `always`?"),
    ],
)
def test_what_is_wrong_with_a_property(tmp_path: Path, toml: str, finding: str) -> None:
    (only,) = messages(tmp_path, toml)
    assert only.startswith(finding)


def test_all_findings_at_once(tmp_path: Path) -> None:
    toml = "[explore]\nend = 'Q'\nfaults = 9\n[always]\nx = \"runs('B') and in('R', 'U') or rule('Q')\"\ny = ''"
    codes = [each.split(":")[1].split(" ")[-1] for each in messages(tmp_path, toml)]
    assert codes == ["unknown-rule", "out-of-range", "unknown-act", "unknown-state", "unknown-rule", "condition"]


def test_conditions_elsewhere_cannot_ask(tmp_path: Path) -> None:
    asking = MAIN.replace('cond="near"', "cond=\"near and rule('R')\"")
    result = loaded(tmp_path, {**FILES, "rules/r.xml": asking, "scenario.toml": KEYS})
    assert found(result) == ["rules/r.xml:2:59 condition"]
    assert "[always], [reachable] and [eventually] in scenario.toml" in result.diagnostics[0].message
    result = loaded(tmp_path, {**FILES, "scenario.toml": "[keys]\nn = { set = \"near = runs('A')\" }"})
    assert "scenario.toml:2:21 assignment" in found(result)


def test_a_property_is_no_reason_why_a_state_is_reached_or_a_condition_has_an_effect(tmp_path: Path) -> None:
    """What only a property asks for does not come about because of it."""
    lonely = MAIN.replace("</InteractionRule>", '<State id="U"/></InteractionRule>')
    toml = KEYS + "[conditions.A]\nmemory = { task = 2 }\n[always]\nx = \"not in('R', 'U') or task > 1\""
    result = loaded(tmp_path, {**FILES, "rules/r.xml": lonely, "scenario.toml": toml})
    assert sorted(each.code for each in result.diagnostics) == ["condition-unread", "unreachable-state"]


def test_a_property_may_read_tables_and_the_session(tmp_path: Path) -> None:
    toml = (
        "[keys]\nr = { rule = 'R' }\ng = { event = '/go' }\n[always]\nx = \"session.speaking or items[0].text = 'a'\""
    )
    result = loaded(tmp_path, {**FILES, "scenario.toml": toml})
    assert result.diagnostics == [] and result.scenario is not None
    assert result.scenario.reads_session


def test_a_running_session_takes_over_other_properties(tmp_path: Path) -> None:
    before = study(tmp_path, "")
    after = study(tmp_path, "[explore]\nfaults = 3\n[always]\nx = \"in('R', 'S') or session.speaking\"")
    assert before.hash != after.hash
    kernel = Kernel(before, seed=1)
    snapshot = kernel.snapshot()
    assert why_not_take_over(before, after, snapshot, is_busy=False) == []
    assert carry_over(before, after, snapshot).scenario == after.hash
    assert changes_in_words(before, after) == ("nothing that has an effect",)


def test_the_condition_of_a_property_is_one_of_its_own(tmp_path: Path) -> None:
    """It is equal by its text, and decoding does not lose what only a property can say."""
    scenario = study(tmp_path, "[always]\nx = \"runs('A')\"")
    (only,) = scenario.properties
    assert only.condition == Expression.parse_property("runs('A')")
    changed = replace(scenario, properties=())
    assert changed != scenario and decode_scenario(encode_scenario(changed)) == changed
