"""The options of a session, shared by the command line, the console and the engine's process."""

from __future__ import annotations

from msgspec import Struct

from rise_engine.kernel.inputs import CheckReport, Submit
from rise_engine.kernel.records import Purpose
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.protocol.task_file import TimedTask


class SessionOptions(Struct, frozen=True):
    """What to run; None and empty: as the scenario says. A continued session keeps its options except its folder."""

    folder: str
    """The scenario's folder; empty with a study, which sets it."""
    robot: str | None = None
    mode: str | None = None
    """`debug` or `real`."""
    seed: int | None = None
    """For all random choices; None: a new one."""
    speed: float = 1.0
    """Session seconds in a second."""
    faults: tuple[str, ...] = ()
    """Faults of the simulated robot, as its driver documents them."""
    paths: dict[str, str] = {}
    """`acts`, `rules`, `memory`: paths relative to the folder, if they differ from the scenario's."""
    ros: RosConnection = RosConnection()
    participant: str = ""
    """The participant's name in the record."""
    condition: str = ""
    """The scenario's condition that sets the first memory values; empty: none."""
    wizard: str = ""
    """The wizard who begins the session, for its folder."""
    login: str = ""
    """The account's name, used in debug mode if no wizard is named."""
    first_tasks: tuple[Submit, ...] = ()
    """Tasks submitted at the beginning of a new session."""
    script: tuple[TimedTask, ...] = ()
    """Tasks of a new session for later times, in their order: a rehearsal plays them."""
    socket_name: str | None = None
    """The name of the socket; None: from the folder's path, so that a folder has one session at a time."""
    unfinished: str = "ask"
    """What to do with an unfinished session of the folder: ask (refuse and report it), new, recover (the latest), or
    its path to recover it. With a participant or a condition, only their own session is recovered."""
    from_other_computer: bool = False
    """Whether to continue a session that another computer ran last, on a file system without shared locks."""
    study: str = ""
    """The study's folder; empty: none. The study's plan sets scenario, condition, memory and seed."""
    run: int = 0
    """The number of the participant's run; 0: the next."""
    purpose: Purpose = "counted"
    """The purpose of a study's session; in debug mode it is always `debug`."""
    record: bool | None = None
    """Whether the study's recorders run; None: in sessions that count and in pilots."""
    checks: tuple[CheckReport, ...] = ()
    """Results of the study's checks: the first inputs after the start."""
    language: str = ""
    """The robot's spoken language (BCP 47), one with translations; empty: that of the acts, or the study's."""
    allow_untranslated: bool = False
    """Whether texts without a translation are spoken in the language of the acts."""
