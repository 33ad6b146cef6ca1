"""An expression: a text that is parsed once and evaluated many times (semantics.md 8)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, MutableSet
from functools import cached_property

from rise_engine.expression import nodes
from rise_engine.expression.compiler import ExpressionCompiler
from rise_engine.expression.environment import Environment, Json
from rise_engine.expression.operators import CHANCE_FUNCTIONS, LIST_FUNCTIONS
from rise_engine.expression.parser import parse
from rise_engine.expression.parts import PartReader


class Expression:
    """A condition or formula over the memory (paper, section 4.2.2). Immutable; equal if its text is equal.

    `compiled_condition` and `compiled_value` are closures that are built at first use. To evaluate often, keep an
    `Environment` and call them directly. They raise only EvaluationError, if a value does not fit.
    """

    text: str
    """As written."""
    keys: frozenset[str]
    """The memory keys that it reads, dotted ones whole. For `items[i].text` these are `items` and `i`."""
    constants: frozenset[str]
    """The constants that it uses: pi, e, r2d, d2r. They need no value, so they are not in `keys`. But a memory key of
    the same name hides them, so code that waits for changes of `keys` must also wait for these."""
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

    @classmethod
    def parse_property(cls, text: str) -> Expression:
        """Like `parse`, for a property of a study: it can also use `in`, `rule`, `runs` and `waits`.

        >>> Expression.parse_property("greeted and not in('Greeting', 'Nobody')").keys
        frozenset({'greeted'})
        """
        parsed = parse(text, of_property=True)
        return cls(text, parsed.root, parsed.keys, parsed.constants)

    @cached_property
    def compiled_condition(self) -> Callable[[Environment], bool]:
        """A closure that returns whether it holds."""
        return ExpressionCompiler(self.text).compile_condition(self.root)

    @cached_property
    def compiled_value(self) -> Callable[[Environment], Json]:
        """A closure that returns its value in its own type. The memory owns lists and objects: never change them."""
        return ExpressionCompiler(self.text).compile_value(self.root)

    @cached_property
    def compiled_part(self) -> PartReader | None:
        """The reader of a part if the whole expression is one (`items[i].text`); it can also set the part."""
        if isinstance(self.root, nodes.Part) and isinstance(self.root.base, nodes.Key):
            return ExpressionCompiler(self.text).compile_part(self.root)
        return None

    @cached_property
    def with_all_brackets(self) -> str:
        """The same expression with all brackets."""
        return nodes.with_all_brackets(self.root)

    @cached_property
    def keys_read(self) -> frozenset[str]:
        """The members of `keys` whose value it reads. It only tests whether the others are `defined`."""
        return self.keys if "defined" not in self.text else nodes.read_keys(self.root)

    @cached_property
    def keys_of_parts_only(self) -> frozenset[str]:
        """The members of `keys` of which it only reads parts, such as `items` in `items[i].text`."""
        if "[" not in self.text:
            return frozenset()
        every = [node for node, _ in nodes.walk(self.root)]
        bases = [node.base for node in every if isinstance(node, nodes.Part)]
        asked = [node.name for node in every if isinstance(node, nodes.Defined) and node.part is not None]
        whole = Counter(node.name for node in every if isinstance(node, nodes.Key))
        whole.update(node.name for node in every if isinstance(node, nodes.Defined) and node.part is None)
        before_index = [base.name for base in bases if isinstance(base, nodes.Key)]
        whole.subtract(before_index)
        return frozenset((*asked, *before_index)) - frozenset(+whole)

    @cached_property
    def parts(self) -> tuple[nodes.Part, ...]:
        """Its parts of values, also those within others, in no particular order."""
        if "[" not in self.text:
            return ()
        found = [node for node, _ in nodes.walk(self.root) if isinstance(node, nodes.Part | nodes.Defined)]
        return tuple(part for part in (n if isinstance(n, nodes.Part) else n.part for n in found) if part is not None)

    @cached_property
    def gives_parts(self) -> bool:
        """Whether it contains a part or a list function, which limits the size of its result (semantics.md 8.7)."""
        return any(
            isinstance(node, nodes.Part) or (isinstance(node, nodes.FunctionCall) and node.function in LIST_FUNCTIONS)
            for node, _ in nodes.walk(self.root)
        )

    @cached_property
    def draws(self) -> bool:
        """Whether it draws random numbers."""
        return any(
            isinstance(node, nodes.FunctionCall) and node.function in CHANCE_FUNCTIONS
            for node, _ in nodes.walk(self.root)
        )

    @property
    def bare_key(self) -> str | None:
        """The key, if the expression is only a key (also in brackets)."""
        return self.root.name if isinstance(self.root, nodes.Key) else None

    def as_condition(
        self,
        memory: Mapping[str, Json],
        rand: Callable[[], float] | None = None,
        missing: MutableSet[str] | None = None,
        below: Callable[[int], int] | None = None,
    ) -> bool:
        """Return whether it holds with these memory values. Raises EvaluationError if a value does not fit.

        `rand` returns numbers in [0, 1), `below` whole numbers below its argument. Without them, `rand(...)` and
        `shuffle(...)` raise EvaluationError. Missing keys are added to `missing`.
        """
        return self.compiled_condition(Environment(memory, rand, missing, below))

    def value(
        self,
        memory: Mapping[str, Json],
        rand: Callable[[], float] | None = None,
        missing: MutableSet[str] | None = None,
        below: Callable[[int], int] | None = None,
    ) -> Json:
        """Return its value in its own type; arguments as for `as_condition`. A bare missing key gives None.

        >>> Expression.parse("n / 2 + 1").value({"n": 3})
        2.5
        """
        return self.compiled_value(Environment(memory, rand, missing, below))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)

    def __repr__(self) -> str:
        return f"Expression.parse({self.text!r})"
