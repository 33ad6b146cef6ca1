"""study.toml: what is read of it, and everything that is wrong with one, at once and with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.study.model import AssignmentSettings, StudyCheck
from rise_engine.study.plan import changed_parts, design_hash
from rise_engine.study.study_toml import is_study, load_study
from tests.scenario.folders import folder
from tests.study.designs import DESIGN, loaded_study, study_folder

CHECKS = """
[[check]]
id = "lights"
ask = "The lamp is on"

[[check]]
id = "space"
auto = "disk"
min = "20 GB"
every = "30 d"

[[check]]
id = "tracker"
run = ["./check.sh", "fast"]
when = "after"
blocks = false
"""


def found(path: Path, toml: str) -> list[str]:
    return [str(each) for each in loaded_study(path, toml).diagnostics]


def test_everything_is_read(tmp_path: Path) -> None:
    more = CHECKS + '\n[participants]\ncolumns = ["age"]\n[wizards]\nanna = "W1"\n[retention]\nmedia = "52 w"\n'
    (tmp_path / "check.sh").write_text("#!/bin/sh\n")
    (tmp_path / "check.sh").chmod(0o700)
    loaded = loaded_study(tmp_path, DESIGN + more)
    assert [str(each) for each in loaded.diagnostics] == []
    study = loaded.study
    assert study is not None
    assert (study.title, study.id, study.seed, study.n, study.mode, study.robot) == (
        "Lamps",
        "lamps",
        7,
        8,
        "debug",
        "",
    )
    assert study.scenario == "scenario"
    hesitation, noise = study.factors
    assert (hesitation.kind, [level.memory for level in hesitation.levels]) == (
        "between",
        [{"hesitation": True}, {"hesitation": False}],
    )
    assert (noise.kind, [(each.name, each.label, each.memory) for each in noise.levels]) == (
        "within",
        [("quiet", "A", {}), ("loud", "B", {"noise": 3})],
    )
    assert study.assignment == AssignmentSettings(block=(1, 2), strata=("language",))
    assert (study.strata, study.consent, study.columns) == ({"language": ("de", "en")}, ("study",), ("age",))
    assert (study.wizards, study.retention) == ({"anna": "W1"}, {"media": 364.0})
    assert study.checks == (
        StudyCheck("lights", ask="The lamp is on"),
        StudyCheck("space", auto="disk", minimum="20 GB", valid=2_592_000.0),
        StudyCheck("tracker", run=("./check.sh", "fast"), when="after", blocks=False),
    )
    assert list(loaded.scenarios) == [str(tmp_path / "scenario")]


def test_the_least_that_is_a_study(tmp_path: Path) -> None:
    study = loaded_study(tmp_path, 'title = "T"\nid = "t"\nseed = 1\nn = 1\n').study
    assert study is not None
    assert (study.mode, study.factors, study.assignment.spare, study.checks) == ("real", (), 0.25, ())


MISSPELT = """\
titel = "Lamps"
id = "lamps"
sed = 7
n = 8
mod = "debug"
[factors.hesitation]
kinds = "between"
level.yes.memory = {}
[factors.noise]
kind = "within"
levels.quiet = {}
levels.loud.memori = { noise = 3 }
lables = { quiet = "A" }
[assignmnet]
[assignment]
blocks = 1
[consent]
need = ["study"]
[[check]]
id = "a"
ask = "x"
wen = "after"
[[check]]
idd = "b"
aks = "y"
[participants]
column = ["age"]
[retention]
medium = "1 d"
[rekording]
obs = 1
"""


def test_every_misspelt_key_is_told_with_the_right_one(tmp_path: Path) -> None:
    """At once, wherever it stands, and what is missing because of it is not told a second time."""
    told = [line for line in found(tmp_path, MISSPELT) if "unknown-key" in line]
    assert told == [
        "study.toml:1:1: error unknown-key: unknown key `titel`; did you mean `title`?",
        "study.toml:3:1: error unknown-key: unknown key `sed`; did you mean `seed`?",
        "study.toml:5:1: error unknown-key: unknown key `mod`; did you mean `mode`?",
        "study.toml:7:1: error unknown-key: unknown key `kinds`; did you mean `kind`?",
        "study.toml:8:1: error unknown-key: unknown key `level`; did you mean `levels`?",
        "study.toml:12:13: error unknown-key: unknown key `memori`; did you mean `memory`?",
        "study.toml:13:1: error unknown-key: unknown key `lables`; did you mean `labels`?",
        "study.toml:14:2: error unknown-key: unknown key `assignmnet`; did you mean `assignment`?",
        "study.toml:16:1: error unknown-key: unknown key `blocks`; did you mean `block`?",
        "study.toml:18:1: error unknown-key: unknown key `need`; did you mean `needed`?",
        "study.toml:22:1: error unknown-key: unknown key `wen`; did you mean `when`?",
        "study.toml:24:1: error unknown-key: unknown key `idd`; did you mean `id`?",
        "study.toml:25:1: error unknown-key: unknown key `aks`; did you mean `ask`?",
        "study.toml:27:1: error unknown-key: unknown key `column`; did you mean `columns`?",
        "study.toml:29:1: error unknown-key: unknown key `medium`; did you mean `media`?",
        "study.toml:30:2: error unknown-key: unknown key `rekording`; did you mean `recording`?",
    ]
    assert told == found(tmp_path, MISSPELT)


# What is changed in the design (a text, and what stands in its place), and the findings about it.
WRONG: dict[str, tuple[str, str, list[str]]] = {
    "no title": ('title = "Lamps"\n', "", ["study.toml:1:1: error missing-value: `title` is missing"]),
    "an empty title": ('"Lamps"', '" "', ["study.toml:1:9: error missing-value: `title` is empty"]),
    "an id with a blank": (
        '"lamps"',
        '"the lamps"',
        ["study.toml:2:6: error bad-name: `id` has letters and digits only"],
    ),
    "a seed that is a text": ("seed = 7", 'seed = "x"', ["study.toml:3:8: error wrong-type: `seed` is a whole number"]),
    "a seed below 0": ("seed = 7", "seed = -1", ["study.toml:3:8: error out-of-range: `seed` is from 0"]),
    "nobody": ("n = 8", "n = 0", ["study.toml:4:5: error out-of-range: `n` is from 1 to 10000"]),
    "half a participant": ("n = 8", "n = 7.5", ["study.toml:4:5: error wrong-type: `n` is how many complete"]),
    "another mode": ('"debug"', '"test"', ['study.toml:5:8: error wrong-value: `mode` is "debug" or "real"']),
    "no scenario": (
        "mode =",
        'scenario = "scenaro"\nmode =',
        ["study.toml:5:12: error no-scenario: there is no folder `scenaro` in the study; did you mean `scenario`?"],
    ),
    "another robot": ("mode =", 'robot = "peper"\nmode =', ["the robot asked for, `peper`, does not exist"]),
    "another kind": (
        '"between"',
        '"betwen"',
        ["study.toml:8:8: error wrong-value: `kind` is", "did you mean `between`?"],
    ),
    "no kind": ('kind = "between"\n', "", ["study.toml:7:10: error missing-value: `kind` is missing"]),
    "a factor called order": ("factors.noise", "factors.order", ["bad-name: plan.csv has a column `order` of another"]),
    "a factor with a blank": ("factors.noise", 'factors."a b"', ["bad-name: a factor has a name of letters"]),
    "a factor called as a stratum": (
        "factors.noise",
        "factors.language",
        ["plan.csv has a column `language` of another"],
    ),
    "a factor that is a number": (
        "[assignment]",
        "[factors]\nx = 3\n[assignment]",
        ["study.toml:19:1: error wrong-type: a factor is a table: [factors.x]"],
    ),
    "one level": ("levels.no.memory = { hesitation = false }\n", "", ["`hesitation` has only the level `yes`"]),
    "a level with a plus": ("levels.no.", 'levels."n+o".', ["study.toml:10:8: error bad-name: a level has a name of"]),
    "a level that is a number": (
        "levels.quiet = {}",
        "levels.quiet = 1",
        ["study.toml:14:16: error wrong-type: a level is a table"],
    ),
    "levels in a list": (
        "levels.quiet = {}\nlevels.loud.memory = { noise = 3 }\nlabels",
        'levels = ["quiet", "loud"]\nlabels',
        ["study.toml:14:1: error wrong-type: `levels` is a table"],
    ),
    "two levels that do the same": (
        "levels.loud.memory = { noise = 3 }",
        "levels.loud = {}",
        ["study.toml:15:8: error same-level: the robot does the same in `quiet` and `loud`"],
    ),
    "levels that Python takes for the same": (
        "levels.quiet = {}\nlevels.loud.memory = { noise = 3 }",
        "levels.quiet.memory = { later = 1 }\nlevels.loud.memory = { later = true }",
        [],
    ),
    "a label of no level": (
        'quiet = "A"',
        'quite = "A"',
        ["study.toml:16:12: error unknown-name: `noise` has no level `quite`; did you mean `quiet`?"],
    ),
    "two factors that set one key": (
        "{ noise = 3 }",
        "{ hesitation = true }",
        ["study.toml:15:24: error set-twice: the factor `hesitation` sets `hesitation` too"],
    ),
    "two factors that choose the scenario": (
        "[assignment]",
        "[factors.one]\nkind = 'within'\nlevels.a.scenario = 'scenario'\nlevels.b = {}\n"
        "[factors.two]\nkind = 'within'\nlevels.a.scenario = 'scenario'\nlevels.b = {}\n[assignment]",
        ["study.toml:24:10: error set-twice: the factor `one` chooses the scenario too"],
    ),
    "a memory key that is not known": (
        "{ hesitation = true }",
        "{ hesitaton = true }",
        [
            "study.toml:9:23: error unknown-key: in scenario: the memory has no key `hesitaton`, and nothing sets it; "
            "did you mean `hesitation`?"
        ],
    ),
    "a memory key that nothing reads": (
        "{ hesitation = true }",
        "{ hesitation = true, unread = 1 }",
        ["study.toml:9:51: warning condition-unread: nothing in the scenario reads `unread`, so it changes nothing"],
    ),
    "a memory key that is only a label": ("{ noise = 3 }", "{ unread = 2 }\nlabel_only = true", []),
    "a memory value of another type": (
        "{ noise = 3 }",
        '{ noise = "3" }',
        ["study.toml:15:32: warning memory-type: in scenario, `noise` is a number at the start, and this is a text"],
    ),
    "a value within an object": ("{ noise = 3 }", "{ 'person.age' = 3, noise = 3 }", []),
    "a value for what comes later": ("{ noise = 3 }", "{ later = [1], noise = 3 }", []),
    "another method": (
        "block = ",
        'between = "block"\nblock = ',
        ["`between` is one of `blocks`, `minimise`, `random`, `list`, not `block`; did you mean `blocks`?"],
    ),
    "another order": ("block = ", 'within = "latn"\nblock = ', ["not `latn`; did you mean `latin`?"]),
    "a block of nobody": (
        "[1, 2]",
        "[0]",
        ["study.toml:19:9: error wrong-type: `block` is a list of whole numbers from 1 to 20"],
    ),
    "a block as a number": ("[1, 2]", "2", []),
    "too many spare rows": (
        "block = ",
        "spare = 25\nblock = ",
        ["study.toml:19:9: error out-of-range: `spare` is a part of `n`"],
    ),
    "a stratum that is not described": (
        '["language"]',
        '["langage"]',
        [
            "study.toml:20:11: error unknown-name: [strata] has no `langage`",
            "did you mean `language`?",
            "unused-stratum",
        ],
    ),
    "a stratum that is not used": (
        'strata = ["language"]\n',
        "",
        ["study.toml:22:1: warning unused-stratum: `language` is in [strata]"],
    ),
    "a stratum of one value": (
        '["de", "en"]',
        '["de"]',
        ["study.toml:23:12: error wrong-value: `language` has two values or more"],
    ),
    "a value twice": ('["de", "en"]', '["de", "de"]', ["`language` has the value `de` twice"]),
    "a stratum called status": ("language", "status", ["participants.csv has a column `status` of another meaning"]),
    "a consent with its prefix": (
        'needed = ["study"]',
        'needed = ["consent_study"]',
        ["study.toml:26:11: error bad-name: write `study`: the column is called consent_study"],
    ),
    "a consent with a blank": (
        'needed = ["study"]',
        'needed = ["the study"]',
        ["bad-name: a consent has a name of letters"],
    ),
    "a column for names": (
        "[consent]",
        '[participants]\ncolumns = ["surname"]\n[consent]',
        ["personal-data: `surname` seems to hold a name: this folder knows people by their pseudonyms only"],
    ),
    "a column that there is": (
        "[consent]",
        '[participants]\ncolumns = ["comment"]\n[consent]',
        ["duplicate-name: participants.csv has a column `comment` already"],
    ),
    "a wizard with a blank": (
        "[consent]",
        '[wizards]\nanna = "W 1"\n[consent]',
        ["bad-name: the code of `anna` in exports has letters and digits: W1"],
    ),
    "two wizards of one name": (
        "[consent]",
        '[wizards]\nanna = "W1"\nben = "W1"\n[consent]',
        ["duplicate-name: `anna` is called `W1` already"],
    ),
    "no length of time": (
        "[consent]",
        '[retention]\nmedia = "some days"\n[consent]',
        ["wrong-value: `some days` is not a length of time; write 365 d"],
    ),
    "a check with one bracket": (
        "[consent]",
        '[check]\nid = "a"\n[consent]',
        ["study.toml:25:2: error wrong-type: each check is a table of its own: [[check]]"],
    ),
    "a check that does nothing": (
        "[consent]",
        '[[check]]\nid = "a"\n[consent]',
        ["check-form: a check has exactly one of ask"],
    ),
    "a check that does two things": (
        "[consent]",
        '[[check]]\nid = "a"\nask = "x"\nauto = "disk"\n[consent]',
        ["check-form: a check has exactly one of ask"],
    ),
    "two checks of one name": (
        "[consent]",
        '[[check]]\nid = "a"\nask = "x"\n[[check]]\nid = "a"\nask = "x"\n[consent]',
        ["study.toml:29:6: error duplicate-name: another check is called `a`"],
    ),
    "a check of an unknown kind": (
        "[consent]",
        '[[check]]\nid = "a"\nauto = "disc"\n[consent]',
        ["study.toml:27:8: error unknown-name: there is no automatic check `disc`; did you mean `disk`?"],
    ),
    "a check with another time": (
        "[consent]",
        '[[check]]\nid = "a"\nask = "x"\nwhen = "during"\n[consent]',
        ['wrong-value: `when` is "before" or "after" the session, not `during`'],
    ),
    "a program as a text": (
        "[consent]",
        '[[check]]\nid = "a"\nrun = "./x y"\n[consent]',
        ["wrong-type: `run` is a program and its arguments"],
    ),
    "a size that is none": (
        "[consent]",
        '[[check]]\nid = "a"\nauto = "disk"\nmin = "much"\n[consent]',
        ["wrong-value: `much` is not a size; write 20 GB"],
    ),
    "a size of no disk": (
        "[consent]",
        '[[check]]\nid = "a"\nask = "x"\nmin = "1 GB"\n[consent]',
        ["check-form: `min` says how much room"],
    ),
    "no toml": ("n = 8", "n = 8 8", ["study.toml:4:7: error toml-syntax"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told(tmp_path: Path, case: str) -> None:
    old, new, expected = WRONG[case]
    assert old in DESIGN
    told = found(tmp_path, DESIGN.replace(old, new))
    assert (told == []) == (expected == []), told
    for part in expected:
        assert part in "\n".join(told), told
    assert len(told) <= max(1, len(expected)), f"one finding for one mistake: {told}"
    errors = [line for line in told if ": error " in line]
    assert (load_study(tmp_path).study is None) == bool(errors)


MANY = "".join(f"levels.l{number}.memory = {{ noise = {number} }}\n" for number in range(8))


@pytest.mark.parametrize(
    ("kind", "more", "sentence"),
    [
        ("within", "", 'make 64 runs for each participant; with within = "williams" at most 24'),
        ("within", 'within = "all"', 'make 64 runs for each participant; with within = "all" at most 6'),
        ("between", "", "the between factors make 128 cells; at most 100 can be planned"),
    ],
)
def test_a_design_that_is_too_large(tmp_path: Path, kind: str, more: str, sentence: str) -> None:
    factors = f'[factors.a]\nkind = "{kind}"\n{MANY}[factors.b]\nkind = "{kind}"\n{MANY.replace("noise", "mood")}'
    toml = DESIGN.partition("[factors.noise]")[0] + factors + f"[assignment]\n{more}\n"
    told = [line for line in found(tmp_path, toml) if "out-of-range" in line]
    assert len(told) == 1
    assert sentence in told[0]


def test_a_plan_that_is_too_large(tmp_path: Path) -> None:
    toml = DESIGN.replace("n = 8", "n = 9000").replace("block =", "spare = 2\nblock =")
    assert found(tmp_path, toml) == [
        "study.toml:4:1: error out-of-range: the plan would have 54,000 rows, for 9000 participants in each stratum "
        "and the spare ones; at most 50,000 can be planned"
    ]


def test_a_mistake_in_a_scenario_is_told_with_its_path(tmp_path: Path) -> None:
    study_folder(tmp_path)
    folder(
        tmp_path,
        {"scenario/acts/b.xml": "<Dialog name='B'>\n<Speach/></Dialog>", "scenario-b/scenario.toml": "titel = 1"},
    )
    toml = DESIGN.replace("levels.loud.memory = { noise = 3 }", 'levels.loud.scenario = "scenario-b"')
    told = found(tmp_path, toml)
    assert any(line.startswith("scenario/acts/b.xml:2:") for line in told), told
    assert any(line.startswith("scenario-b/scenario.toml:1:1: error unknown-key") for line in told), told
    assert all("study.toml" not in line.partition(" ")[0] for line in told), told


def test_levels_are_compared_with_the_scenario_in_which_they_are_set(tmp_path: Path) -> None:
    """A factor's values are set in every scenario that another factor chooses."""
    study_folder(tmp_path)
    folder(
        tmp_path,
        {"other/scenario.toml": 'title = "O"', "other/acts/a.xml": "<Dialog name='A'/>", "other/memory.json": "{}"},
    )
    toml = DESIGN.replace("levels.loud.memory = { noise = 3 }", 'levels.loud.scenario = "other"')
    told = [line for line in found(tmp_path, toml) if "unknown-key" in line]
    assert [line.partition(",")[0] for line in told] == [
        "study.toml:9:23: error unknown-key: in other: the memory has no key `hesitation`",
        "study.toml:10:22: error unknown-key: in other: the memory has no key `hesitation`",
    ]


