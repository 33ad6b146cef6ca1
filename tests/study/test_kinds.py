"""Every kind of session is explored and played before a plan is made: what is wrong in one condition and language."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine.author.explore.situation_graph import FindingLevel
from rise_engine.checks import kinds
from rise_engine.checks.kinds import KindFinding, MergedFinding, StudyExploration, merge
from rise_engine.cli.study.planning import exploration_lines
from rise_engine.study.model import PlannedRun
from rise_engine.study.participants import SessionKind, session_kinds
from rise_engine.study.study_log import read_log
from rise_engine.study.study_toml import load_study
from tests.commands import typed

STUDY = Path(__file__).parent / "kinds"
IN_ENGLISH = "(in 2 of 8 kinds of session: direct+forward (en), direct+back (en))"
FAILS = "scenario/acts/ask.xml:3:3: problem play-failed: R_Ask failed at action 1 when it was played: "


def changed(file: Path, *changes: tuple[str, str]) -> None:
    text = file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file.write_text(text)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(STUDY, tmp_path / "study"))


@pytest.fixture
def right(folder: Path) -> Path:
    """The same study with the column that was missing."""
    changed(folder / "study.toml", ('"direct_en"', '"polite_en"'))
    return folder


def test_the_kinds_are_all_conditions_in_all_languages(folder: Path) -> None:
    study = load_study(folder)
    assert study.study is not None
    found = session_kinds(study.study, (), study.scenarios)
    assert [kind.name for kind in found] == [
        f"{condition} ({language})"
        for condition in ("polite+forward", "polite+back", "direct+forward", "direct+back")
        for language in ("de", "en")
    ]
    assert found[-1].first_input(study.study).memory["english"] == "direct_en"


def test_what_fails_in_one_condition_and_language_only_is_found(folder: Path) -> None:
    result = typed("study", "check", folder)
    assert result.exit_code == 1
    found = [line for line in result.output.splitlines() if line.startswith(FAILS)]
    assert len(found) == 1
    assert "`questions[order[i]]` has no `direct_en`" in found[0]
    assert found[0].endswith(IN_ENGLISH)
    assert "explored and played 8 kinds of session (4 conditions, in de and en): " in result.output
    assert "2 of 2 acts began; 1 problem, " in result.output
    assert "next: " not in result.output


def test_an_assignment_that_fails_is_found_with_its_line_and_the_reason(right: Path) -> None:
    changed(right / "scenario/rules/objects.xml", ('"i = i + 1"', '"i = column + i"'))
    orders = "levels.forward.memory = { order = [0, 1] }\nlevels.back.memory = { order = [1, 0] }\n"
    changed(right / "study.toml", (f'[factors.first]\nkind = "within"\n{orders}\n', ""))  # 4 kinds, not 8
    result = typed("study", "check", right)
    assert result.exit_code == 1
    found = [line for line in result.output.splitlines() if "play-failed" in line]
    place = "scenario/rules/objects.xml:17:7: problem play-failed: "
    told = "the assignment `i = column + i` of Objects failed when it was played: "
    assert found and all(line.startswith(f"{place}{told}`+` joins texts or adds numbers") for line in found)


def test_a_key_that_can_be_lost_is_shown_and_other_remarks_are_not() -> None:
    def found(level: FindingLevel, kind: str) -> MergedFinding:
        return MergedFinding(KindFinding(level, kind, f"what {kind} is", "scenario/rules/r.xml:3:1"), ("",), 1, (0, 0))

    findings = (found("warning", "lost-cue"), found("remark", "lost-key"), found("remark", "round"))
    look = StudyExploration((), (), findings, 0)
    assert list(exploration_lines(look)) == [
        "scenario/rules/r.xml:3:1: warning lost-cue: what lost-cue is",
        "scenario/rules/r.xml:3:1: remark lost-key: what lost-key is",
        look.sentence,
    ]


def test_nothing_is_planned_then_unless_somebody_says_why(folder: Path) -> None:
    result = typed("study", "plan", folder)
    assert result.exit_code == 1
    assert FAILS in result.output
    assert "--anyway REASON" in result.output
    assert not (folder / "plan.csv").exists()
    assert typed("study", "plan", folder, "--anyway", " ").exit_code == 2
    assert typed("study", "plan", folder, "--anyway", "nobody speaks English").exit_code == 0
    assert read_log(folder)[-1].get("anyway") == "nobody speaks English"
    assert typed("study", "plan", folder).exit_code == 0, "there is a plan, and it is told again"


def test_a_study_without_problems_is_planned(right: Path) -> None:
    result = typed("study", "plan", right)
    assert result.exit_code == 0, result.output
    assert "; 0 problems, " in result.output
    assert "anyway" not in read_log(right)[-1].fields


@pytest.mark.parametrize(
    ("column", "problem"),
    [("direkt_en", "the table `questions` has no column `direkt_en`; did you mean `direct_de`?"), ("direct_de", "")],
)
def test_a_column_that_a_level_names_and_a_table_lacks_is_found_without_playing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, column: str, problem: str
) -> None:
    rules = folder / "scenario" / "rules" / "objects.xml"
    before, _, rest = rules.read_text().partition("    <onEntry>\n      <if")
    rules.write_text(before + rest.partition("</onEntry>\n")[2])
    changed(folder / "scenario" / "memory.json", ('"column": ""', '"column": "polite_de"'))
    changed(
        folder / "study.toml",
        ('{ german = "polite_de", english = "polite_en" }', '{ column = "polite_de" }'),
        ('{ german = "direct_de", english = "direct_en" }', f'{{ column = "{column}" }}'),
    )
    monkeypatch.setattr(kinds, "QUICK_SECONDS", 0.0)
    found = json.loads(typed("study", "check", folder, "--json").output)["explored"]["findings"]
    missing = [each for each in found if each["kind"] == "missing-part"]
    assert [each["text"] for each in missing] == ([f"R_Ask fails at action 1: {problem}"] if problem else [])
    assert all(len(each["kinds"]) == 4 for each in missing)


def test_exploring_a_study_tells_each_finding_once(folder: Path) -> None:
    result = typed("explore", folder, "--cores", "1", "--no-stop", "--no-lost")
    assert result.exit_code == 1
    assert result.output.count("PROBLEM") == 1
    assert " ".join(result.output.split()).count(IN_ENGLISH) == 1
    assert result.output.count("Looked at all ") == 1, "what is the same of all kinds is told once"
    assert typed("explore", folder, "--keys").exit_code == 2
    changed(folder / "study.toml", ("n = 8", "n = -8"))
    result = typed("explore", folder)
    assert result.exit_code == 1
    assert "nothing is explored as long as the study has errors" in result.output


@pytest.mark.parametrize(
    ("change", "again"),
    [
        (lambda folder: None, 0),
        (lambda folder: changed(folder / "study.toml", ('"Polite and direct"', '"Polite"')), 0),
        (lambda folder: changed(folder / "study.toml", ("[1, 0]", "[1, 1]")), 4),
        (lambda folder: changed(folder / "scenario" / "texts" / "en.toml", ("Thank you", "Thanks")), 8),
    ],
    ids=["nothing", "title", "level", "scenario"],
)
def test_what_has_not_changed_is_looked_at_once(
    right: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None], again: int
) -> None:
    monkeypatch.setattr(kinds, "QUICK_SECONDS", 0.0)
    first = typed("study", "check", right).output
    looked: list[str] = []
    explore = kinds._explore_kind
    monkeypatch.setattr(kinds, "_explore_kind", lambda *of: looked.append("") or explore(*of))
    change(right)
    assert typed("study", "check", right).output == first
    assert len(looked) == again
    kept = (right / kinds.KEPT).read_text()
    for edited in (
        "{",
        re.sub(r'"situations":\d+', '"situations":1', kept),
        kept.replace('"level":"warning"', '"level":"remark"'),
    ):
        (right / kinds.KEPT).write_text(edited)
        assert typed("study", "check", right).output == first


def kind(condition: str, language: str = "", scenario: str = "/s") -> SessionKind:
    return SessionKind(PlannedRun(0, 1, {}, condition, {}, scenario, 0), language)


def finding(kind: str, text: str, level: kinds.FindingLevel = "warning", place: str = "a:1:1") -> KindFinding:
    return KindFinding(level, kind, text, place)


A, B, C = kind("a"), kind("b"), kind("c", scenario="/other")
NEVER = finding("never-entered", "R never comes to S")


@pytest.mark.parametrize(
    ("looks", "expected"),
    [
        ([(A, True, [NEVER]), (B, True, [])], []),
        ([(A, True, [NEVER]), (B, True, [NEVER]), (C, True, [])], [("R never comes to S", ("a", "b"))]),
        ([(A, True, [NEVER]), (B, False, [NEVER])], []),
        (
            [
                (A, True, [finding("x", "in 3 of 9 situations")]),
                (B, False, [finding("x", "in 1,234 of 5,000 situations")]),
            ],
            [("in 3 of 9 situations", ("a", "b"))],
        ),
        (
            [(A, True, [finding("x", "one")]), (B, True, [finding("y", "bad", "problem"), finding("x", "two")])],
            [("bad", ("b",)), ("one", ("a",)), ("two", ("b",))],
        ),
    ],
    ids=["comes elsewhere", "comes nowhere", "not known", "counts differ", "problems first"],
)
def test_findings_are_merged(
    looks: list[tuple[SessionKind, bool, list[KindFinding]]], expected: list[tuple[str, tuple[str, ...]]]
) -> None:
    assert [(each.finding.text, each.kinds) for each in merge(looks)] == expected


def test_what_was_broken_off_is_said(right: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kinds, "QUICK_SECONDS", 0.0)
    result = typed("study", "check", right)
    assert (
        "; exploring stopped after 0 s in 8 kinds; playing stopped after 0 s in 8 kinds, "
        "and `rise-engine explore STUDY` looks at more"
    ) in " ".join(result.output.split()), result.output
