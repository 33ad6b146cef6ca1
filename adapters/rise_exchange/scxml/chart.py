"""A statechart of SCXML 1.0 (https://www.w3.org/TR/scxml/, section 3): states, transitions, executable content.

It contains only parts that can become rules; `rise_exchange.scxml.reading` refuses the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import SourceLocation
from rise_exchange.scxml.script import Script

StateKind = Literal["scxml", "state", "parallel", "final", "history"]
ERROR = "error.execution"
"""The event of a failed execution (3.12.2)."""


class RaiseNode(Struct, frozen=True):
    """`<raise>`, `<send target="#_internal">`, and events that the standard itself raises: into the internal queue."""

    event: str


class AssignNode(Struct, frozen=True):
    """`<assign>`, or one statement of a `<script>`."""

    name: str | None
    """The variable; None: its name is invalid, so the assignment fails."""
    value: Script
    location: SourceLocation
    declares: bool = False
    """Whether it creates its variable, as an assignment in a script does."""


class IfNode(Struct, frozen=True):
    """`<if>` with its branches; the condition of an `<else>` is None."""

    branches: tuple[tuple[Script | None, Content], ...]
    location: SourceLocation


class ForEachNode(Struct, frozen=True):
    """`<foreach>`."""

    array: Script
    item: str | None
    """None: it is no variable's name, so the loop fails."""
    index: str | None
    body: Content
    location: SourceLocation


class SendNode(Struct, frozen=True):
    """`<send>` to the chart itself through the external queue (6.2)."""

    place: SendPlace


class SendPlace(Struct, frozen=True):
    """One `<send>` of a chart, with its event and delay."""

    number: int
    """From 1, in the order of the file."""
    event: str
    seconds: float
    """0: immediately, but after the internal queue."""
    id: str
    """The name for `<cancel>`; may be empty."""
    location: SourceLocation


class CancelNode(Struct, frozen=True):
    """`<cancel>` (6.3)."""

    id: str


class CallNode(Struct, frozen=True):
    """`<send type="x-rise">`: a function of a rule, such as `startCommunicationRobotAct`."""

    function: str
    argument: str


class FailNode(Struct, frozen=True):
    """Content that certainly fails: it raises an error event, and perhaps ends its block."""

    event: str
    ends_block: bool


Node: TypeAlias = RaiseNode | AssignNode | IfNode | ForEachNode | SendNode | CancelNode | CallNode | FailNode
Content: TypeAlias = tuple[Node, ...]
"""A block of executable content; an error skips the rest of it (4.9)."""


class ChartTransition(Struct, eq=False):
    """A `<transition>`."""

    source: ChartState
    events: tuple[str, ...] | None
    """Event descriptors without a final `.*`, `*` unchanged; None: eventless."""
    condition: Script | None
    target_ids: tuple[str, ...]
    internal: bool
    content: Content
    order: int
    """Its position among the transitions of the document."""
    location: SourceLocation
    targets: tuple[ChartState, ...] = ()
    """Empty: targetless."""


class ChartState(Struct, eq=False):
    """A state, including parallel, final and history states; the root is the `<scxml>` element itself."""

    id: str
    kind: StateKind
    parent: ChartState | None
    order: int
    """Its position in document order; the root has 0."""
    location: SourceLocation
    children: list[ChartState] = []
    """Its children without histories."""
    histories: list[ChartState] = []
    on_entry: list[Content] = []
    on_exit: list[Content] = []
    transitions: list[ChartTransition] = []
    initial: ChartTransition | None = None
    """For a compound state: its initial transition. For a history: its transition before anything is remembered."""
    is_deep: bool = False
    """For a history."""

    @property
    def is_atomic(self) -> bool:
        return not self.children and self.kind in ("state", "final")

    @property
    def is_compound(self) -> bool:
        return bool(self.children) and self.kind in ("state", "scxml")

    def ancestors(self, below: ChartState | None = None) -> Iterator[ChartState]:
        """The states around it, the innermost first, up to but without `below`."""
        state = self.parent
        while state is not None and state is not below:
            yield state
            state = state.parent

    def is_inside(self, other: ChartState) -> bool:
        """Whether it is a descendant of another state (not that state itself)."""
        return any(state is other for state in self.ancestors())


class ChartVariable(Struct, frozen=True):
    """A `<data>`: a variable that is set when the chart starts."""

    name: str
    value: Script | None
    """None: it exists, but is undefined."""
    location: SourceLocation


class Chart(Struct):
    """A whole document."""

    name: str
    """Empty if the document has none."""
    root: ChartState
    states: dict[str, ChartState]
    variables: list[ChartVariable]
    scripts: Content
    """The content of the document's `<script>`, run when the chart starts."""
    places: list[SendPlace]
    notes: list[str]
    """Omissions, for a person."""
    outside: tuple[str, ...] = ()
    """Further events from outside, in addition to those that the chart names."""