def test_a_scenario_that_no_session_runs_is_not_needed(tmp_path: Path) -> None:
    study_folder(tmp_path)
    (tmp_path / "scenario").rename(tmp_path / "one")
    toml = DESIGN.replace("levels.quiet = {}", 'levels.quiet.scenario = "one"').replace(
        "levels.loud.memory = { noise = 3 }", 'levels.loud = { scenario = "one", memory = { noise = 3 } }'
    )
    (tmp_path / "study.toml").write_text(toml)
    assert [str(each) for each in load_study(tmp_path).diagnostics] == []


def test_no_study(tmp_path: Path) -> None:
    assert not is_study(tmp_path)
    assert "there is no study.toml in this folder; `rise-engine study new`" in str(load_study(tmp_path).diagnostics[0])
    assert "there is no such folder" in str(load_study(tmp_path / "nowhere").diagnostics[0])


def test_study_toml_itself_can_be_named(tmp_path: Path) -> None:
    loaded = load_study(study_folder(tmp_path) / "study.toml")
    assert loaded.study is not None
    assert loaded.study.folder == str(tmp_path)


# What is changed, and in which part the plan is another one then.
CHANGES = [
    ("title =", "title = 'Other' #", []),
    ('quiet = "A"', 'quiet = "X"', []),
    ("needed = [", 'needed = ["more", ', []),
    ('mode = "debug"', 'mode = "real"', []),
    ("block =", "hidden = true\nblock =", []),
    ("n = 8", "n = 9", ["n"]),
    ("seed = 7", "seed = 8", ["seed"]),
    ("{ noise = 3 }", "{ noise = 4 }", ["factors.noise"]),
    ("block = [1, 2]", "block = [2]", ["assignment"]),
    ('["de", "en"]', '["de", "fr"]', ["strata"]),
    ("levels.yes.memory", "levels.on.memory", ["factors.hesitation"]),
]


@pytest.mark.parametrize(("old", "new", "parts"), CHANGES)
def test_what_the_plan_is_made_of(tmp_path: Path, old: str, new: str, parts: list[str]) -> None:
    """Texts and checks may change after it was made, and nothing else."""
    from rise_engine.study.plan import design_of

    before = loaded_study(tmp_path / "a").study
    after = loaded_study(tmp_path / "b", DESIGN.replace(old, new, 1)).study
    assert before is not None
    assert after is not None
    assert before.hash != after.hash
    assert (design_hash(before) != design_hash(after)) == bool(parts)
    assert changed_parts(design_of(before), after) == parts
