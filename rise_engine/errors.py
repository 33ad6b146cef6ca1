"""The errors that rise-tui raises on purpose: one tree under `RiseError` (a test compares this drawing with the code).

    RiseError
      LanguageError               an expression or an assignment, see `rise_engine.expression`
        ExpressionError           it cannot be read; with the column and a remedy
        EvaluationError           it cannot be evaluated with the memory of this moment
      RefusedError                RISE's own parser would refuse a condition
      JsonError                   a text that is no JSON, or that the memory cannot hold
      MisnamedError               a character that no XML name can have
      TemplateError               a parameter text whose braces cannot be read
      MissingValue                a memory key without value was needed to fill a parameter
      ParameterError              a value that an action's parameter cannot take
        OutOfRangeError           a number beyond its smallest or largest
      KeyRefusedError             a key that a scenario cannot bind
      NotCopied                   a shipped study could not be copied
      ScenarioDecodeError         what was received is no scenario of this version
      BridgeError                 the connection to a robot's middleware cannot be had
      PortError                   something cannot be had from a ROS transport, or does not fit its type
      CarrierErrors               what a robot's profile says about ROS cannot be
      NodeError                   a node of ours cannot do what it is for
      SessionGoneError            a node gets no answer from a session

What is wrong with the files of a scenario is no error but a list of findings (`rise_engine.scenario.load`). Most are a
ValueError, too, for callers who catch that.
"""


class RiseError(Exception):
    """What went wrong, in a sentence for the people who run a study; every error of these packages is one of these.

    ``except RiseError`` therefore catches what a caller can tell its users about, and leaves mistakes of the program
    alone.
    """
