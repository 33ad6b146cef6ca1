"""How a session is started: what the command line, the console and the engine's process tell each other."""

from __future__ import annotations

from msgspec import Struct

from rise_engine.kernel.inputs import CheckReport, Submit
from rise_engine.kernel.records import Purpose
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.protocol.task_file import TimedTask


class SessionOptions(Struct, frozen=True):
    """What to run; None and empty: as the scenario says. A session that goes on keeps its own, but for its folder."""

    folder: str
    """The scenario's; with a study, which says it, empty."""
    robot: str | None = None
    mode: str | None = None
    """`debug` or `real`."""
    seed: int | None = None
    """For everything picked at random; None: a new one."""
    speed: float = 1.0
    """Session seconds in a second."""
    faults: tuple[str, ...] = ()
    """What the simulated robot does wrong, as its driver documents it."""
    paths: dict[str, str] = {}
    """`acts`, `rules`, `memory`: paths relative to the folder, where they differ from the scenario's."""
    ros: RosConnection = RosConnection()
    """How ROS 2 is spoken."""
    participant: str = ""
    """Who takes part, as the record is to name them."""
    condition: str = ""
    """One of the scenario's conditions, whose memory values the session begins with; empty: none."""
    wizard: str = ""
    """Who begins it, for the session's folder."""
    login: str = ""
    """Whose account it is: who begins it when nobody is named, in debug mode only."""
    first_tasks: tuple[Submit, ...] = ()
    """Submitted at the beginning of a new session."""
    script: tuple[TimedTask, ...] = ()
    """Tasks of a new session for later moments, those of one moment in their order: a rehearsal plays itself."""
    socket_name: str | None = None
    """Of the socket; None: made from the folder's path, so that a folder has one session at a time."""
    unfinished: str = "ask"
    """What to do when an earlier session of the folder did not end: ask (refuse and say so), new, recover (the latest),
    or the path of the session to recover. With a participant or a condition, only a session of theirs is recovered."""
    from_other_computer: bool = False
    """To go on with a session that another computer had last, on a file system that does not tell of its locks."""
    study: str = ""
    """The study's folder; empty: the session is of no study. Its plan gives scenario, condition, memory and seed."""
    run: int = 0
    """Which of the participant's runs; 0: the next."""
    purpose: Purpose = "counted"
    """Why a session of a study is run; in debug mode it is always `debug`."""
    record: bool | None = None
    """Whether the study's recorders run; None: in sessions that count and in pilots."""
    checks: tuple[CheckReport, ...] = ()
    """What came of the study's checks: the first inputs after the start."""
    language: str = ""
    """Of what the robot says, by BCP 47, one that the scenario has translations into; empty: as the acts are written,
    or as the study says."""
    allow_untranslated: bool = False
    """Whether what is not translated is said as the acts have it."""
