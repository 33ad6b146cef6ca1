"""Exports a rule as an SCXML document (https://www.w3.org/TR/scxml/), with the datamodel `ecmascript`.

docs/reference/scxml.md describes the requirements of a document on its interpreter. In short: states are flat. A rule's
functions go to the event I/O processor `x-rise` (section 6.2). Acts, other rules and changes of the memory come back as
external events. An event that the rule raises only for itself goes to its own external queue, behind the waiting
events, because our sessions have one queue of events.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.sax.saxutils import escape

from rise_engine.base.text import clean
from rise_engine.scenario.model import (
    Block,
    Delay,
    Function,
    If,
    OneOf,
    Rule,
    Scenario,
    State,
    Transition,
    normal_topic,
    result_topics,
)
from rise_exchange.scxml.expressions import assignment_code, condition_code, delay_code, json_code, text_code
from rise_exchange.scxml.limits import RuleAnalysis, find_losses

NAMESPACE = "http://www.w3.org/2005/07/scxml"
RISE_NAMESPACE = "urn:x-rise"
"""The namespace of additions for people and for reading back: `rise:name`, `rise:priority`, `rise:cond`."""
PROCESSOR = "x-rise"
"""The type of the event I/O processor that runs functions."""

_MEMORY_EVENTS = "memory forgotten"


def export_rule(scenario: Scenario, rule: Rule, *, seed: int = 1) -> str:
    """Return the document of a rule that is not refused (`rise_exchange.scxml.limits.find_refusals`).

    :param seed: the seed of the session's random choices.
    """
    return _Document(scenario, rule, seed).text()


class _Document:
    def __init__(self, scenario: Scenario, rule: Rule, seed: int) -> None:
        self._scenario = scenario
        self._rule = rule
        self._seed = seed
        self._analysis = RuleAnalysis(scenario, rule)
        self._ids = {name: f"s{number}" for number, name in enumerate(rule.states)}
        self._results = dict(result_topics(rule))

    def text(self) -> str:
        """The whole document."""
        states = [line for state in self._rule.states.values() for line in self._state(state)]
        helpers = helpers_for("\n".join(states))
        head = _tag(
            "scxml",
            xmlns=NAMESPACE,
            xmlns__rise=RISE_NAMESPACE,
            version="1.0",
            datamodel="ecmascript",
            name=_identifier(self._rule.name),
            initial=self._ids[self._rule.initial],
            rise__name=self._rule.name,
            rise__priority=f"{self._rule.priority:g}" if self._rule.priority else None,
        )
        script = ["", *_indent("\n\n".join(helpers).splitlines()), ""] if helpers else []
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            _comment("\n".join(self._about())),
            f"{head}>",
            *_indent(self._datamodel(states, helpers)),
            *([f"  <script>{_cdata(script)}</script>"] if script else []),
            *_indent(states),
            "</scxml>",
        ]
        return "\n".join(line.rstrip() for line in lines) + "\n"

    def _about(self) -> Iterator[str]:
        """The document's origin and its losses, for readers."""
        yield f"The rule {self._rule.name} of {self._scenario.title}, made by rise-engine convert to-scxml."
        losses = find_losses(self._scenario, self._rule)
        if losses:
            yield "What it does not have of the rule:"
        yield from (f"- {loss.code}: {clean(loss.message)}" for loss in losses)

    def _datamodel(self, states: list[str], helpers: list[str]) -> Iterator[str]:
        """The data that the states and helpers use."""
        content, code = "\n".join(states), "\n".join((*states, *helpers))
        data = {
            "seed": (text_code(str(self._seed)), "seed" in "".join(helpers)),
            "picked": ("0", 'location="picked"' in content),
            "delay": ("''", 'location="delay"' in content),
            "held": ("[]", 'location="held"' in content),
            "countdown": ("0", "begin(" in content),
            "countdowns": ("[]", "begin(" in content),
        }
        used = {name: value for name, (value, is_used) in data.items() if is_used}
        reads_memory = "memory" in code
        if not used and not reads_memory:
            return
        yield "<datamodel>"
        if reads_memory:
            yield f'  <data id="memory">{escape(json_code(self._analysis.start_memory))}</data>'
        for name, value in used.items():
            yield f"  {_tag('data', id=name, expr=value)}/>"
        yield "</datamodel>"

    # --- states ---

    def _state(self, state: State) -> Iterator[str]:
        id = self._ids[state.id]
        yield ""
        yield _comment(state.id)
        tag = "state" if state.transitions else "final"
        yield f"{_tag(tag, id=id, rise__name=state.id)}>"
        timed = [index for index, transition in enumerate(state.transitions) if transition.after is not None]
        eventless = any(_keeps_flag(transition) for transition in state.transitions)
        beginning = ['<assign location="held" expr="[]"/>'] if eventless else []
        for index in timed:
            if state.transitions[index].held is None:
                beginning += self._countdown(id, index, state.transitions[index].after)
        yield from _indent(_element("onentry", beginning))
        yield from _indent(_element("onentry", self._block(state.on_entry)))
        yield from _indent(_element("onexit", self._block(state.on_exit)))
        yield from _indent(_element("onexit", [_cancel(id, index) for index in timed]))
        if state.transitions and self._analysis.memory_names:
            noted = '<assign location="memory" expr="noted(_event)"/>'
            yield f'  <transition event="{_MEMORY_EVENTS}">{noted}</transition>'
        for index, transition in enumerate(state.transitions):
            yield from _indent(self._transition(id, index, transition))
        if not state.transitions and state.id in self._results:
            result = _tag("param", name="result", expr=text_code(f"/{self._results[state.id]}"))
            yield f"  <donedata>{result}/></donedata>"
        yield f"</{tag}>"

    def _transition(self, state: str, index: int, transition: Transition) -> Iterator[str]:
        content = self._block(transition.block)
        condition = condition_code(transition.condition) if transition.condition is not None else None
        target = self._ids[transition.target] if transition.target is not None else None
        written = transition.condition.text if transition.condition is not None else None
        if transition.after is not None:
            if transition.held is not None:
                yield from self._while(state, index, transition)
            counted = f"_event.data.countdown === countdowns[{index}]"
            name = _countdown_name(state, index)
            both = counted if condition is None else f"{counted} && {_bracketed(condition)}"
            yield from _element("transition", content, event=name, cond=both, target=target, rise__cond=written)
        elif transition.is_eventless:
            assert condition is not None
            if target is None:  # taken when it becomes true, and again only after it was false
                yield from _flag_off(index, condition, [])
                content = [f'<assign location="held[{index}]" expr="true"/>', *content]
                condition = f"!held[{index}] && {_bracketed(condition)}"
            yield from _element("transition", content, cond=condition, target=target, rise__cond=written)
        else:
            events = " ".join(_events_of(transition))
            yield from _element("transition", content, event=events, cond=condition, target=target, rise__cond=written)

    def _while(self, state: str, index: int, transition: Transition) -> Iterator[str]:
        """A `while` transition: counting begins when the condition becomes true, and ends when it becomes false."""
        assert transition.held is not None
        condition, written = condition_code(transition.held), transition.held.text
        yield from _flag_off(index, condition, [_cancel(state, index)])
        begin = [f'<assign location="held[{index}]" expr="true"/>']
        begin += self._countdown(state, index, transition.after)
        yield from _element("transition", begin, cond=f"!held[{index}] && {_bracketed(condition)}", rise__cond=written)

    def _countdown(self, state: str, index: int, after: Delay | None) -> list[str]:
        """Write a delayed event to the document itself. Its number reveals one that was cancelled too late (section
        6.3)."""
        assert after is not None
        name = _countdown_name(state, index)
        number = f"{_tag('param', name='countdown', expr=f'begin({index})')}/>"
        if after.seconds is not None:
            return [f"{_tag('send', event=name, id=name, delay=_seconds_text(after.seconds))}>{number}</send>"]
        assert after.expression is not None
        computed = _tag("assign", location="delay", expr=delay_code(after.expression, after.unit))
        return [
            f"{computed}/>",
            "<if cond=\"delay !== ''\">",
            f"  {_tag('send', event=name, id=name, delayexpr='delay')}>{number}</send>",
            "</if>",
        ]

    # --- functions ---

    def _block(self, block: Block) -> list[str]:
        lines: list[str] = []
        for statement in block:
            match statement:
                case Function():
                    lines += self._function(statement)
                case If():
                    lines += self._if(statement)
                case OneOf():
                    lines += self._one_of(statement)
        return lines

    def _if(self, statement: If) -> Iterator[str]:
        for number, branch in enumerate(statement.branches):
            if branch.condition is None:
                yield "<else/>"
            else:
                tag = _tag(
                    "elseif" if number else "if",
                    cond=condition_code(branch.condition),
                    rise__cond=branch.condition.text,
                )
                yield f"{tag}{'/>' if number else '>'}"
            yield from _indent(self._block(branch.block))
        yield "</if>"

    def _one_of(self, statement: OneOf) -> Iterator[str]:
        yield f'<assign location="picked" expr="below({len(statement.choices)})"/>'
        for number, choice in enumerate(statement.choices):
            word = "elseif" if number else "if"
            yield f'<{word} cond="picked === {number}"{"/>" if number else ">"}'
            yield from _indent(self._block((choice,)))
        yield "</if>"

    def _function(self, function: Function) -> list[str]:
        if function.name == "assignValue":
            return self._assign(function)
        parameters = {"behavior": text_code(function.argument)}
        if function.state is not None:
            parameters["state"] = text_code(function.state)
        if not function.enter:
            parameters["enter"] = "false"
        if function.keep is not None:
            parameters["keep"] = text_code(_seconds_text(function.keep))
        topic = normal_topic(function.argument)
        is_own = function.name == "raiseEventTopic" and function.keep is None and topic in self._analysis.own_topics
        if is_own:
            parameters["own"] = "true"
        call = _call(function.name, parameters)
        return [call, f"{_tag('send', event=event_name(topic))}/>"] if is_own else [call]

    def _assign(self, function: Function) -> list[str]:
        assignment = function.assignment
        assert assignment is not None
        code = assignment_code(assignment, self._scenario)
        key = text_code(assignment.key)
        if "." in assignment.key:
            key = f"changedKey({key})"
        return [
            f"{_tag('assign', location='memory', expr=code)}/>",
            _call("assignValue", {"key": key, "value": f"memory[{key}]"}),
        ]


