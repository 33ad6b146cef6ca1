"""The errors that rise-tui raises on purpose: one tree under `RiseError` (a test compares this drawing with the code).

    RiseError
      AdapterError                An adapter cannot be had or used
        PortError                 Something cannot be had from this transport
        RecorderError             It cannot record
      BehaviorError               A behaviour that cannot be read
      ChartRefusedError           A chart or a script that cannot be said exactly in our rules
      EditRefused                 An edit that cannot be made
      EngineGone                  The engine has ended or cannot be reached
        LinkLost                  This connection was cut
      ExchangeError               A file or a message of another program cannot be read or written
      ExportError                 An export or a bundle cannot be made or read
      ExportFailed                Nothing was written
      FileError                   A file with mistakes
      InvalidFilter               A text that is not a filter
      JsonError                   A text that is not JSON
      KeyRefusedError             A key that a scenario cannot bind
      LanguageError               An expression or an assignment that cannot be used
        EvaluationError           A value of this moment does not fit the expression
          MissingPartError        `items[i].text` names a part that is not there
        ExpressionError           A text that is not an expression
      LineError                   A line is not what was written
      MissingValueError           A memory key without value was needed to fill a template
      NoSuchPath                  The value has no such part
      ParameterError              A value that an action's parameter cannot take
      RegistryError               The folder or the name under which a session is reached cannot be used
      Rejected                    The session did not accept what was asked for
      RobotOptionsError           The driver cannot understand the profile's options or a fault
      ScenarioDecodeError         A received text is not a scenario of this version
      ServeRefused                A session cannot be served
      SessionError                A session's folder
        JournalLockedError        An engine runs the session
        RelabelledError           A file says something else about a session than its journal
      StudyError                  Something cannot be done with a study
        CannotBegin               The session cannot begin
        StudyLogError             The study's log cannot be read or written
      TemplateError               A template that cannot be read
      UnreadableError             A file that cannot be read
      WordError                   A word cannot be replaced like this
      XmlSyntaxError              A text that is not XML

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
    """A study cannot be planned, begun, judged or changed as requested."""


class AdapterError(RiseError):
    """An adapter is missing or cannot be used: the driver of a robot, a connection, a recorder, a stream."""


class ExchangeError(RiseError):
    """A file or a message of another program cannot be read or written."""
