"""The errors that rise-tui raises on purpose: one tree under `RiseError` (a test compares this drawing with the code).

    RiseError
      BehaviorError               A behaviour that cannot be read
      BridgeError                 The connection cannot be had
      BundleError                 A bundle cannot be made or read
      CannotBegin                 The session cannot begin
      CannotJudge                 Nothing was written
      CannotLook                  The robot cannot be looked for
      ClipboardTooLarge           It does not fit on a clipboard
      DriverError                 No usable driver of that name is installed
      EditRefused                 An edit that cannot be made
        MemoryFileNotEditable     The file is not what a scenario's memory is
      EndRefused                  This client may not end the session
      EngineGone                  The engine has ended or cannot be reached
        LinkLost                  This connection was cut
      ExportError                 The export cannot be made
      ExportFailed                Nothing was written
      FileError                   A file with mistakes
        StudyTestError            A test that cannot be read
        StudyUnusable             The study cannot be used
        TaskFileError             A task file with mistakes
      FindingError                Marks cannot be looked for
      HeaderError                 Where a message begins cannot be known any more
      IllegalScriptError          A text that is no expression of ECMAScript at all
      InvalidFilter               What is typed is no filter
      InvalidTime                 It is no time
      JsonError                   A text that is no JSON
      KeyRefusedError             A key that a scenario cannot bind
      LanguageError               An expression or an assignment that cannot be used
        EvaluationError           A value of this moment does not fit the expression
          MissingPartError        `items[i].text` names a part that is not there
        ExpressionError           A text that is no expression
      LineError                   A line is not what was written
        NewerFormatError          A newer program wrote this
      MappingError                What is wrong with a profile's options and carriers
      MemoryNotWritable           The start values cannot be written
      MissingValueError           A memory key without value was needed to fill a template
      NewStudyError               A study could not be made
      NoSuchPath                  The value has no such part
      NotAdmitted                 Somebody cannot attach
      NotFlattenedError           A chart that cannot be flattened
      NotWoz4uError               The file is no configuration of WoZ4U
      NothingStarted              Nothing is started and nothing attached to
      NothingToKeep               Nothing may be kept of somebody
      OutletError                 It cannot pass on anything
      ParameterError              A value that an action's parameter cannot take
        OutOfRangeError           A number beyond the smallest or the largest that a parameter can have
      PathMismatch                A path that does not belong to the scenario
      PlanError                   The plan cannot be written
      PortError                   Something cannot be had from this transport
      RecorderError               It cannot record
        CalledOff                 Nobody waits for the answer any more
        ObsCut                    The connection was cut before there was an answer
        ObsRefused                OBS has answered that it does not do it
        RecorderEnded             What recorded has ended by itself
      RegistryError               The folder or the name under which a session is reached cannot be used
      Rejected                    The session did not accept what was asked for
      RobotOptionsError           The driver cannot understand the profile's options or a fault
      ScenarioDecodeError         What was received is no scenario of this version
      ScriptRefusedError          A script
      ServeRefused                Nothing is served
      SessionError                A session's folder cannot be used
        CannotShare               The session cannot be given to others
        CodedError                An annotation file cannot be read
        HeldElsewhereError        Another computer had the session last
        JournalLockedError        An engine runs the session
        MediaError                media.json cannot be read or written
        RedactionRefused          Nothing was changed
        RelabelledError           Something says of a session what its journal does not say
        ShadowError               A shadow cannot be begun
      SnapshotError               A snapshot does not fit the scenario that it is to go on with
      StudyCopyError              A study could not be copied
      StudyLogError               The study's log cannot be read or written
      StudyRefused                Something cannot be done with a study
      TemplateError               A template that cannot be read
      TextsError                  A table of texts that cannot be written or read
      UndeclaredError             A variable that there is not
      UnreadableError             A file that cannot be read
      WithdrawalError             Nobody was withdrawn
      WordError                   A word cannot be replaced like this
      XmlSyntaxError              A text that is no XML

What is wrong with the files of a scenario is no error but a list of findings
(`rise_engine.scenario.loader.load`). Most are a ValueError, too, for callers who catch that.
"""


class RiseError(Exception):
    """What went wrong, in sentences for the people who run a study; every error of these packages is one of these.

    ``except RiseError`` therefore catches what a caller can tell its users about, and leaves mistakes of the program
    alone. Each argument is a sentence, and a line for those who read it.
    """

    @property
    def lines(self) -> tuple[str, ...]:
        """The sentences."""
        return tuple(map(str, self.args))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class FileError(RiseError):
    """A file with mistakes: a line for each, which says where it is and what is wrong."""
