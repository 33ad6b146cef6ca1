"""Running sessions outside of this runtime folder (RISE_RUNTIME or XDG_RUNTIME_DIR), or on another computer.

Their folders show them: the journal is locked, and a file beside it names the session's socket.
"""

from __future__ import annotations

from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import ask_all_summaries, ask_summary, socket_path
from rise_engine.session.folder import running_sessions
from rise_engine.session.lock import running_message


def all_running_sessions() -> dict[str, SessionSummary | None]:
    """Return every session on this computer and its summary, by name, or by socket outside of this runtime folder.

    Raises RegistryError. Blocks up to a second for each.
    """
    summaries = ask_all_summaries()
    ours = {str(socket_path(name).absolute()) for name in summaries}
    for holder in running_sessions().values():
        if holder is not None and holder.is_this_computer and holder.socket and holder.socket not in ours:
            summaries[holder.socket] = ask_summary(holder.socket)
    return summaries


def sessions_on_other_computers() -> list[str]:
    """Describe the sessions on other computers, in sentences."""
    return [
        running_message(folder, holder)
        for folder, holder in running_sessions().items()
        if holder is not None and not holder.is_this_computer
    ]
