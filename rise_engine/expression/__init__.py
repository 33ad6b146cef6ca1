"""The language of conditions and assignments: parsed once at load, compiled to closures, then evaluated.

Pure: no side effects, no clock, no chance of its own, no input or output.
"""

from rise_engine.expression.assignment import Assignment, store
from rise_engine.expression.environment import Env, lookup
from rise_engine.expression.errors import EvaluationError, ExpressionError, LanguageError
from rise_engine.expression.expression import Expression

__all__ = [
    "Assignment",
    "Env",
    "EvaluationError",
    "Expression",
    "ExpressionError",
    "LanguageError",
    "lookup",
    "store",
]
