"""Translates executable content of a chart to functions of a rule, by the knowledge of the variables at that place.

The same code determines the knowledge after a block, so that `rise_exchange.scxml.rules_of_chart` can follow it through
the whole flat chart. With complete knowledge, it writes the block.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from msgspec import Struct

from rise_engine.expression import Assignment, Expression, ExpressionError
from rise_engine.scenario.model import SourceLocation
from rise_exchange.scxml.chart import (
    ERROR,
    AssignNode,
    CallNode,
    CancelNode,
    Content,
    FailNode,
    ForEachNode,
    IfNode,
    Node,
    RaiseNode,
    SendNode,
    SendPlace,
)
from rise_exchange.scxml.script import UNDECLARED, ChartRefusedError, Constant, Script
from rise_exchange.scxml.translation import (
    REFUSED,
    Kind,
    Knowledge,
    Possible,
    TranslatedValue,
    known_constant,
    translate_condition,
    translate_value,
    value_beforehand,
)


class FunctionLine(Struct, frozen=True):
    """`<function NAME="ARGUMENT"/>`."""

    name: str
    argument: str


class IfLines(Struct, frozen=True):
    """`<if>` with its branches; the condition of an `<else>` is None."""

    branches: tuple[tuple[str | None, Lines], ...]


Lines: TypeAlias = tuple[FunctionLine | IfLines, ...]
Report: TypeAlias = Callable[[str, SourceLocation, str], None]
"""Receives the code, the place and the sentence of a diagnostic."""

MAX_PENDING = 4
"""Maximum number of pending events of one `<send>`. A rule waits for each."""
_BOOLEAN: frozenset[Kind] = frozenset({"boolean"})


class SendHelper(Struct, frozen=True):
    """A rule that waits before a `<send>` takes effect, and the key that is true meanwhile. A `<send>` may need
    several."""

    place: SendPlace
    rule: str
    key: str

    @property
    def start(self) -> Lines:
        """Lines that start it and set its key."""
        return (FunctionLine("assignValue", f"{self.key} = true"), FunctionLine("startInteractionRule", self.rule))

    @property
    def stop(self) -> Lines:
        """Lines that stop it and clear its key."""
        return (FunctionLine("stopInteractionRule", self.rule), FunctionLine("assignValue", f"{self.key} = false"))


class ContentTranslator:
    """Translates blocks of content."""

    def __init__(self, helpers: list[SendHelper], report: Report, follows_values: bool = False) -> None:
        """
        :param helpers: the rules for delayed sends.
        :param report: receives diagnostics.
        :param follows_values: whether to follow the values of variables, not only their kinds.
        """
        self.helpers: dict[SendPlace, list[SendHelper]] = {}
        for helper in helpers:
            self.helpers.setdefault(helper.place, []).append(helper)
        self.follows_values = follows_values
        self.report = report
        self.raised: set[str] = set()
        """Every event that a translated block raises or sends."""
        self.raised_inside: set[str] = set()
        """Those of them that go to the internal queue."""

    def blocks(self, blocks: tuple[Content, ...], known: Knowledge) -> tuple[Lines, Knowledge]:
        """Translate several blocks in sequence. Returns their lines and the knowledge after them."""
        lines: Lines = ()
        for block in blocks:
            more, known, _ = self.content(list(block), known)
            lines += more
        return lines, known

    def content(self, nodes: list[Node], known: Knowledge) -> tuple[Lines, Knowledge, bool]:
        """Translate the rest of a block. Returns its lines, the knowledge after it, and whether an error ends it."""
        lines: list[FunctionLine | IfLines] = []
        while nodes:
            node = nodes.pop(0)
            match node:
                case IfNode():
                    inner, known, ends, used_rest = self.choose(node, nodes, known)
                    lines += inner
                    if ends or used_rest:
                        return tuple(lines), known, ends
                case ForEachNode():
                    entries = self.entries(node, known)
                    if entries is None:
                        return tuple(lines), known, True
                    if isinstance(entries, str):
                        return (*lines, self.fail(ERROR)), known, True
                    nodes[:0] = entries
                case FailNode(event, ends_block):
                    lines.append(self.fail(event))
                    if ends_block:
                        return tuple(lines), known, True
                case AssignNode():
                    line, known = self.assign(node, known)
                    if line is None:
                        return (*lines, self.fail(ERROR)), known, True
                    lines += line
                case _:
                    line, known = self.simple(node, known)
                    lines += line
        return tuple(lines), known, False

    def simple(self, node: Node, known: Knowledge) -> tuple[Lines, Knowledge]:
        match node:
            case RaiseNode(event):
                return (self.fail(event),), known
            case CallNode(function, argument):
                return (FunctionLine(function, argument),), known
            case SendNode(place):
                return self.send(place, known)
            case CancelNode(id):
                return self.cancel(id, known)
        raise AssertionError(node)

    def fail(self, event: str) -> FunctionLine:
        """Raise an event, and note it."""
        self.raised.add(event)
        self.raised_inside.add(event)
        return FunctionLine("raiseEventTopic", f"/{event}")

    # --- sending ---

    def send(self, place: SendPlace, known: Knowledge) -> tuple[Lines, Knowledge]:
        pending = known[pending_name(place)].most
        if self.follows_values and pending == MAX_PENDING:
            message = (
                f"`{place.event}` may be on its way from here {MAX_PENDING} times already when it is sent once more; "
                "give this `<send>` an id, and `<cancel>` it before it is sent again, in `<onexit>`"
            )
            self.report("pending", place.location, message)
        self.raised.add(place.event)
        pending = min(pending + 1, MAX_PENDING)
        after = {
            **known,
            pending_name(place): Possible(_BOOLEAN, None, pending),
            waiting_name(place): Possible(_BOOLEAN, None, 1),
        }
        starts: list[tuple[str, Lines]] = [(f"not {helper.key}", helper.start) for helper in self.helpers[place]]
        if len(starts) == 1:
            return starts[0][1], after
        return (IfLines((*starts[:-1], (None, starts[-1][1]))),), after

    def cancel(self, id: str, known: Knowledge) -> tuple[Lines, Knowledge]:
        lines: Lines = ()
        for place in self.helpers:
            if place.id == id and place.seconds:  # events already in the external queue stay there (6.3)
                lines += self.stop(place, known)
                known = {**known, pending_name(place): Possible(_BOOLEAN), waiting_name(place): Possible(_BOOLEAN)}
        return lines, known

    def stop(self, place: SendPlace, known: Knowledge) -> Lines:
        """Cancel pending events of a `<send>`."""
        if not known[waiting_name(place)].most:
            return ()
        return tuple(IfLines(((helper.key, helper.stop),)) for helper in self.helpers[place])

    # --- values ---

    def assign(self, node: AssignNode, known: Knowledge) -> tuple[Lines | None, Knowledge]:
        """Translate an assignment. None instead of lines: it certainly fails."""
        name = node.name
        if name is None or node.value.root is None:
            return None, known
        first = name.split(".")[0].split("[")[0].strip()
        is_there = known.get(first)
        if not node.declares and (is_there is None or is_there.kinds == {"undeclared"}):
            return None, known
        if first != name:
            self.report("expression", node.location, f"`{name}` is a part of a value; only whole variables can be set")
            return (), known
        if not node.declares and is_there is not None and "undeclared" in is_there.kinds:
            self.report("expression", node.location, f"`{name}` may not be declared by then; declare it with `<data>`")
            return (), {**known, name: REFUSED}
        constant = known_constant(node.value.root, known)
        if constant is not None and constant.kinds == {"list"}:
            return (), {**known, name: constant}  # read only by a `<foreach>`
        try:
            translated = translate_value(node.value.root, known)
        except ChartRefusedError as error:
            if error.code == UNDECLARED:
                return None, known
            self.report(error.code, node.value.location, str(error))
            return (), {**known, name: REFUSED}
        if "list" in translated.value.kinds:
            message = "this may be a list or something else; only lists that are written out can be taken over"
            self.report("list-arithmetic", node.value.location, message)
            return (), {**known, name: REFUSED}
        if self.is_refused_name(name, node.location):
            return (), {**known, name: REFUSED}
        value = Possible(
            translated.value.kinds, value_beforehand(node.value.root, known) if self.follows_values else None
        )
        return (FunctionLine("assignValue", f"{name} = {translated.text}"),), {**known, name: value}

    def is_refused_name(self, name: str, location: SourceLocation) -> bool:
        """Whether our memory refuses this name of a variable. If so, it is reported."""
        try:
            is_key = name != "session" and Expression.parse(name).bare_key == name
            Assignment.parse(f"{name} = 1")
        except ExpressionError:
            is_key = False
        if not is_key:
            self.report("data", location, f"`{name}` cannot be the name of a key here; call the variable otherwise")
        return not is_key

    def entries(self, node: ForEachNode, known: Knowledge) -> list[Node] | str | None:
        """Unroll a loop; `failed`: it certainly fails; None after a diagnostic."""
        if node.array.root is None or node.item is None:
            return "failed"
        array = known_constant(node.array.root, known)
        if array is None or array.kinds != {"list"}:
            try:
                translated = translate_value(node.array.root, known)
            except ChartRefusedError as error:
                if error.code == UNDECLARED:
                    return "failed"
                self.report(error.code, node.array.location, str(error))
                return None
            if not translated.value.kinds & {"list", "refused"}:
                return "failed"  # nothing to iterate over
            message = "this list is only known while the chart runs; only a list that never changes can be converted"
            self.report("list-arithmetic", node.array.location, message)
            return None
        found: list[Node] = []
        for number, entry in enumerate(array.constant):
            found.append(self.set_constant(node.item, entry, node))
            if node.index:
                found.append(self.set_constant(node.index, Constant(number), node))
            found += node.body
        return found

    def set_constant(self, name: str, value: Constant, node: ForEachNode) -> Node:
        return AssignNode(name, Script("", value, node.location), node.location, declares=True)

    # --- choices ---

    def choose(self, node: IfNode, rest: list[Node], known: Knowledge) -> tuple[Lines, Knowledge, bool, bool]:
        """Translate an `<if>`. If an error ends one of its branches, the rest of the block moves into the others.

        :return: the lines, the knowledge, whether an error ends the block, and whether the lines already include the
            rest.
        """
        branches: list[tuple[str | None, Content]] = []
        before: list[FunctionLine | IfLines] = []
        for condition, inner in node.branches:
            if condition is None:
                branches.append((None, inner))
                break
            translated = self.condition(condition, known)
            if translated is None:  # it raises an error, and counts as false
                if branches:
                    self.report("condition-error", condition.location, "this condition may fail; write two `<if>`s")
                before.append(self.fail(ERROR))
            elif translated.truth is None:
                branches.append((translated.text, inner))
            elif translated.truth:
                branches.append((None, inner))
                break
        if not branches:
            return tuple(before), known, False, False
        if branches[0][0] is None:  # the branch is known
            rest[:0] = list(branches[0][1])
            return tuple(before), known, False, False
        if branches[-1][0] is not None:
            branches.append((None, ()))
        done = [(text, *self.content(list(inner), known)) for text, inner in branches]
        used_rest = any(ends for *_, ends in done) and bool(rest)
        if used_rest:
            done = [(text, *self.content([*inner, *rest], known)) for text, inner in branches]
        behind = done[0][2]
        for _, _, after, _ in done[1:]:
            behind = joined(behind, after)
        written = [(text, lines) for text, lines, _, _ in done]
        if not written[-1][1]:
            written.pop()
        has_lines = any(lines for _, lines in written)
        lines = (*before, *((IfLines(tuple(written)),) if has_lines else ()))
        return lines, behind, all(ends for *_, ends in done), used_rest

    def condition(self, script: Script, known: Knowledge) -> TranslatedValue | None:
        """Translate a condition; None: evaluating it is certainly an error."""
        if script.root is None:
            return None
        try:
            translated = translate_condition(script.root, known)
        except ChartRefusedError as error:
            if error.code == UNDECLARED:
                return None
            self.report(error.code, script.location, str(error))
            return TranslatedValue("false", 8, REFUSED, None)
        value = value_beforehand(script.root, known) if self.follows_values else None
        return translated if value is None else TranslatedValue(translated.text, 8, translated.value, bool(value.value))


def pending_name(place: SendPlace) -> str:
    """The name for the number of possibly pending events of a `<send>`; no variable has this name."""
    return f"pending {place.number}"


def waiting_name(place: SendPlace) -> str:
    """The name for whether any event of it may be pending, even if another `<send>` sends the same event."""
    return f"waiting {place.number}"


def joined(one: Knowledge, other: Knowledge) -> Knowledge:
    """Return the knowledge where two paths meet."""
    absent = Possible(frozenset({"undeclared"}))
    return {name: one.get(name, absent).joined(other.get(name, absent)) for name in {**one, **other}}
