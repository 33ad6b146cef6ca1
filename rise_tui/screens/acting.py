"""What a key makes happen: from the press, past all care against accidents (law 2), to the task for the engine."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from time import monotonic
from typing import Any

from rise_engine.scenario.model import KeyBinding
from rise_tui.actions import key_in_words
from rise_tui.model import armed
from rise_tui.model.deeds import describe
from rise_tui.model.failures import unanswered
from rise_tui.model.gate import Gate, Timer, Trigger
from rise_tui.model.mistakes import newest
from rise_tui.model.notice import Notice
from rise_tui.screens.painting import Painting
from rise_tui.session import Session

CUE = Trigger("markCue", "")
FILLER = Trigger("nextFiller", "")
A_PASTE = "the keys came faster than anybody types: nothing was said; press enter again"


class Acting:
    """Between the keyboard and the session."""

    def __init__(
        self,
        session: Session,
        painting: Painting,
        later: Callable[[float, Callable[[], None]], Timer],
        run: Callable[[Coroutine[Any, Any, object]], object],
    ) -> None:
        self._session, self._store, self._painting, self._run = session, session.store, painting, run
        self.gate = Gate(self._fire, self._arm, self.tell, later)
        self._key_at: float | None = None
        """When the key was pressed that caused what happens now; monotonic. None: it was the mouse."""
        self._typed = ""
        """The speech that goes through the gate, as it stands in its field."""

    # --- what was pressed, and when ---

    def key_seen(self, key: str, at: float, *, typing: bool, together: bool | None) -> None:
        """Every key, before anything acts on it."""
        self._key_at = at
        self.gate.observe(key, at, typing=typing, together=together)

    def mouse_seen(self) -> None:
        self._key_at = None

    def _pressed(self, at: float | None) -> float | None:
        """Session time of something that happened at `at` on the monotonic clock."""
        return None if at is None else max(0.0, self._store.now() - max(0.0, monotonic() - at))

    @property
    def _now_or_key(self) -> float:
        return monotonic() if self._key_at is None else self._key_at

    def send(self, function: str, behavior: str = "", calling_type: str = "") -> None:
        """Give a task to the engine, without waiting."""
        self._run(self._session.submit(function, behavior, calling_type, self._pressed(self._key_at)))

    def tell(self, text: str) -> None:
        self._session.tell(Notice(text))

    # --- starting ---

    def scenario_key(self, binding: KeyBinding, at: float) -> None:
        """A key of the scenario."""
        settings = self._store.scenario.settings_of(binding.behavior)
        is_act = binding.function == "startCommunicationRobotAct"
        self.start(Trigger(binding.function, binding.behavior, settings.debounce, is_act and settings.hold), at)

    def start(self, trigger: Trigger, at: float | None = None) -> None:
        """Ask for something, with all care against accidents; `at`: when the key was pressed."""
        if reason := self._store.cannot(trigger.function):
            self._refuse(trigger, reason)
        else:
            self.gate.press(trigger, self._now_or_key if at is None else at)

    def say(self, typed: str, text: str, *, at_once: bool) -> None:
        """Free speech."""
        if reason := self._store.cannot_start():
            self._session.tell(Notice(f"not said: {reason}", "wait"))
            return
        self._typed = typed
        trigger = Trigger("say", text, calling_type="Interrupt" if at_once else "Blocking")
        if not self.gate.press(trigger, self._now_or_key):
            self._session.tell(Notice(A_PASTE, "wait"))

    def _fire(self, trigger: Trigger, at: float) -> None:
        if reason := self._store.cannot(trigger.function):
            self._refuse(trigger, reason)
        elif trigger.function == "say" and self._typed:
            self._painting.say.taken(self._typed)
            self._run(self._say(self._typed, trigger, self._pressed(at)))
        else:
            pressed = self._pressed(at)
            self._run(self._session.submit(trigger.function, trigger.behavior, trigger.calling_type, pressed))

    async def _say(self, typed: str, trigger: Trigger, pressed: float | None) -> None:
        if not await self._session.submit(trigger.function, trigger.behavior, trigger.calling_type, pressed):
            self._painting.say.keep(typed)

    def _refuse(self, trigger: Trigger, reason: str) -> None:
        what = describe(trigger.function, trigger.behavior)
        self.tell(f"{what} not started: {reason}" if trigger.function in armed.STARTS else f"{what}: not now, {reason}")

    def _arm(self, trigger: Trigger | None) -> None:
        self._store.armed = trigger.behavior if trigger is not None else ""
        if trigger is not None:
            text = f"{trigger.behavior}: Enter or the same key again within 2 s starts it"
            self._session.tell(Notice(text, "wait"))
        else:
            self._painting.clear_notice()
        self._painting.changed({"acts"})

    # --- failed acts ---

    def repeat(self) -> None:
        """Start the act again whose failure is shown, as it was asked for, with the care that every start takes."""
        failed = next(iter(unanswered(self._store)), None)
        if failed is None:
            return
        settings = self._store.scenario.settings_of(failed.behavior)
        hold = failed.function == "startCommunicationRobotAct" and settings.hold
        self._typed = ""
        self.start(Trigger(failed.function, failed.behavior, settings.debounce, hold, failed.calling_type))

    def go_on(self) -> None:
        """Put the failure away that is shown."""
        failed = next(iter(unanswered(self._store)), None)
        if failed is not None and not self.gate.pasting:
            self.send("goOn", str(failed.id))

    # --- LIVE, SAFE, LOCKED ---

    def switch_safe(self) -> None:
        self._switch(armed.after_safe(self._store.guard))

    def switch_lock(self) -> None:
        self._switch(armed.after_lock(self._store.guard))

    def _switch(self, guard: armed.Guard) -> None:
        self.gate.reset()
        self._store.guard = guard
        self.tell(armed.told(guard, key_in_words("safe"), key_in_words("lock")))
        self._painting.changed({"acts", "rules", "status", "tasks"})

    # --- mistakes ---

    def mistake(self) -> None:
        """Mark what the wizard did last as wrong at once, and ask for the better word."""
        if self.gate.pasting:
            return
        task = newest(self._store.view.tasks, self._store.person)
        if task is None:
            self.tell("you have done nothing yet: there is nothing to mark")
            return
        self.send("markMistake", f"{task.id} wrong")
        self._painting.open_mistake(task.id)

    def mark(self, task: int, mark: str) -> None:
        """The better word; `wrong` it is already."""
        if mark != "wrong":
            self.send("markMistake", f"{task} {mark}")
