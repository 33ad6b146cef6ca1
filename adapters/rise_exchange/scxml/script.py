"""Parses scripts in a chart: the part of ECMAScript that our conditions can express.

Two cases differ. The standard defines the effect of a text that is certainly not ECMAScript, such as `return` as an
expression (SCXML 5.9). A text that cannot be expressed here is refused.
"""

from __future__ import annotations

import re
from typing import Any, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.expression import ExpressionError
from rise_engine.expression.tokens import unquote
from rise_engine.scenario.model import SourceLocation

ILLEGAL = "illegal"
"""The code of a text that is not an expression of ECMAScript at all."""
UNDECLARED = "undeclared"
"""The code of an undeclared variable: evaluating it is certainly an error. The message is its name."""


class ChartRefusedError(RiseError, ValueError):
    """Our rules cannot express a chart or a script exactly. `code` is the kind of reason."""

    def __init__(self, code: str, message: str, index: int = 0, location: SourceLocation | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.index = index
        """Its position in the text of a script, from 0."""
        self.location = location
        """Its location in the chart; None: the caller knows it."""


class Constant(Struct, frozen=True):
    """A number, a text, true, false, null, or `undefined`."""

    value: Any
    is_undefined: bool = False


class Variable(Struct, frozen=True):
    """A variable of the chart."""

    name: str


class EventField(Struct, frozen=True):
    """A field of `_event`: `name`, `origin` or `invokeid`."""

    name: str


class InState(Struct, frozen=True):
    """`In('id')`: whether a state is active."""

    id: str


class Operation(Struct, frozen=True):
    """An operator or a function of Math, with its operands. `===` and `==` are different ones."""

    operator: str
    operands: tuple[ScriptNode, ...]


class ArrayNode(Struct, frozen=True):
    """`[1, 2, 3]`."""

    entries: tuple[ScriptNode, ...]


ScriptNode: TypeAlias = Constant | Variable | EventField | InState | Operation | ArrayNode


REFUSED_NODE = Operation("refused", ())
"""A placeholder for a script that was reported as impossible to express."""


class Script(Struct, frozen=True):
    """An expression with its location."""

    text: str
    root: ScriptNode | None
    """None: it is not ECMAScript, so evaluating it is an error."""
    location: SourceLocation


class ScriptAssignment(Struct, frozen=True):
    """One statement of a `<script>`: `name = value`."""

    name: str
    value: ScriptNode


_TOKEN = re.compile(
    r"""\s*(?:
      ([A-Za-z_$][\w$]*)
    | ((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w$])
    | ("(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')
    | (===|!==|==|!=|<=|>=|&&|\|\||\+=|-=|\*=|/=|\+\+|--|<<|>>|[-+*/%<>!()\[\]{},.;=?:&|^~])
    | (\Z)
    )""",
    re.VERBOSE | re.ASCII,
)
_WORD, _NUMBER, _TEXT, _SIGN, _END = range(1, 6)
_NO_EXPRESSION = frozenset(
    {
        "break", "case", "catch", "const", "continue", "debugger", "default", "do", "else", "enum", "export", "finally",
        "for", "if", "in", "instanceof", "return", "switch", "throw", "try", "var", "while", "with",
    }
)  # fmt: skip
"""Words that cannot begin an expression."""
_LEVELS = (("||",), ("&&",), ("===", "!==", "==", "!="), ("<", "<=", ">", ">="), ("+", "-"), ("*", "/", "%"))
_FUNCTIONS = {"floor": 1, "ceil": 1, "abs": 1}
"""The functions of Math with the same meaning here, and the number of their arguments."""
_LARGEST = 2**53
_MAX_DEPTH = 60
_PAYLOAD = ("data", "type", "sendid")


def read_script(text: str, location: SourceLocation) -> Script:
    """Read an expression. Raises ChartRefusedError if it cannot be expressed here."""
    try:
        parser = _ScriptParser(text)
        root = parser.expression()
        if parser.sign("=") and not isinstance(root, Variable | EventField):
            return Script(text, None, location)  # nothing can be assigned to `1`
        parser.end()
    except ChartRefusedError as error:
        if error.code != ILLEGAL:
            raise
        return Script(text, None, location)
    return Script(text, root, location)


def read_assignments(text: str) -> list[ScriptAssignment]:
    """Read the statements of a `<script>`, which must all be assignments. Raises ChartRefusedError."""
    parser = _ScriptParser(text)
    found: list[ScriptAssignment] = []
    try:
        while not parser.is_at_end():
            if parser.sign(";"):
                continue
            found.append(parser.assignment())
            if not parser.is_at_end() and not parser.sign(";") and not parser.is_on_new_line():
                raise parser.refused()
    except ChartRefusedError as error:
        if error.code != ILLEGAL:
            raise
        raise ChartRefusedError("script", "this script cannot be read; assignments can: `n = n + 1;`") from None
    return found


def is_variable_name(text: str) -> bool:
    """Whether a text can be the name of a variable."""
    return re.fullmatch(r"[A-Za-z_$][\w$]*", text, re.ASCII) is not None and text not in _NO_EXPRESSION


class _ScriptParser:
    def __init__(self, text: str) -> None:
        self.text = text
        self.depth = 0
        self.tokens: list[tuple[int, str, int]] = []
        at = 0
        while True:
            match = _TOKEN.match(text, at)
            if match is None:
                index = len(text) - len(text[at:].lstrip())
                raise ChartRefusedError("expression", f"`{text[index : index + 1]}` cannot be read here", index)
            group = match.lastindex or _END
            self.tokens.append((group, match[group], match.start(group)))
            at = match.end()
            if group == _END:
                break
        self.at = 0

    # --- tokens ---

    def is_at_end(self) -> bool:
        return self.tokens[self.at][0] == _END

    def is_on_new_line(self) -> bool:
        before = self.tokens[self.at - 1]
        return "\n" in self.text[before[2] + len(before[1]) : self.tokens[self.at][2]]

    def sign(self, *signs: str) -> str:
        """Return the next token and consume it, if it is one of these signs."""
        group, word, _ = self.tokens[self.at]
        if group == _SIGN and word in signs:
            self.at += 1
            return word
        return ""

    def refused(self) -> ChartRefusedError:
        _, word, index = self.tokens[self.at]
        shown = f"`{word}`" if word else "the end of this expression"
        return ChartRefusedError(
            "expression", f"{shown} cannot be written in a condition of a rule, or not here", index
        )

    def end(self) -> None:
        if not self.is_at_end():
            raise self.refused()

    # --- grammar ---

    def assignment(self) -> ScriptAssignment:
        if self.tokens[self.at][:2] in ((_WORD, "var"), (_WORD, "let")):
            self.at += 1
        group, name, _ = self.tokens[self.at]
        if group != _WORD or not is_variable_name(name) or name == "_event":
            raise self.refused()
        self.at += 1
        variable = Variable(name)
        if operator := self.sign("+=", "-=", "*=", "/="):
            return ScriptAssignment(name, Operation(operator[0], (variable, self.expression())))
        if operator := self.sign("++", "--"):
            return ScriptAssignment(name, Operation(operator[0], (variable, Constant(1))))
        if not self.sign("="):
            raise self.refused()
        return ScriptAssignment(name, self.expression())

    def expression(self, level: int = 0) -> ScriptNode:
        if level == len(_LEVELS):
            return self.unary()
        left = self.expression(level + 1)
        if self.tokens[self.at][:2] == (_WORD, "in") and self.tokens[self.at + 1][1].startswith("_"):
            raise ChartRefusedError("system-variable", "the contents of a system variable are not known here")
        while operator := self.sign(*_LEVELS[level]):
            left = Operation(operator, (left, self.expression(level + 1)))
        return left

    def unary(self) -> ScriptNode:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise ChartRefusedError("expression", f"this is nested more than {_MAX_DEPTH} deep")
        try:
            if operator := self.sign("!", "-", "+"):
                return Operation({"!": "not", "-": "negative", "+": "positive"}[operator], (self.unary(),))
            if self.tokens[self.at][:2] == (_WORD, "typeof"):
                self.at += 1
                return Operation("typeof", (self.unary(),))
            return self.member(self.primary())
        finally:
            self.depth -= 1

    def primary(self) -> ScriptNode:
        group, word, index = self.tokens[self.at]
        self.at += 1
        if group == _NUMBER:
            if re.match(r"0\d", word):
                raise ChartRefusedError("expression", f"`{word}`: write numbers without a leading 0", index)
            number = float(word)
            if number >= _LARGEST:
                raise ChartRefusedError("expression", f"`{word}`: whole numbers are exact below 2^53 only", index)
            return Constant(int(number) if number.is_integer() else number)
        if group == _TEXT:
            return Constant(_text_of(word, index))
        if group == _WORD:
            return self.word(word, index)
        if word == "(":
            inner = self.expression()
            if not self.sign(")"):
                raise self.refused()
            return inner
        if word == "[":
            return ArrayNode(self.entries("]"))
        self.at -= 1
        if group == _END or word in (")", "]", "*", "/", "%", "<", ">", "=", "==", "&&", "||", ",", "."):
            raise ChartRefusedError(ILLEGAL, "")
        raise self.refused()

    def entries(self, closing: str) -> tuple[ScriptNode, ...]:
        """Expressions separated by commas, up to a closing bracket."""
        if self.sign(closing):
            return ()
        found = [self.expression()]
        while self.sign(","):
            found.append(self.expression())
        if not self.sign(closing):
            raise self.refused()
        return tuple(found)

    def word(self, word: str, index: int) -> ScriptNode:
        if word in _NO_EXPRESSION:
            raise ChartRefusedError(ILLEGAL, "")
        if word in ("true", "false", "null"):
            return Constant({"true": True, "false": False, "null": None}[word])
        if word == "undefined":
            return Constant(None, is_undefined=True)
        if word == "In":
            return self.in_state(index)
        if word == "Math":
            return self.math_function(index)
        if word == "_event":
            return self.event_field(index)
        if word.startswith("_"):
            message = f"`{word}` is a system variable; rules have none"
            raise ChartRefusedError("system-variable", message, index)
        if word in ("function", "new", "this", "delete", "void", "class", "await", "yield", "super", "import"):
            raise ChartRefusedError("expression", f"`{word}` cannot be written in a condition of a rule", index)
        return Variable(word)

    def in_state(self, index: int) -> ScriptNode:
        arguments = self.entries(")") if self.sign("(") else ()
        if len(arguments) == 1 and isinstance(arguments[0], Constant) and isinstance(arguments[0].value, str):
            return InState(arguments[0].value)
        message = "`In` takes the id of one state, in quotation marks: In('waiting')"
        raise ChartRefusedError("computed", message, index)

    def math_function(self, index: int) -> ScriptNode:
        name = ""
        if self.sign("."):
            name = self.tokens[self.at][1]
            self.at += 1
        if name in _FUNCTIONS and self.sign("("):
            arguments = self.entries(")")
            if len(arguments) == _FUNCTIONS[name]:
                return Operation(name, arguments)
        known = ", ".join(f"Math.{each}" for each in _FUNCTIONS)
        raise ChartRefusedError("expression", f"of Math, only {known} mean exactly the same here", index)

    def event_field(self, index: int) -> ScriptNode:
        field = self.tokens[self.at + 1][1] if self.tokens[self.at][1] == "." else ""
        if field in ("name", "origin", "invokeid"):
            self.at += 2
            return EventField(field)
        if field == "origintype":
            message = "`_event.origintype` names an I/O processor; rules have none"
            raise ChartRefusedError("system-variable", message, index)
        if field in _PAYLOAD:
            message = f"events of rules carry nothing, so there is no `_event.{field}`; set a variable before the event"
            raise ChartRefusedError("payload", message, index)
        message = "`_event` is a system variable; of it, only `_event.name` can be known"
        raise ChartRefusedError("system-variable", message, index)

    def member(self, node: ScriptNode) -> ScriptNode:
        """Refuse member access, indexing and calls on a value."""
        if self.tokens[self.at][0] == _SIGN and self.tokens[self.at][1] in (".", "[", "("):
            word = self.tokens[self.at][1]
            index = self.tokens[self.at][2]
            what = "calls of functions" if word == "(" else "parts of values and their methods"
            code = "list-arithmetic" if isinstance(node, ArrayNode) else "expression"
            raise ChartRefusedError(code, f"{what} cannot be taken over exactly", index)
        return node


def _text_of(quoted: str, index: int) -> str:
    """The value of a quoted text. Only escapes with the same meaning here are known."""
    try:
        value = unquote(quoted, quoted, 0)
    except ExpressionError as error:
        raise ChartRefusedError("expression", error.message, index) from None
    if any(ord(character) > 0xFFFF for character in value):
        message = "a character beyond U+FFFF counts as two in ECMAScript, and as one here"
        raise ChartRefusedError("expression", message, index)
    return value
