"""The command palette: every action of the registry, every act and every rule; what cannot be used says why."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.content import Content

from rise_tui.actions import ACTIONS
from rise_tui.gate import Trigger
from rise_tui.store import Store

if TYPE_CHECKING:
    from rise_tui.screens.console import ConsoleScreen


class Command(NamedTuple):
    title: str
    key: str
    help: str
    why_not: str
    run: Callable[[], None]


def commands(store: Store, run: Callable[[str], None], start: Callable[[Trigger], None]) -> Iterator[Command]:
    """All commands, in the registry's order, then acts, then rules."""
    for action in ACTIONS:
        if action.id != "palette":
            yield Command(
                action.title, action.key_label, action.help, action.unavailable(store), partial(run, action.id)
            )
    scenario, why = store.scenario, store.cannot_start()
    for name in scenario.acts:
        settings = scenario.settings_of(name)
        trigger = Trigger("startCommunicationRobotAct", name, settings.debounce, settings.hold)
        binding = store.key_of(trigger.function, name)
        yield Command(f"Act {name}", binding.label if binding else "", "start this act", why, partial(start, trigger))
    for name in scenario.rules:
        trigger = Trigger("startInteractionRule", name)
        binding = store.key_of(trigger.function, name)
        yield Command(f"Rule {name}", binding.label if binding else "", "start this rule", why, partial(start, trigger))


class ConsoleCommands(Provider):
    """Textual's palette asks this for its lines."""

    def _commands(self) -> Iterator[Command]:
        screen: ConsoleScreen = self.screen  # type: ignore[assignment]
        return commands(screen.session.store, screen.action_do, screen.start)

    def _choose(self, command: Command) -> None:
        screen: ConsoleScreen = self.screen  # type: ignore[assignment]
        if command.why_not:
            screen.say(f"{command.title}: not now, {command.why_not}")
        else:
            command.run()

    async def discover(self) -> Hits:
        for command in self._commands():
            label = Content.assemble(*_label(Content(command.title), command))
            yield DiscoveryHit(label, partial(self._choose, command), command.title, _help(command))

    async def search(self, query: str) -> Hits:
        matcher = self.matcher(query)
        for command in self._commands():
            if (score := matcher.match(command.title)) > 0:
                label = Content.assemble(*_label(matcher.highlight(command.title), command))
                yield Hit(score, label, partial(self._choose, command), command.title, _help(command))


def _label(title: Content, command: Command) -> list[Content | tuple[str, str]]:
    return [title, (f"   {command.key}", "$primary")] if command.key else [title]


def _help(command: Command) -> str:
    return f"not now: {command.why_not}" if command.why_not else command.help