def _keeps_flag(transition: Transition) -> bool:
    """Whether the document must remember that the condition held."""
    return transition.held is not None or (transition.is_eventless and transition.target is None)


def _flag_off(index: int, condition: str, also: list[str]) -> list[str]:
    content = [f'<assign location="held[{index}]" expr="false"/>', *also]
    return _element("transition", content, cond=f"held[{index}] && !{_bracketed(condition)}")


def _bracketed(condition: str) -> str:
    """A condition as an operand."""
    return condition if re.fullmatch(r"!?\w+\([^()]*\)", condition) else f"({condition})"


def _events_of(transition: Transition) -> Iterator[str]:
    if transition.event is not None:
        yield event_name(transition.event)
    else:
        assert transition.ended is not None
        own_end = f"ended.{event_name(transition.ended)}"
        yield from (f"{own_end}.{outcome}" for outcome in transition.outcomes)
        if not transition.outcomes:
            yield own_end


def _countdown_name(state: str, index: int) -> str:
    return f"after.{state}.{index}"


def _cancel(state: str, index: int) -> str:
    return f"{_tag('cancel', sendid=_countdown_name(state, index))}/>"


def _call(function: str, parameters: dict[str, str]) -> str:
    """A function of a task, for the interpreter."""
    params = "".join(f"{_tag('param', name=name, expr=code)}/>" for name, code in parameters.items())
    return f"{_tag('send', type=PROCESSOR, event=function)}>{params}</send>"


