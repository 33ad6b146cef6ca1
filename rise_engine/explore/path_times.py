"""When the steps of a path can come, as far as is known how long its acts take; and what must go wrong for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.explore.act_traits import Pace
from rise_engine.explore.courses import ActCourse, course_of, slowed, with_a_pause
from rise_engine.explore.following import Followed
from rise_engine.explore.moves import Move
from rise_engine.explore.timetable import Contradiction, Tag, TimeBound, settle
from rise_engine.kernel.act_runner import CANCEL_LIMIT
from rise_engine.scenario.model import Scenario

GAPS = (0.5, 0.1, 0.02, 0.005)
"""Seconds by which what somebody does comes after the step before: the most comfortable that is possible."""
APART = (0.01, 0.0)
"""Seconds by which what comes by itself comes after the step before."""
STOPPING = 0.05
"""Seconds until the simulated robot confirms a cancel."""
ALL_STOPPED = 0.051
"""Seconds until it confirms that everything has stopped."""
REFUSING = 0.02
"""Seconds until it refuses an action."""
WELL_WITHIN = 0.2
"""Seconds by which a moment is from the ends of the time in which it must lie, where that is long enough: in real time
nothing comes exactly when it is expected."""
LONGER = 0.3
"""Seconds by which an act that is to last longer than the path does so."""
_LEAST = 0.004
"""Seconds by which something that has not yet ended is from its end."""

MOST_AGAIN = 40
"""How many times an act goes on from its beginning, at most."""

TaskId: TypeAlias = int
ActionId: TypeAlias = str
GoalNumber: TypeAlias = tuple[str, int]
"""A kind of action, and the how-manieth of the session; as faults name it."""
Manner: TypeAlias = Literal["", "slower", "at any pace"] | int
"""How an act takes its time: as it is expected, as a fault says, or so many times one after the other."""
Slip: TypeAlias = tuple[Literal["fail", "abort", "reject", "by itself"], ActionId]
"""How an act can fail: which of its actions, and in which way."""


class KnownCourses(Struct):
    """What playing has told of acts, by task and action."""

    seconds: dict[tuple[TaskId, ActionId], float] = field(default_factory=dict)
    goals: dict[tuple[TaskId, ActionId], GoalNumber] = field(default_factory=dict)


class PlannedTimes(Struct, frozen=True):
    """Times for all steps, and faults for what has to go wrong."""

    times: tuple[float, ...]
    """Of each step in seconds; the beginning is 0."""
    faults: tuple[str, ...]
    factors: dict[tuple[TaskId, ActionId], float]
    """What is made slower or faster by them."""
    spoilt: frozenset[tuple[TaskId, ActionId]]
    """What fails or hangs by them, so that its length says nothing."""


class _Life(Struct):
    """An act of the path: when it begins, and what becomes of it, in steps."""

    task: TaskId
    name: str
    begun: int
    left: int | None = None
    """The step in which it stops running; null: it runs in the end."""
    left_by: str = ""
    """`succeeded` or `failed` by itself; empty: by something else."""
    aborted: bool = False
    """With `failed`: by the robot, or somebody else."""
    doomed: bool = False
    winds_down: bool = False
    """Whether the robot has still to confirm something after that."""
    gone: int | None = None
    gone_by_itself: bool = False
    survived: int | None = None
    """The step in which the robot was lost, and it ran on."""
    voice: list[int] = field(default_factory=list)
    """The steps in which it begins to speak or falls silent."""


def is_free(move: Move) -> bool:
    """Whether a move comes when somebody wants it, or when a fault says so."""
    return move.kind not in ("end", "timer", "stopped")


class PathTimes:
    """The times of one path."""

    def __init__(
        self,
        scenario: Scenario,
        followed: Sequence[Followed],
        memory: Mapping[str, Any],
        pace: Pace,
        again: Mapping[TaskId, int],
    ) -> None:
        """Nothing is known of the acts yet.

        Arguments:
            scenario: what was explored.
            followed: the path.
            memory: what it is at the beginning, for how long things take.
            pace: as in the bounds.
            again: the acts that begin again as often as they end, and all is as before; and the last step after which
                that is so.
        """
        self._again = again
        self._scenario = scenario
        self._followed = followed
        self._memory = memory
        self._pace = pace
        self._last = len(followed) - 1
        self._lives = _lives_in(followed)
        self.known = KnownCourses()

    @property
    def begun(self) -> dict[TaskId, int]:
        """The step in which each act begins."""
        return {life.task: life.begun for life in self._lives}

    def plan(self) -> PlannedTimes | Contradiction:
        """The earliest times at which the path can go, with as little that goes wrong as possible."""
        courses = {life.task: self._course(life, self._pauses(life)) for life in self._lives}
        levels: dict[Tag, int] = {}
        times = settle(
            self._last + 1,
            lambda levels: [*self._bounds(levels, courses)],
            lambda tag: self._costs(tag, courses),
            levels,
        )
        if isinstance(times, Contradiction):
            return times
        return self._planned(times, levels, courses)

    def _course(self, life: _Life, factors: Mapping[ActionId, float] | None = None) -> ActCourse:
        act = self._scenario.acts[life.name]
        return course_of(self._scenario, act, self._memory, self._seconds(life), factors)

    def _pauses(self, life: _Life) -> dict[ActionId, float]:
        """What takes longer in an act, so that it can only wait at the moment at which it does in the path."""
        moments = [on_robot for _, on_robot in self._moments(life)]
        if all(moments) or self._course(life).parts(on_robot=False):
            return {}
        act = self._scenario.acts[life.name]
        return with_a_pause(self._scenario, act, self._memory, self._seconds(life), self._pace)

    def _seconds(self, life: _Life) -> dict[ActionId, float]:
        return {action: each for (task, action), each in self.known.seconds.items() if task == life.task}

    def _span_at_pace(self, life: _Life, pace: float) -> float:
        course = self._course(life)
        return self._course(life, {span.id: pace for span in course.spans}).length

    # --- bounds -------------------------------------------------------------------------------------------------------

    def _bounds(self, levels: Mapping[Tag, int], courses: Mapping[TaskId, ActCourse]) -> Iterator[TimeBound]:
        for step in range(1, self._last + 1):
            yield self._gap(step, levels)
        for life in self._lives:
            yield from self._while_it_runs(life, courses[life.task], levels)
            if life.winds_down:
                assert life.left is not None
                yield from self._while_it_winds_down(life, life.left, levels)
        yield from self._of_countdowns()
        yield from self._of_stops()

    def _gap(self, step: int, levels: Mapping[Tag, int]) -> TimeBound:
        move, tag = self._followed[step].move, ("gap", step)
        assert move is not None
        level = levels.get(tag, 0)
        if is_free(move):
            return TimeBound(step - 1, step, GAPS[level], tag)
        before = self._followed[step - 1].move
        seconds = APART[level] if before is None or not is_free(before) else max(APART[level], 0.001)
        return TimeBound(step - 1, step, seconds, tag)

    def _while_it_runs(self, life: _Life, course: ActCourse, levels: Mapping[Tag, int]) -> Iterator[TimeBound]:
        tag = ("act", life.task)
        hangs = life.winds_down and levels.get(("cancel", life.task), 0) > 0
        least = most = course.length
        match self._manner(life, levels):
            case "slower":
                most = self._span_at_pace(life, self._pace[1])
            case "at any pace":
                least, most = (self._span_at_pace(life, pace) for pace in self._pace)
            case int(times):
                least = most = course.length * times
        if life.left_by == "succeeded":
            assert life.left is not None
            yield from _between(life.begun, life.left, least, most, tag)
        elif life.left_by == "failed":
            assert life.left is not None
            slips = self._slips(life, course)
            if slips:
                fail: Tag = ("fail", life.task)
                at = slips[min(levels.get(fail, 0), len(slips) - 1)][1]
                yield from _between(life.begun, life.left, at, at, fail)
            else:
                yield from _between(life.begun, life.left, 0.0, most, tag)
        elif not hangs:
            last = self._last if life.left is None else life.left
            yield from _between(life.begun, last, None, most - _LEAST, tag)
        if isinstance(self._manner(life, levels), int):
            ever = self._again[life.task] + 1  # from here on its end is not its beginning
            last = self._last if life.left is None else life.left
            if ever < last:
                yield from _between(ever, last, None, course.length - (0.0 if life.left_by else _LEAST), tag)
        else:
            yield from self._parts(life, course, levels)
        marks = course.changes_of_voice()
        for step, at in zip(life.voice, marks, strict=False):
            yield from _between(life.begun, step, at, at, ("voice", life.task))

    def _parts(self, life: _Life, course: ActCourse, levels: Mapping[Tag, int]) -> Iterator[TimeBound]:
        """Where it matters whether the robot does something of it at that moment, or it only waits."""
        for step, on_robot in self._moments(life):
            parts = course.parts(on_robot=on_robot)
            if not parts or len(parts) == len(course.spans) == 1:
                continue
            tag: Tag = ("part", life.task, step)
            begin, end = parts[min(levels.get(tag, 0), len(parts) - 1)]
            if self._manner(life, levels) and end == course.length:
                end = self._span_at_pace(life, self._pace[1])
            margin = min((end - begin) / 4, WELL_WITHIN)
            yield from _between(life.begun, step, begin and begin + margin, end - margin, tag)

    def _moments(self, life: _Life) -> Iterator[tuple[int, bool]]:
        """Steps at which the robot does something of an act, or does nothing of it."""
        if life.survived is not None:
            yield life.survived, False
        if life.left is not None and not life.left_by:
            move = self._followed[life.left].move
            yield life.left, life.winds_down or (move is not None and move.kind == "lost")

    def _while_it_winds_down(self, life: _Life, left: int, levels: Mapping[Tag, int]) -> Iterator[TimeBound]:
        tag = ("cancel", life.task)
        seconds = CANCEL_LIMIT if levels.get(tag, 0) else STOPPING
        if life.gone is not None and life.gone_by_itself:
            yield from _between(left, life.gone, seconds, seconds, tag)
        else:
            yield from _between(left, self._last if life.gone is None else life.gone, None, seconds - _LEAST, tag)

    def _of_countdowns(self) -> Iterator[TimeBound]:
        begun: dict[int, int] = {}
        for step, followed in enumerate(self._followed):
            for number, countdown in followed.countdowns.items():
                begun.setdefault(number, step)
                is_last = step == self._last or number not in self._followed[step + 1].countdowns
                if not is_last:
                    continue
                tag: Tag = ("timer", number)
                seconds = countdown.length / 1000
                until = min(step + 1, self._last)
                elapses = until > step and self._followed[until].timer > 0
                if until > step and self._followed[until].timer == number:
                    yield from _between(begun[number], until, seconds, seconds, tag)
                else:
                    yield from _between(begun[number], until, None, seconds - (0.0 if elapses else _LEAST), tag)

    def _of_stops(self) -> Iterator[TimeBound]:
        asked: int | None = None
        for step, followed in enumerate(self._followed):
            if followed.move is None:
                continue
            if followed.move.kind == "stop":
                asked = step
            elif followed.move.kind == "stopped" and asked is not None:
                yield from _between(asked, step, ALL_STOPPED, ALL_STOPPED, ("stop", step))
                asked = None
        if asked is not None:
            yield from _between(asked, self._last, None, ALL_STOPPED - _LEAST, ("stop", asked))

    # --- how bounds give way ------------------------------------------------------------------------------------------

    def _costs(self, tag: Tag, courses: Mapping[TaskId, ActCourse]) -> Sequence[int]:
        match tag:
            case ("gap", int(step)):
                move = self._followed[step].move
                return (1,) * (len(GAPS) - 1) if move is not None and is_free(move) else (3,)
            case ("act", int(task)):
                return [2 if isinstance(manner, int) else 4 for manner in self._manners(self._life(task))[1:]]
            case ("cancel", _):
                return (6,)
            case ("fail", int(task)):
                life = self._life(task)
                return (2,) * (len(self._slips(life, courses[task])) - 1)
            case ("part", int(task), int(step)):
                on_robot = dict(self._moments(self._life(task)))[step]
                return (2,) * (len(courses[task].parts(on_robot=on_robot)) - 1)
            case _:
                return ()

    def _manners(self, life: _Life) -> list[Manner]:
        """In which ways an act can take its time, the simplest first."""
        if life.left_by == "failed":
            return [""]
        again: list[Manner] = []
        if life.task in self._again:
            again = [*range(2, MOST_AGAIN)] if life.left_by == "succeeded" else [MOST_AGAIN]
        return ["", *again, "slower", "at any pace"]

    def _manner(self, life: _Life, levels: Mapping[Tag, int]) -> Manner:
        return self._manners(life)[levels.get(("act", life.task), 0)]

    def _life(self, task: TaskId) -> _Life:
        return next(life for life in self._lives if life.task == task)

    def _slips(self, life: _Life, course: ActCourse) -> list[tuple[Slip, float]]:
        """How an act can fail as it does in the path, and after how many seconds."""
        assert life.left is not None
        failing = [span for span in course.spans if span.may_fail]
        before = self._followed[life.left - 1].situation
        if life.doomed or before.robot_lost:
            return [(("by itself", span.id), span.begin) for span in failing]
        found: list[tuple[Slip, float]] = []
        for span in failing:
            found.append((("abort" if life.aborted else "fail", span.id), (span.begin + span.end) / 2))
        if not life.aborted:
            found += [(("reject", span.id), span.begin + REFUSING) for span in failing]
        alone = [each for each in found if not _is_beside_others(course, *each)]
        beside = [each for each in found if _is_beside_others(course, *each)]
        if life.winds_down:
            return beside
        return alone + [(slip, at + STOPPING) for slip, at in beside]  # what else it does is over a moment later

    # --- the plan -----------------------------------------------------------------------------------------------------

    def _planned(
        self, times: Sequence[float], levels: Mapping[Tag, int], courses: Mapping[TaskId, ActCourse]
    ) -> PlannedTimes:
        faults: list[str] = []
        factors: dict[tuple[TaskId, ActionId], float] = {}
        spoilt: set[tuple[TaskId, ActionId]] = set()
        for life in self._lives:
            task = life.task
            pauses = {(task, action): factor for action, factor in self._pauses(life).items()}
            factors |= {action: factor for action, factor in pauses.items() if action in self.known.goals}
            if life.left_by == "failed" and (slips := self._slips(life, courses[task])):
                how, action = slips[min(levels.get(("fail", task), 0), len(slips) - 1)][0]
                if how != "by itself" and (goal := self.known.goals.get((task, action))) is not None:
                    spoilt.add((task, action))
                    faults.append(f"{goal[0]}={how}@{goal[1]}")
            elif life.winds_down and levels.get(("cancel", task), 0):
                assert life.left is not None
                at = min(times[life.left] - times[life.begun], courses[task].length - _LEAST)
                running = [span for span in courses[task].spans if span.on_robot and span.begin <= at < span.end]
                for span in running[-1:]:
                    if (goal := self.known.goals.get((task, span.id))) is not None:
                        spoilt.add((task, span.id))
                        faults.append(f"{goal[0]}=slow-cancel:{CANCEL_LIMIT:g}@{goal[1]}")
            elif not pauses and isinstance(manner := self._manner(life, levels), str) and manner:
                factors |= self._slowed(life, times, courses[task])
        faults += [f"{goal[0]}=slow:{factor:g}@{goal[1]}" for goal, factor in self._of_goals(factors)]
        return PlannedTimes(tuple(times), (*faults, *self._vanishing(times)), factors, frozenset(spoilt))

    def _of_goals(self, factors: Mapping[tuple[TaskId, ActionId], float]) -> Iterator[tuple[GoalNumber, float]]:
        for action, factor in factors.items():
            yield self.known.goals[action], factor

    def _slowed(self, life: _Life, times: Sequence[float], course: ActCourse) -> dict[tuple[TaskId, ActionId], float]:
        """The actions that take longer or shorter, so that the act ends when it is to end."""
        last = self._last if life.left is None else life.left
        length = times[last] - times[life.begun]
        if life.left_by != "succeeded":
            if length < course.length - _LEAST:
                return {}
            length += LONGER
        able = [action for task, action in self.known.goals if task == life.task]
        act = self._scenario.acts[life.name]
        if abs(length - course.length) < 1e-4:
            return {}
        found = slowed(self._scenario, act, self._memory, self._seconds(life), length, able, self._pace)
        return {(life.task, action): factor for action, factor in found.items()}

    def _vanishing(self, times: Sequence[float]) -> Iterator[str]:
        lost: float | None = None
        for step, followed in enumerate(self._followed):
            if followed.move is None:
                continue
            if followed.move.kind == "lost":
                lost = times[step]
            elif followed.move.kind == "back" and lost is not None:
                yield f"vanish@{lost:.3f}-{times[step]:.3f}"
                lost = None
        if lost is not None:
            yield f"vanish@{lost:.3f}"


def _between(earlier: int, later: int, least: float | None, most: float, tag: Tag) -> Iterator[TimeBound]:
    """Bounds for how long after one step another comes."""
    if least is not None:
        yield TimeBound(earlier, later, least, tag)
    yield TimeBound(later, earlier, -most, tag)


def _is_beside_others(course: ActCourse, slip: Slip, at: float) -> bool:
    """Whether the robot does something else of the act at that moment."""
    return any(span.id != slip[1] and span.on_robot and span.begin <= at < span.end for span in course.spans)


def _lives_in(followed: Sequence[Followed]) -> list[_Life]:
    lives: dict[TaskId, _Life] = {}
    for step, each in enumerate(followed):
        for task, (name, phase) in each.running.items():
            if task not in lives:
                lives[task] = _Life(task, name, step)
                if phase not in ("running", "doomed"):  # it fails in the moment in which it begins
                    lives[task].left, lives[task].winds_down = step, True
            life = lives[task]
            life.doomed = life.doomed or phase == "doomed"
        if step == 0 or each.move is None:
            continue
        for life in lives.values():
            if life.begun < step and life.gone is None:
                _live_on(life, step, each)
    return [*lives.values()]


def _live_on(life: _Life, step: int, each: Followed) -> None:
    """What a step makes of an act."""
    move = each.move
    assert move is not None
    now = each.running.get(life.task)
    by_itself = move.kind == "end" and each.task == life.task
    if life.left is None:
        if now is None or now[1] not in ("running", "doomed"):
            life.left = step
            life.aborted = by_itself and move.how == "aborted"
            life.left_by = "failed" if life.aborted else move.how if by_itself else ""
            life.winds_down = now is not None
        elif by_itself and move.how == "accepted":
            life.voice.append(step)
        elif move.kind == "lost":
            life.survived = step
    if now is None:
        life.gone = step
        life.gone_by_itself = by_itself
