"""The language of conditions and assignments: parsed once at load, compiled to closures, then evaluated.

Pure: no side effects, clock, own randomness, input or output.
"""

from rise_engine.expression.assignment import Assignment, assigned_entry
from rise_engine.expression.environment import AskedSituation, Environment, lookup
from rise_engine.expression.errors import EvaluationError, ExpressionError, LanguageError, MissingPartError
from rise_engine.expression.expression import Expression

__all__ = [
    "AskedSituation",
    "Assignment",
    "Environment",
    "EvaluationError",
    "Expression",
    "ExpressionError",
    "LanguageError",
    "MissingPartError",
    "assigned_entry",
    "lookup",
]
