"""An expression: a text that has been read once and can be evaluated many times (semantics.md 8)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSet
from functools import cached_property

from rise_engine.expression import nodes
from rise_engine.expression.compiler import ExpressionCompiler
from rise_engine.expression.environment import Environment, Json
from rise_engine.expression.parser import parse


class Expression:
    """A condition or formula over the memory (paper, section 4.2.2). Immutable; equal when its text is.

    `compiled_condition` and `compiled_value` are the compiled closures (built at first use): whoever evaluates often
    keeps an `Environment` and calls them directly. They raise EvaluationError when a value does not fit, and nothing
    else.
    """

    text: str
    """As written."""
    keys: frozenset[str]
    """The memory keys that it reads, dotted ones whole."""
    constants: frozenset[str]
    """Those of pi, e, r2d and d2r that it uses. A memory key of the same name would hide them, so whoever waits for
    changes of `keys` waits for these as well; nobody needs to set them, so they are not among `keys`."""
    root: nodes.Node
    """The syntax tree."""

    def __init__(self, text: str, root: nodes.Node, keys: frozenset[str], constants: frozenset[str]) -> None:
        self.text = text
        self.root = root
        self.keys = keys
        self.constants = constants

    @classmethod
    def parse(cls, text: str) -> Expression:
        """Read a text. Raises ExpressionError with the column and a remedy.

        >>> Expression.parse("task > 2 and not finished").as_condition({"task": 3, "finished": False})
        True
        >>> Expression.parse("task >")
        Traceback (most recent call last):
        ...
        rise_engine.expression.errors.ExpressionError: something is missing after `>` (column 7)
        """
        parsed = parse(text)
        return cls(text, parsed.root, parsed.keys, parsed.constants)

    @cached_property
    def compiled_condition(self) -> Callable[[Environment], bool]:
        """Compiled: whether it holds."""
        return ExpressionCompiler(self.text).compile_condition(self.root)

    @cached_property
    def compiled_value(self) -> Callable[[Environment], Json]:
        """Compiled: its value in its own type. Lists and objects are the memory's own, never to be changed in place."""
        return ExpressionCompiler(self.text).compile_value(self.root)

    @cached_property
    def with_all_brackets(self) -> str:
        """The same expression with all brackets written out."""
        return nodes.with_all_brackets(self.root)

    @cached_property
    def keys_read(self) -> frozenset[str]:
        """Those of `keys` whose value is read; of the others it is only asked whether they are `defined`."""
        return self.keys if "defined" not in self.text else nodes.read_keys(self.root)

    @property
    def bare_key(self) -> str | None:
        """The key, when the expression is nothing but one (also in brackets)."""
        return self.root.name if isinstance(self.root, nodes.Key) else None

    def as_condition(
        self,
        memory: Mapping[str, Json],
        rand: Callable[[], float] | None = None,
        missing: MutableSet[str] | None = None,
    ) -> bool:
        """Whether it holds, with these memory values by key. Raises EvaluationError when a value does not fit.

        `rand` gives numbers in [0, 1) (without it, `rand(...)` is an EvaluationError); keys that do not exist are added
        to `missing`.
        """
        return self.compiled_condition(Environment(memory, rand, missing))

    def value(
        self,
        memory: Mapping[str, Json],
        rand: Callable[[], float] | None = None,
        missing: MutableSet[str] | None = None,
    ) -> Json:
        """Its value in its own type, as `as_condition` gets it. A bare key that does not exist gives null.

        >>> Expression.parse("n / 2 + 1").value({"n": 3})
        2.5
        """
        return self.compiled_value(Environment(memory, rand, missing))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __repr__(self) -> str:
        return f"Expression.parse({self.text!r})"
