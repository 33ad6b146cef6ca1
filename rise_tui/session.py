"""The console's side of the link: takes batches of records in, sends what the wizard asks for (laws 3 and 5)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from rise_engine.kernel.inputs import Submit
from rise_engine.link.client import Client, EngineGone
from rise_tui.store import EVERYTHING, Notice, Sent, Store, Topic, describe

Changed = Callable[[frozenset[Topic] | set[Topic]], None]


class Session:
    """One attached session."""

    def __init__(self, client: Client, store: Store) -> None:
        self.client = client
        self.store = store
        self.changed: Changed = lambda topics: None
        """Called after every change of the store; the screen repaints from it, at its own pace."""
        self._numbers = count(1)

    @classmethod
    async def attach(cls, client: Client, wizard: str) -> Session:
        """Raises EngineGone."""
        hello = await client.attach()
        return cls(client, Store(hello, wizard, client.now))

    async def pump(self) -> None:
        """Take records in until the engine ends."""
        try:
            async for batch in self.client.records():
                self.changed(self.store.apply(batch))
        except EngineGone as gone:
            self._gone(str(gone))
            return
        ended = self.store.view.session.reason if self.store.view.session is not None else ""
        self._gone(ended or "the session is over")

    async def submit(self, function: str, behavior: str = "", calling_type: str = "") -> None:
        """Ask for a task; what comes of it arrives as records. Never raises: what goes wrong is shown."""
        store = self.store
        if store.gone:
            self.tell(Notice(f"{describe(function, behavior)}: not sent, {store.unavailable()}", "fault"))
            return
        ref = f"{store.wizard}-{next(self._numbers)}"
        store.sent[ref] = Sent(function, behavior, store.now())
        self.changed(EVERYTHING)
        message = Submit(
            function=function, behavior=behavior, calling_type=calling_type, source=f"wizard:{store.wizard}", ref=ref
        )
        try:
            reply = await self.client.send(message)
        except EngineGone as gone:
            store.sent.pop(ref, None)
            self._gone(str(gone))
            return
        if not reply.accepted or reply.task in store.view.tasks:
            store.sent.pop(ref, None)
        if not reply.accepted:
            store.notice = Notice(f"{describe(function, behavior)} was rejected: {reply.reason}", "wait")
        self.changed(EVERYTHING)

    def tell(self, notice: Notice) -> None:
        """Show a sentence."""
        self.store.notice = notice
        self.changed({"notice"})

    async def end(self) -> None:
        """Leave and end the session; the engine stops the robot."""
        await self.client.close(end_session=True)

    def _gone(self, reason: str) -> None:
        if not self.store.gone:
            self.store.gone = reason or "no reason was given"
        self.store.sent.clear()
        self.changed(EVERYTHING)
