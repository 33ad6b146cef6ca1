"""The errors that rise-tui raises on purpose: one tree under `RiseError` (a test compares this drawing with the code).

    RiseError
      AdapterError                An adapter is missing or cannot be used
        PortError                 The transport cannot do this
        RecorderError             The recorder cannot record
      BehaviorError               A behaviour cannot be read
      ChartRefusedError           Our rules cannot express a chart or a script exactly
      EditRefused                 An edit cannot be made
      EngineGone                  The engine has ended or cannot be reached
        LinkLost                  This connection was cut
      ExchangeError               A file or a message of another program cannot be read or written
      ExportError                 An export or a bundle cannot be made or read
      ExportFailed                Nothing was written
      FileError                   A file has errors
      InvalidFilter               A text is not a filter
      JsonError                   A text is not JSON
      KeyRefusedError             A scenario cannot bind a key
      LanguageError               An expression or an assignment cannot be used
        EvaluationError           A value does not fit the expression
          MissingPartError        `items[i].text` names a missing part
        ExpressionError           A text is not an expression
      LineError                   A line is not as it was written
      MissingValueError           A template needs a missing value
      NoSuchPath                  The value has no such part
      ParameterError              A value is invalid for an action's parameter
      RegistryError               The folder or name of a session's socket cannot be used
      Rejected                    The session did not accept a request
      RobotOptionsError           The profile's options or a fault are invalid for the driver
      ScenarioDecodeError         A received text is not a scenario of this version
      ServeRefused                A session cannot be served
      SessionError                A session's folder
        JournalLockedError        An engine runs the session
        RelabelledError           A file contradicts a session's journal
      StudyError                  A request about a study is not possible
        CannotBegin               The session cannot begin
        StudyLogError             The study's log cannot be read or written
      TemplateError               A template cannot be read
      UnreadableError             A file cannot be read
      WordError                   A word cannot be replaced like this
      XmlSyntaxError              A text is not XML

Mistakes in the files of a scenario are not errors but a list of diagnostics
(`rise_engine.scenario.loader.load`). Some errors are also a ValueError, for callers who catch that.
"""


class RiseError(Exception):
    """The base of all errors of these packages, with sentences for the people who run a study.

    ``except RiseError`` catches errors that a caller can report to its users, and no bugs of the program. Each argument
    is one sentence, which is shown as one line.
    """

    @property
    def lines(self) -> tuple[str, ...]:
        """The sentences, one a line."""
        return tuple(map(str, self.args))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class FileError(RiseError):
    """A file has errors: a line for each, with place and message."""


class SessionError(RiseError):
    """A session's folder, or a file in it, cannot be used."""


class StudyError(RiseError):
    """A request about a study is not possible: planning, beginning, judging, withdrawing."""


class AdapterError(RiseError):
    """An adapter is missing or cannot be used: the driver of a robot, a connection, a recorder, a stream."""


class ExchangeError(RiseError):
    """A file or a message of another program cannot be read or written."""
