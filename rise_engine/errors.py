"""The errors that rise-tui raises on purpose: one tree under `RiseError` (a test compares this drawing with the code).

    RiseError
      BridgeError                 The connection cannot be had
      DriverError                 No usable driver of that name is installed
      EndRefused                  This client may not end the session
      EngineGone                  The engine has ended or cannot be reached
        LinkLost                  This connection was cut
      JsonError                   A text that is no JSON
      KeyRefusedError             A key that a scenario cannot bind
      LanguageError               An expression or an assignment that cannot be used
        EvaluationError           A value of this moment does not fit the expression
        ExpressionError           A text that is no expression
      LineError                   A line is not what was written
        FutureFormat              A newer program wrote this
      MisnamedError               A character that no XML name can have
      MissingValue                A memory key without value was needed to fill a template
      NotAdmitted                 Somebody cannot attach
      NotCopied                   A study could not be copied
      NothingChosenError          Nothing is started and nothing attached to
      OutputError                 Standard output cannot be written
      ParameterError              A value that an action's parameter cannot take
        OutOfRangeError           A number beyond the smallest or the largest that a parameter can have
      PlaceError                  A session's place cannot be used
      Refusal                     Nothing is served
      RefusedError                RISE's own parser would refuse this condition
      Rejected                    The session did not accept what was asked for
      RobotOptionsError           The driver cannot understand the profile's options or a fault
      ScenarioDecodeError         What was received is no scenario of this version
      ScriptError                 A task file with mistakes
      SessionError                A session's folder cannot be used
        HeldElsewhere             Another computer had the session last
        JournalLocked             An engine runs the session
      SnapshotError               A snapshot does not fit the scenario that it is to go on with
      TemplateError               A template that cannot be read
      UnusableError               Something on the command line cannot be used
      UnusableMemoryError         `--memory` cannot be read

What is wrong with the files of a scenario is no error but a list of findings (`rise_engine.scenario.load`). Most are a
ValueError, too, for callers who catch that.
"""


class RiseError(Exception):
    """What went wrong, in a sentence for the people who run a study; every error of these packages is one of these.

    ``except RiseError`` therefore catches what a caller can tell its users about, and leaves mistakes of the program
    alone.
    """
