"""Making plans: once, anew with a reason, never over another one, and finished by the next one after a kill."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk
from rise_engine.study.model import Participant, Slot
from rise_engine.study.plan import make_plan, slot_seed
from rise_engine.study.plan_file import (
    NEW_PLAN_FILE,
    PLAN_FILE,
    plan_text,
    put_new_plan,
    read_plan,
    set_plan_aside,
    write_new_plan,
)
from rise_engine.study.planning import MadePlan, held_slots, last_planned, plan_study
from rise_engine.study.review import review_study
from rise_engine.study.study_log import LockedLog, read_log
from rise_engine.study.study_toml import load_study
from tests.study.designs import DESIGN, study_folder

LIST = DESIGN.replace("block = [1, 2]", 'between = "list"')
MINIMISED = DESIGN.replace("block = [1, 2]", 'between = "minimise"')


def plan(path: Path, again: str | None = None, participants: tuple[Participant, ...] = ()) -> MadePlan:
    loaded = load_study(path)
    assert loaded.study is not None, loaded.diagnostics
    return plan_study(loaded.study, loaded.scenarios, participants, again=again)


def log(path: Path, kind: Any, **fields: Any) -> None:
    with LockedLog(path) as opened:
        opened.append(kind, **fields)


def change(path: Path, old: str, new: str) -> None:
    text = (path / "study.toml").read_text()
    assert old in text
    (path / "study.toml").write_text(text.replace(old, new))


def review(path: Path) -> list[str]:
    return [str(each) for each in review_study(path).diagnostics]


# --- plan.csv ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("toml", [DESIGN, MINIMISED, 'title = "T"\nid = "t"\nseed = 1\nn = 1\n'])
def test_what_is_written_is_read(tmp_path: Path, toml: str) -> None:
    study = load_study(study_folder(tmp_path, toml)).study
    assert study is not None
    made = make_plan(study)
    write_new_plan(tmp_path, plan_text(study, made))
    put_new_plan(tmp_path)
    loaded = read_plan(study)
    assert (loaded.diagnostics, loaded.slots) == ([], made)
    assert (tmp_path / PLAN_FILE).stat().st_mode & 0o777 == 0o600
    assert not (tmp_path / NEW_PLAN_FILE).exists()


def test_a_spreadsheet_may_have_saved_it(tmp_path: Path) -> None:
    study = load_study(study_folder(tmp_path)).study
    assert study is not None
    text = plan_text(study, make_plan(study)).replace(",", ";").replace("\n", "\r\n")
    (tmp_path / PLAN_FILE).write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read_plan(study).slots == make_plan(study)


GOOD = "slot,language,hesitation,order,seed\n1,de,no,loud quiet,5\n2,en,yes,quiet loud,6\n"

ORDER = "error wrong-value: `order` has each of `quiet`, `loud` once, with blanks between them:"

# What stands in plan.csv, and the findings about it.
WRONG: dict[str, tuple[str, list[str]]] = {
    "no rows": ("slot,language,hesitation,order,seed\n", ["1:1: error missing-value: this plan has no rows"]),
    "a misspelt column": (
        GOOD.replace("hesitation", "hestiation"),
        ["1:1: error missing-column: the column `hesitation`", "1:15: error unknown-column: unknown column"],
    ),
    "another column": (
        GOOD.replace("seed\n", "seed,x\n").replace("5\n", "5,1\n").replace("6\n", "6,1\n"),
        ["1:37: error unknown-column: unknown column `x`; the columns of this study's plan are slot, language"],
    ),
    "a slot that is no number": (
        GOOD.replace("2,en", "b,en"),
        ["3:1: error wrong-value: `slot` is a whole number from 1"],
    ),
    "slot 0": (GOOD.replace("2,en", "0,en"), ["3:1: error wrong-value: `slot` is a whole number from 1 on, not `0`"]),
    "a slot twice": (GOOD.replace("2,en", "1,en"), ["3:1: error duplicate-name: the slot 1 is in line 2 already"]),
    "another stratum": (
        GOOD.replace("2,en", "2,fr"),
        ["3:3: error wrong-value: `language` is one of `de`, `en`, not `fr`"],
    ),
    "another level": (
        GOOD.replace("yes", "yess"),
        ["3:6: error wrong-value: `hesitation` is one of `yes`, `no`, not `yess`; did you mean `yes`?"],
    ),
    "no level": (GOOD.replace("yes", ""), ["3:6: error wrong-value: `hesitation` is one of `yes`, `no`, not ``"]),
    "a run missing": (GOOD.replace("loud quiet", "loud"), [f"2:9: {ORDER} `quiet` is missing"]),
    "a run twice": (GOOD.replace("loud quiet", "loud loud"), [f"2:9: {ORDER} `loud` is listed 2 times"]),
    "another run": (
        GOOD.replace("loud quiet", "loud quite"),
        [f"2:9: {ORDER} there is no `quite`; did you mean `quiet`?"],
    ),
    "no seed": (GOOD.replace(",5\n", ",\n"), ["2:20: error wrong-value: `seed` is a whole number from 0 on, not ``"]),
    "everything": ("slot,language,hesitation,order,seed\nx,xx,xx,xx,xx\n", ["2:1:", "2:3:", "2:6:", "2:9:", "2:12:"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_every_fault_of_an_edited_plan_is_told(tmp_path: Path, case: str) -> None:
    text, expected = WRONG[case]
    study = load_study(study_folder(tmp_path)).study
    assert study is not None
    (tmp_path / PLAN_FILE).write_text(text)
    loaded = read_plan(study)
    told = [str(each) for each in loaded.diagnostics]
    assert loaded.slots is None
    assert len(told) == len(expected), told
    for line, part in zip(told, expected, strict=True):
        assert line.startswith(f"plan.csv:{part}")


def test_a_list_needs_no_numbers(tmp_path: Path) -> None:
    study = load_study(study_folder(tmp_path, LIST)).study
    assert study is not None
    (tmp_path / PLAN_FILE).write_text("hesitation;language;order\nno;de;loud quiet\nyes;en;quiet loud\n")
    assert read_plan(study).slots == (
        Slot(1, {"language": "de"}, {"hesitation": "no"}, ("loud", "quiet"), slot_seed(study, 1)),
        Slot(2, {"language": "en"}, {"hesitation": "yes"}, ("quiet", "loud"), slot_seed(study, 2)),
    )


def test_with_minimisation_the_cells_are_empty(tmp_path: Path) -> None:
    study = load_study(study_folder(tmp_path, MINIMISED)).study
    assert study is not None
    (tmp_path / PLAN_FILE).write_text("slot,hesitation,order,seed\n1,yes,loud quiet,5\n")
    assert "plan.csv:2:3: error wrong-value: `hesitation` is empty here" in str(read_plan(study).diagnostics[0])


def test_a_plan_is_never_put_over_another_one(tmp_path: Path) -> None:
    (tmp_path / PLAN_FILE).write_text("mine")
    write_new_plan(tmp_path, "new")
    with pytest.raises(StudyError, match="exists already; a plan is never overwritten"):
        put_new_plan(tmp_path)
    assert (tmp_path / PLAN_FILE).read_text() == "mine"
    (tmp_path / "plan-1.csv").write_text("older")
    assert set_plan_aside(tmp_path) == "plan-2.csv"
    put_new_plan(tmp_path)
    assert [(tmp_path / name).read_text() for name in ("plan-1.csv", "plan-2.csv", PLAN_FILE)] == [
        "older",
        "mine",
        "new",
    ]


class _FullDisk(Disk):
    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        super().write(descriptor, data[:5], offset)
        raise OSError(errno.ENOSPC, "full")


def test_a_full_disk_leaves_no_plan(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="the disk is full"):
        write_new_plan(tmp_path, "a long plan", _FullDisk())
    assert list(tmp_path.iterdir()) == []


# --- the first plan ---------------------------------------------------------------------------------------------------


def test_a_plan_is_made_once(tmp_path: Path) -> None:
    study_folder(tmp_path)
    made = plan(tmp_path)
    assert made.sentence == f"Made {tmp_path / PLAN_FILE}."
    (entry,) = read_log(tmp_path)
    assert (entry.kind, entry.get("slots"), list(entry.get("scenarios"))) == ("planned", len(made.slots), ["scenario"])
    assert review(tmp_path) == []
    before = (tmp_path / PLAN_FILE).read_bytes()
    assert "nothing has changed since" in plan(tmp_path).sentence
    assert (tmp_path / PLAN_FILE).read_bytes() == before
    assert len(read_log(tmp_path)) == 1


def test_texts_and_checks_may_change(tmp_path: Path) -> None:
    study_folder(tmp_path)
    plan(tmp_path)
    change(tmp_path, '"Lamps"', '"Other"')
    assert "nothing has changed since" in plan(tmp_path).sentence
    assert review(tmp_path) == []


def test_another_design_is_told(tmp_path: Path) -> None:
    study_folder(tmp_path)
    plan(tmp_path)
    change(tmp_path, "{ noise = 3 }", "{ noise = 4 }")
    change(tmp_path, "n = 8", "n = 10")
    with pytest.raises(
        StudyError, match=r"`n`, `factors.noise` of study.toml changed\. Put it back, or make a new plan"
    ):
        plan(tmp_path)
    (found,) = review(tmp_path)
    assert found.startswith("plan.csv:1:1: error plan-changed: since the plan was made on ")


def test_an_edited_plan_is_told(tmp_path: Path) -> None:
    study_folder(tmp_path)
    plan(tmp_path)
    text = (tmp_path / PLAN_FILE).read_text()
    (tmp_path / PLAN_FILE).write_text(text.replace("yes", "no", 1))
    with pytest.raises(StudyError, match=r"plan.csv was changed after it was planned"):
        plan(tmp_path)
    assert "error plan-changed: plan.csv was changed after it was planned" in review(tmp_path)[0]


def test_a_lost_plan_is_made_again_the_same(tmp_path: Path) -> None:
    study_folder(tmp_path)
    made = plan(tmp_path)
    (tmp_path / PLAN_FILE).unlink()
    assert "error plan-changed: plan.csv, planned on" in review(tmp_path)[0]
    again = plan(tmp_path)
    assert "it is made again, the same" in again.sentence
    assert again.slots == made.slots


def test_somebody_elses_plan_is_not_taken_for_ours(tmp_path: Path) -> None:
    study_folder(tmp_path, plan_csv=GOOD)
    assert "error not-planned: study.jsonl does not know this plan" in review(tmp_path)[0]
    with pytest.raises(StudyError, match='write between = "list" under'):
        plan(tmp_path)
    assert (tmp_path / PLAN_FILE).read_text() == GOOD


def test_a_list_is_checked_and_taken_up(tmp_path: Path) -> None:
    study_folder(tmp_path, LIST)
    with pytest.raises(StudyError, match=r"you write plan\.csv yourself"):
        plan(tmp_path)
    (tmp_path / PLAN_FILE).write_text(GOOD.replace("yes", "yess"))
    with pytest.raises(StudyError, match=r"plan.csv:3:6: error wrong-value"):
        plan(tmp_path)
    (tmp_path / PLAN_FILE).write_text(GOOD)
    assert "Your plan.csv is the plan now" in plan(tmp_path).sentence
    assert review(tmp_path) == ["plan.csv:1:1: warning short-plan: the plan has 2 rows for n = 8 participants"]


# --- a new plan -------------------------------------------------------------------------------------------------------


def take(path: Path, made: MadePlan, number: int) -> list[Slot]:
    """The first rows of German speakers are taken by P01, P02, ..."""
    rows = [slot for slot in made.slots if slot.strata["language"] == "de"][:number]
    for at, slot in enumerate(rows, start=1):
        log(path, "taken", slot=slot.slot, participant=f"P{at:02}")
    return rows


def test_more_participants_while_some_hold_slots(tmp_path: Path) -> None:
    study_folder(tmp_path)
    made = plan(tmp_path)
    held = take(tmp_path, made, 3)
    log(tmp_path, "excluded", participant="P02", reason="fire alarm")
    change(tmp_path, "n = 8", "n = 16")
    with pytest.raises(StudyError, match="--again REASON"):
        plan(tmp_path)
    again = plan(tmp_path, "eight more")
    assert (
        "changed in study.toml: n. The plan before is plan-1.csv. These participants keep their slots" in again.sentence
    )
    assert "P01, P03." in again.sentence
    assert again.slots[:2] == (held[0], held[2])
    assert min(slot.slot for slot in again.slots[2:]) == held[2].slot + 1, "a number means one row for ever"
    assert read_plan(load(tmp_path)).slots == again.slots
    entry = read_log(tmp_path)[-1]
    assert (entry.kind, entry.get("reason"), entry.get("kept")) == (
        "planned",
        "eight more",
        [held[0].slot, held[2].slot],
    )
    german = next(each for each in again.balance.strata if each.stratum == "language=de")
    assert german.cells.is_equal, "the cell that was lost is given again"
    assert not [line for line in review(tmp_path) if "plan.csv" in line]


def load(path: Path) -> Any:
    study = load_study(path).study
    assert study is not None
    return study


def test_what_a_condition_does_may_change_and_is_noted(tmp_path: Path) -> None:
    study_folder(tmp_path)
    take(tmp_path, plan(tmp_path), 1)
    change(tmp_path, "{ noise = 3 }", "{ noise = 4 }")
    assert "NOTE: conditions now do something else" in plan(tmp_path, "it was too quiet").sentence


def test_who_holds_a_slot_is_not_moved_into_another_design(tmp_path: Path) -> None:
    study_folder(tmp_path)
    held = take(tmp_path, plan(tmp_path), 2)
    change(tmp_path, "levels.yes.memory", "levels.always.memory")
    before = (tmp_path / PLAN_FILE).read_bytes()
    with pytest.raises(StudyError) as refused:
        plan(tmp_path, "another name")
    sentence, *lines = str(refused.value).splitlines()
    assert "the rows of those who hold a slot (P01, P02) do not fit into the new design" in sentence
    assert all("`hesitation` is one of `always`, `no`, not `yes`" in line for line in lines)
    assert len(lines) == sum(slot.levels["hesitation"] == "yes" for slot in held)
    assert ((tmp_path / PLAN_FILE).read_bytes(), len(read_log(tmp_path))) == (before, 3)


def test_rows_that_nobody_holds_may_be_of_another_design(tmp_path: Path) -> None:
    study_folder(tmp_path)
    made = plan(tmp_path)
    slot = next(slot for slot in made.slots if slot.levels["hesitation"] == "no")
    log(tmp_path, "taken", slot=slot.slot, participant="P01")
    change(tmp_path, "levels.yes.memory", "levels.always.memory")
    assert slot in plan(tmp_path, "another name").slots


@pytest.mark.parametrize("reason", ["first", "again"])
def test_a_new_plan_needs_a_change(tmp_path: Path, reason: str) -> None:
    study_folder(tmp_path)
    if reason == "first":
        with pytest.raises(StudyError, match="there is no plan yet"):
            plan(tmp_path, reason)
        return
    plan(tmp_path)
    with pytest.raises(StudyError, match="nothing that the plan depends on has changed"):
        plan(tmp_path, reason)


def test_held_rows_come_only_from_the_plan_that_was_made(tmp_path: Path) -> None:
    study_folder(tmp_path)
    take(tmp_path, plan(tmp_path), 1)
    text = (tmp_path / PLAN_FILE).read_text()
    (tmp_path / PLAN_FILE).write_text(text.replace("yes", "no", 1))
    change(tmp_path, "n = 8", "n = 10")
    with pytest.raises(StudyError, match="not the file that was planned with"):
        plan(tmp_path, "two more")


def test_a_list_may_grow_and_keeps_who_holds_a_slot(tmp_path: Path) -> None:
    study_folder(tmp_path, LIST, plan_csv=GOOD)
    plan(tmp_path)
    log(tmp_path, "taken", slot=2, participant="P01")
    with pytest.raises(StudyError, match="nothing that the plan depends on has changed"):
        plan(tmp_path, "more")
    (tmp_path / PLAN_FILE).write_text(GOOD.replace("\n2,", "\n3,"))
    with pytest.raises(StudyError, match=r"plan.csv has no row for P01 \(slot 2\)"):
        plan(tmp_path, "more")
    (tmp_path / PLAN_FILE).write_text(GOOD + "3,de,no,loud quiet,7\n")
    assert len(plan(tmp_path, "more").slots) == 3


KILLED = ["before the log", "before its place", "between the two names"]


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("moment", KILLED)
def test_killed_while_a_plan_was_made(tmp_path: Path, moment: str, again: bool) -> None:
    """What was written before is there; the next command finishes it, or makes it from the start."""
    study_folder(tmp_path)
    if again:
        plan(tmp_path)
        change(tmp_path, "n = 8", "n = 16")
    reason = "more" if again else None
    wanted = plan(tmp_path, reason)
    text = (tmp_path / PLAN_FILE).read_text()
    (tmp_path / PLAN_FILE).rename(tmp_path / NEW_PLAN_FILE)
    if again and moment != "between the two names":
        (tmp_path / "plan-1.csv").rename(tmp_path / PLAN_FILE)
    if moment == "before the log":
        with LockedLog(tmp_path) as opened:
            opened.rewrite(opened.entries()[:-1])
    else:
        assert (
            any("a new plan was made but is not in its place yet" in line for line in review(tmp_path)) == again
            or not again
        )
    finished = plan(tmp_path, reason if moment == "before the log" else None)
    assert finished.slots == wanted.slots
    assert (tmp_path / PLAN_FILE).read_text() == text
    assert not (tmp_path / NEW_PLAN_FILE).exists()
    assert (tmp_path / "plan-1.csv").exists() == again
    assert [entry.kind for entry in read_log(tmp_path)] == ["planned"] * (1 + again)
    assert review(tmp_path) == []


# --- who holds a slot, and what check says of it ----------------------------------------------------------------------


def test_who_holds_a_slot(tmp_path: Path) -> None:
    for slot, name in [(1, "P01"), (2, "P02"), (3, "P03"), (4, "P04"), (5, "withdrawn:ab")]:
        log(tmp_path, "taken", slot=slot, participant=name)
    log(tmp_path, "excluded", participant="P02")
    log(tmp_path, "outcome", participant="P03", status="excluded", purpose="counted")
    log(tmp_path, "outcome", participant="P01", status="aborted", purpose="counted")
    log(tmp_path, "taken", slot=2, participant="P06")
    people = (Participant("P04", status="excluded"), Participant("P01"))
    assert held_slots(read_log(tmp_path), people) == {1: "P01", 2: "P06"}


def test_check_knows_who_is_lost_and_who_has_moved(tmp_path: Path) -> None:
    study_folder(tmp_path, participants="participant,language,consent_study\nP01,en,\nP03,de,\n")
    made = plan(tmp_path)
    take(tmp_path, made, 2)
    told = review(tmp_path)
    assert told == [
        "participants.csv:1:1: error lost-participant: `P02` holds slot 2 and has no row here any more",
        "participants.csv:2:1: warning stratum-changed: `P01` took slot 1 as language de, and is in another "
        "stratum now",
    ]


def test_check_says_that_a_scenario_was_changed(tmp_path: Path) -> None:
    study_folder(tmp_path)
    plan(tmp_path)
    (tmp_path / "scenario" / "scenario.toml").write_text('title = "Other"')
    (found,) = review(tmp_path)
    assert found.startswith("scenario:1:1: warning scenario-changed: this scenario, or the robot that it runs on, was")


def test_a_mended_scenario_is_taken_with_a_reason_and_the_plan_stays(tmp_path: Path) -> None:
    study_folder(tmp_path)
    first = plan(tmp_path)
    before = (tmp_path / "plan.csv").read_bytes()
    (tmp_path / "scenario" / "scenario.toml").write_text('title = "Other"')
    again = plan(tmp_path, "a word was misspelt")
    assert again.slots == first.slots and (tmp_path / "plan.csv").read_bytes() == before
    assert again.sentence.startswith("The plan stays unchanged; from now on it means the present `scenario`")
    entry = last_planned(read_log(tmp_path))
    assert entry is not None and entry.get("reason") == "a word was misspelt"
    assert review(tmp_path) == []
    with pytest.raises(StudyError, match="nothing that the plan depends on has changed"):
        plan(tmp_path, "once more")


def test_check_finds_everything_at_once(tmp_path: Path) -> None:
    """Also what lies beside a study.toml with errors, unless it would be read by what is wrong."""
    bad = DESIGN.replace('title = "Lamps"', "titel = 1").replace("{ noise = 3 }", "{ nose = 3 }")
    study_folder(tmp_path, bad, "participant,language,consent_study\nMax M,de,\n", plan_csv=GOOD.replace("en", "fr"))
    (tmp_path / "study.jsonl").write_text("nonsense\n")
    (tmp_path / "scenario" / "memory.json").write_text('{"hesitation": false, "noise": 1')
    files = [line.partition(":")[0] for line in review(tmp_path)]
    assert set(files) == {"study.toml", "participants.csv", "plan.csv", "scenario/memory.json", "study.jsonl"}
    assert review_study(tmp_path).omitted == ()


def test_a_plan_of_another_study_is_left_out_of_what_is_told_twice(tmp_path: Path) -> None:
    study_folder(tmp_path, DESIGN.replace('["de", "en"]', '["de"]'))
    assert review_study(tmp_path).omitted == ("participants.csv",), "there is no plan yet"
    (tmp_path / PLAN_FILE).write_text(GOOD)
    assert review_study(tmp_path).omitted == ("participants.csv", PLAN_FILE)


def test_slots_keep_their_seed_whatever_else_changes(tmp_path: Path) -> None:
    study = load(study_folder(tmp_path))
    assert slot_seed(study, 3) == slot_seed(replace(study, n=99), 3)
