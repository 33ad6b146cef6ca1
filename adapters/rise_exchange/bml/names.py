"""The input and results of a conversion: a lab's names in BML (`--names FILE`), reasons to refuse it, and losses.

Names are those of targets, as points, and of lexemes, as actions of the robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from itertools import chain
from typing import Any, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.base.text import clean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.toml_files import TomlTable, read_toml
from rise_engine.scenario.model import RobotProfile, SourceLocation
from rise_engine.scenario.parameters import accepts_any_name, listed_names

TIME = "bml-time"
"""The code of errors: a time that an act cannot keep exactly."""
NAME = "bml-name"
"""The code of errors: an unknown target or lexeme."""
NO_ACTION = "bml-no-action"
"""The code of errors: a behaviour without an action for it."""
FORM = "bml-form"
"""The code of errors: this is not BML 1.0."""


class BmlLoss(Struct, frozen=True):
    """A part of one format that the other lacks, with the reason.

    >>> str(BmlLoss(SourceLocation("hello.xml", 3, 5), "acts have no prosody"))
    'hello.xml:3:5: lost: acts have no prosody'
    """

    location: SourceLocation
    message: str

    def __str__(self) -> str:
        """One line, without control characters for a terminal."""
        return clean(f"{self.location}: lost: {self.message}")


class ConversionFindings:
    """Collects all reasons to refuse a conversion, and its losses."""

    def __init__(self) -> None:
        self.diagnostics = Diagnostics()
        """The reasons to refuse it."""
        self._losses: list[BmlLoss] = []

    def lose(self, location: SourceLocation, message: str) -> None:
        """Add a part that the other format lacks."""
        self._losses.append(BmlLoss(location, message))

    @property
    def losses(self) -> list[BmlLoss]:
        """The losses in reading order, each once."""
        return sorted(set(self._losses), key=_reading_order)


def _reading_order(loss: BmlLoss) -> tuple[str, int, int, str]:
    return loss.location.file, loss.location.line, loss.location.column, loss.message


LexemeKind: TypeAlias = Literal["head", "gesture", "posture", "face"]
KINDS: tuple[LexemeKind, ...] = ("head", "gesture", "posture", "face")
_AXES = ("x", "y", "z")
_TYPES: dict[LexemeKind, tuple[str, ...]] = {
    "head": ("Animation",),
    "gesture": ("Animation",),
    "posture": ("Animation",),
    "face": ("Emotion", "SocialExpression", "Animation"),
}
"""The action types of a lexeme; a text alone means the first."""
_USUAL: dict[LexemeKind, dict[str, tuple[str, str]]] = {
    "head": {"NOD": ("Animation", "head_nod"), "SHAKE": ("Animation", "head_shake")},
    "gesture": {},
    "posture": {},
    "face": {"RAISE_BROWS": ("Animation", "eyebrows_raise"), "LOWER_BROWS": ("Animation", "eyebrows_lower")},
}
"""BML 1.0's lexemes with an exact counterpart in every robot's actions."""


class TargetPoint(Struct, frozen=True):
    """The place of a target for `LookAt` and `PointAt`: texts in metres."""

    x: str
    y: str
    z: str
    frame: str = ""
    """Empty: the robot's base frame."""

    @property
    def numbers(self) -> tuple[Decimal, Decimal, Decimal, str] | None:
        """The numbers for comparing two points; None if one of them comes from the memory."""
        try:
            return Decimal(self.x), Decimal(self.y), Decimal(self.z), self.frame
        except InvalidOperation:
            return None


