"""Sessions that run but not in this runtime folder: with another RISE_RUNTIME or XDG_RUNTIME_DIR, or another computer.

Their folders know them: the journal is locked, and beside it stands where the session is reached.
"""

from __future__ import annotations

from rise_engine.link.messages import About
from rise_engine.link.places import about, abouts, socket_path
from rise_engine.session.folder import running_folders
from rise_engine.session.lock import running_words


def everywhere() -> dict[str, About | None]:
    """Every session that runs on this computer and what it says about itself: those of this runtime folder by their
    names, the others by the paths of their sockets. Raises PlaceError. Blocks up to a second for each."""
    found = abouts()
    ours = {str(socket_path(name).absolute()) for name in found}
    for holder in running_folders().values():
        if holder is not None and holder.is_here and holder.socket and holder.socket not in ours:
            found[holder.socket] = about(holder.socket)
    return found


def on_other_computers() -> list[str]:
    """What runs there, in sentences."""
    return [
        running_words(folder, holder)
        for folder, holder in running_folders().items()
        if holder is not None and not holder.is_here
    ]
