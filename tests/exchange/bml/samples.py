"""Blocks of BML, read for tests."""

from __future__ import annotations

from msgspec import Struct
from rise_exchange.bml.names import BmlNames, ConversionFindings, TargetPoint
from rise_exchange.bml.reading import ReadAct, read_act
from rise_exchange.bml.vocabulary import NAMESPACE

from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Act, RobotProfile

ROBOT: RobotProfile = load("scenarios/greeting").robot
NAMES = BmlNames(
    ROBOT,
    {"visitor": TargetPoint("1.5", "0", "1.2"), "door": TargetPoint("-1", "2", "0", "map")},
    {
        "head": {},
        "gesture": {"BEAT": ("Animation", "engagement_left")},
        "posture": {"SITTING": ("Animation", "idle")},
        "face": {"smile": ("Emotion", "happy")},
    },
)


class Reading(Struct, frozen=True):
    """What has come of a block."""

    read: ReadAct | None
    errors: list[str]
    losses: list[str]

    @property
    def act(self) -> Act:
        assert self.read is not None, self.errors
        return self.read.act

    @property
    def waits(self) -> dict[str, tuple[str, ...]]:
        """What each action waits for."""
        return {action.id: action.wait_for for action in self.act.actions}

    @property
    def does(self) -> dict[str, dict[str, str]]:
        """The parameters of each action, and its type."""
        return {
            action.id: {"type": action.calls[0].type}
            | {name: template.text for name, template in action.calls[0].parameters.items()}
            for action in self.act.actions
        }


def block(inside: str, attributes: str = 'id="b"', namespace: str = NAMESPACE) -> str:
    """A block; what is inside begins in line 2."""
    return f'<bml xmlns="{namespace}" {attributes}>\n{inside}\n</bml>\n'


def read_text(text: str, names: BmlNames = NAMES) -> Reading:
    """Read a whole file."""
    findings = ConversionFindings()
    read = read_act(SourceFile("b.xml", text.encode(), text), names, findings)
    return Reading(read, [str(each) for each in findings.diagnostics.sorted()], [str(each) for each in findings.losses])


def read(inside: str, attributes: str = 'id="b"') -> Reading:
    """Read what stands in a block."""
    return read_text(block(inside, attributes))


def parts(act: Act) -> list[object]:
    """What of an act has to come back."""
    return [act.name, [(each.id, each.calls, each.wait_for, each.continue_on_failure) for each in act.actions]]