def _seconds_text(seconds: float) -> str:
    """A time in CSS form, `1.5s`."""
    return f"{seconds:.6f}".rstrip("0").rstrip(".") + "s"


# --- writing XML ---


def _tag(tag: str, /, **attributes: str | None) -> str:
    """Write the start of a tag, without its end; `__` in a name is a colon."""
    given = ((key.replace("__", ":"), value) for key, value in attributes.items() if value is not None)
    return f"<{tag}" + "".join(f' {key}="{escape(value, _QUOTES)}"' for key, value in given)


_QUOTES = {'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


def _element(tag: str, content: list[str], /, **attributes: str | None) -> list[str]:
    """Write an element with its content; nothing without attributes and content."""
    if not content:
        return [f"{_tag(tag, **attributes)}/>"] if attributes else []
    return [f"{_tag(tag, **attributes)}>", *_indent(content), f"</{tag}>"]


def _indent(lines: Iterable[str]) -> Iterator[str]:
    return (f"  {line}" if line else "" for line in lines)


def _comment(text: str) -> str:
    """Write a comment, which cannot contain `--`."""
    return f"<!-- {re.sub('-(?=-)', '- ', text)}{' ' if not text.endswith('-') else '. '}-->"


def _cdata(lines: list[str]) -> str:
    return "<![CDATA[" + "\n".join(lines) + "]]>"


def _identifier(name: str) -> str:
    """A name that is an identifier in every language; `rise:name` has the full name."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return found if re.match("[A-Za-z_]", found) else f"_{found}"


# --- names of events --------------------------------------------------------------------------------------------------

# In SCXML, a dot makes one name part of another (section 3.12.1): a transition for `a` also takes `a.b`. Our topics may
# contain blanks and other characters that SCXML names cannot have. So everything except letters, digits, `-` and `_` is
# written like `_x2E_`, with its code point in capital hexadecimal digits. No two topics get the same name, and only the
# document's own names have dots.


RESERVED = frozenset({"memory", "forgotten", "ended", "after", "error"})
"""The first words of names with another meaning in a document."""
_LETTERS = (
    "A-Za-z\\u00c0-\\u00d6\\u00d8-\\u00f6\\u00f8-\\u02ff\\u0370-\\u037d\\u037f-\\u1fff\\u200c\\u200d\\u2070-\\u218f"
    "\\u2c00-\\u2fef\\u3001-\\ud7ff\\uf900-\\ufdcf\\ufdf0-\\ufffd\\U00010000-\\U000effff"
)
_UNUSABLE = re.compile(f"[^{_LETTERS}0-9_-]|_(?=x[0-9A-F]+_)")
_UNUSABLE_IN_KEYS = re.compile(f"[^{_LETTERS}0-9_.-]|_(?=x[0-9A-F]+_)|^\\.|\\.$|\\.(?=\\.)")


def event_name(topic: str) -> str:
    """Return the name of an event in SCXML.

    :param topic: the topic without its leading slash.

    >>> event_name("R_Greeting_end"), event_name("a.b c"), event_name("memory")
    ('R_Greeting_end', 'a_x2E_b_x20_c', '_x6D_emory')
    """
    name = _UNUSABLE.sub(_escape, topic)
    return f"_x{ord(name[0]):X}_{name[1:]}" if name in RESERVED else name


def key_name(key: str) -> str:
    """Return a memory key for use after `memory.` in the name of an event. Its dots stay.

    >>> key_name("person.name"), key_name("two words")
    ('person.name', 'two_x20_words')
    """
    return _UNUSABLE_IN_KEYS.sub(_escape, key)


def _escape(found: re.Match[str]) -> str:
    return f"_x{ord(found[0]):X}_"


# --- functions of the condition language ------------------------------------------------------------------------------


_SOURCE = Path(__file__).with_name("helper_functions.js").read_text("utf-8")
_NAME = re.compile(r"^function (\w+)", re.MULTILINE)
_CALLED = re.compile(r"(?<![\w.'])(\w+)(?=[(,)])")
HELPERS: dict[str, str] = {
    _NAME.findall(source)[0]: source.strip("\n") for source in re.split(r"\n\n(?=function )", _SOURCE)[1:]
}
"""The source of each function, by name."""
_USES = {
    name: frozenset(found for found in _CALLED.findall(source) if found in HELPERS) - {name}
    for name, source in HELPERS.items()
}


def helpers_for(code: str) -> list[str]:
    """The sources of all helpers that the code calls, directly or indirectly, in this file's order."""
    wanted = {name for name in _CALLED.findall(code) if name in HELPERS}
    pending = list(wanted)
    while pending:
        new = _USES[pending.pop()] - wanted
        wanted |= new
        pending += new
    return [source for name, source in HELPERS.items() if name in wanted]
