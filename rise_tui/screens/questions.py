"""The questions that the console asks above itself, and their end when what they are about has changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rise_tui.actions import BY_ID, key_in_words, keys_of
from rise_tui.model.control import question
from rise_tui.screens.dialog import Answer, Dialog

if TYPE_CHECKING:
    from rise_tui.screens.console import ConsoleScreen


class Questions:
    """Belongs to one console."""

    def __init__(self, console: ConsoleScreen) -> None:
        self._console = console
        self._control_shown: tuple[str | None, str | None] = (None, None)

    def release(self) -> None:
        """Whether the stop is to be released."""
        console = self._console
        stop = console.session.store.view.stop
        said = [f"Stopped by {stop.source or 'the console'}."]
        said.append(f"Confirmed: {', '.join(stop.confirmed) or 'nobody'}.")
        if stop.unconfirmed:
            said.append(f"NOT confirmed: {', '.join(stop.unconfirmed)}. Look at the robot first.")
        elif stop.status == "requested":
            said.append("The robot has not answered yet. Look at it first.")
        said.append("After this, keys start acts and rules again.")
        keys = keys_of(BY_ID["release"])
        said += [f"{key_in_words('release')} once more releases it."] * bool(keys)
        dialog = Dialog("Release the stop?", said, Answer("r", "Release"), no="Stay stopped", again=keys)
        dialog.add_class("-release")
        console.app.push_screen(dialog, lambda yes: console.send("releaseStop") if yes else None)

    def stopped_again(self) -> None:
        """The stop that a question is about is not the last one any more."""
        self._withdraw("-release", "stopped again: the question whether to release the stop was closed")

    def control(self) -> None:
        """What is to become of control, by who has it and who asks for it."""
        console = self._console
        store = console.session.store
        said, ways = question(store.view.control, store.view.asked, store.me)
        self._control_shown = self._who()
        verbs = {way.key: way.verb for way in ways}
        dialog = Dialog("Control", said, *(Answer(way.key, way.title) for way in ways), no="Leave it")
        dialog.add_class("-control")

        def answered(key: str | None) -> None:
            if key:
                console.run_worker(console.session.control(verbs[key]), group="send")

        console.app.push_screen(dialog, answered)

    def look_again(self) -> None:
        """Who has control, or who asks for it, may have changed."""
        if self._who() != self._control_shown:
            self._withdraw("-control", "control has just changed: the question about it was closed")

    def close_all(self) -> None:
        """Questions and lists above the console close unanswered: one that was forgotten should not be there later.

        What is being typed stays in its field.
        """
        app = self._console.app
        while app.screen is not self._console:
            app.screen.dismiss()

    def _who(self) -> tuple[str | None, str | None]:
        view = self._console.session.store.view
        return view.control, view.asked

    def _withdraw(self, kind: str, said: str) -> None:
        for screen in self._console.app.screen_stack:
            if isinstance(screen, Dialog) and screen.has_class(kind) and screen.withdraw():
                self._console.say(said)