class BmlNames(Struct, frozen=True):
    """The known names."""

    robot: RobotProfile
    targets: dict[str, TargetPoint] = {}
    lexemes: dict[LexemeKind, dict[str, tuple[str, str]]] = field(default_factory=lambda: {kind: {} for kind in KINDS})
    """By kind and lexeme, the action's type and its `value`."""

    def find_lexeme(self, kind: LexemeKind, lexeme: str) -> tuple[str, str] | None:
        """The robot's action, from the file, BML's usual names, or the robot's own."""
        given = self.lexemes[kind].get(lexeme) or _USUAL[kind].get(lexeme)
        if given is not None:
            return given
        own = list(self._own_names(kind))
        folded = lexeme.casefold()
        return next(
            chain(
                (each for each in own if each[1] == lexeme),
                (each for each in own if each[1].casefold() == folded),
            ),
            None,
        )

    def lexeme_of(self, type: str, value: str) -> tuple[LexemeKind, str]:
        """BML's name for an action, from the file, BML's usual names, or the robot's own."""
        for table in (self.lexemes, _USUAL):
            for kind in KINDS:
                for lexeme, meant in table[kind].items() if kind != "posture" else ():  # a movement is not a posture
                    if meant == (type, value) and self.find_lexeme(kind, lexeme) == meant:
                        return kind, lexeme
        return ("gesture" if type == "Animation" else "face"), value

    def target_of(self, point: TargetPoint) -> str | None:
        """The name of a point, if it has one."""
        wanted = point.numbers
        return next(
            (name for name, each in self.targets.items() if wanted is not None and each.numbers == wanted), None
        )

    def unknown_lexeme(self, kind: LexemeKind, lexeme: str) -> str:
        """The message about an unknown lexeme."""
        known = [*self.lexemes[kind], *_USUAL[kind], *(value for _, value in self._own_names(kind))]
        near = did_you_mean(lexeme, dict.fromkeys(known))
        return f"`{lexeme}` has no meaning here{near}; give it a line under [{kind}] in the file of --names"

    def unknown_target(self, target: str) -> str:
        """The message about an unknown target."""
        near = did_you_mean(target, self.targets)
        return (
            f"`{target}` has no place here{near}; give it a line under [targets] in the file of --names: "
            f"{target} = {{ x = 1.5, y = 0, z = 1.2 }}"
        )

    def _own_names(self, kind: LexemeKind) -> Iterator[tuple[str, str]]:
        for type in _TYPES[kind]:
            spec = self.robot.actions.get(type)
            if spec is not None and spec.supported and "value" in spec.parameters:
                yield from ((type, name) for name in listed_names(spec.parameters["value"]))


def read_names(source: SourceFile, robot: RobotProfile, diagnostics: Diagnostics) -> BmlNames:
    """Read a file of names. Errors become diagnostics.

    :param source: the TOML file.
    :param robot: the robot of the named actions.
    """
    file = read_toml(source, diagnostics)
    if file is None:
        return BmlNames(robot)
    table = TomlTable(file, (), file.values, diagnostics)
    table.report_unknown_keys(("targets", *KINDS))
    targets = table.section("targets")
    points = {name: point for name in targets.values if (point := _read_point(targets, name)) is not None}
    lexemes: dict[LexemeKind, dict[str, tuple[str, str]]] = {}
    for kind in KINDS:
        section = table.section(kind)
        read = {lexeme: _read_lexeme(section, lexeme, kind, robot) for lexeme in section.values}
        lexemes[kind] = {lexeme: meant for lexeme, meant in read.items() if meant is not None}
    return BmlNames(robot, points, lexemes)


def _read_point(targets: TomlTable, name: str) -> TargetPoint | None:
    form = f"`{name}` is a point: {name} = {{ x = 1.5, y = 0, z = 1.2 }}, in metres"
    point = targets.subtable(name, form)
    if point is None:
        return None
    point.report_unknown_keys((*_AXES, "frame"))
    numbers = [point.values.get(axis) for axis in _AXES]
    frame = point.values.get("frame", "")
    if not all(_is_number(each) for each in numbers) or not isinstance(frame, str):
        targets.report_key("wrong-type", form, name)
        return None
    x, y, z = (f"{each:.15g}" for each in numbers if each is not None)
    return TargetPoint(x, y, z, frame)


def _read_lexeme(section: TomlTable, lexeme: str, kind: LexemeKind, robot: RobotProfile) -> tuple[str, str] | None:
    types = _TYPES[kind]
    written = section.values[lexeme]
    type, value = (
        next(iter(written.items())) if isinstance(written, dict) and len(written) == 1 else (types[0], written)
    )
    if type not in types or not isinstance(value, str):
        forms = " or ".join(f'{{ {each} = "..." }}' for each in types)
        section.report_value("wrong-type", lexeme, f"a lexeme of [{kind}] is what the robot does: {forms}")
        return None
    spec = robot.actions.get(type)
    if spec is None or not spec.supported:
        section.report_value("robot-cannot", lexeme, f"the robot {robot.title} (`{robot.name}`) has no `{type}`")
        return None
    known = listed_names(spec.parameters["value"])
    if value not in known and not accepts_any_name(spec.parameters["value"]):
        near = did_you_mean(value, known) or f"; known: {in_backquotes(known[:12])}"
        section.report_value("unknown-name", lexeme, f"this robot has no `{value}` for `{type}`{near}")
        return None
    return type, value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
