"""From a folder to a checked scenario: read whole, checked whole, refused with all findings (reference/scenario.md)."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.nearest_name import few_comparisons
from rise_engine.scenario.actions import declare
from rise_engine.scenario.acts import read_acts
from rise_engine.scenario.allow import Silenced, allows_of_memory, read_allows, silence
from rise_engine.scenario.draft import Draft
from rise_engine.scenario.findings import Finding, Findings
from rise_engine.scenario.layout import DEFAULT_PLACES, NAME
from rise_engine.scenario.links import check_links
from rise_engine.scenario.memory import read_memory
from rise_engine.scenario.model import Place, RobotProfile, Scenario
from rise_engine.scenario.robots import DEFAULT, read_robot
from rise_engine.scenario.rules import read_rules
from rise_engine.scenario.settings import Settings
from rise_engine.scenario.shipped import hint
from rise_engine.scenario.source import MAX_TOML_BYTES, Files, Source
from rise_engine.scenario.toml_places import TomlFile, read_toml
from rise_engine.scenario.xml import XmlFile, read_xml


class Loaded(Struct, frozen=True):
    """What came of reading a scenario. There is one exactly when no finding is an error."""

    scenario: Scenario | None
    findings: list[Finding]
    """In reading order, errors and warnings."""
    files: dict[str, bytes] = {}
    """What was read, by the place that it has in a usual folder (`acts/greet.xml`, `memory.json`, `robots/nao.toml`),
    wherever it lay: written there, it is the same scenario (`DEFAULT_PLACES`)."""
    silenced: list[Silenced] = []
    """Warnings that are meant, in reading order; they are not among the findings."""

    def __iter__(self) -> Iterator[Any]:
        """`scenario, findings = load(...)` works too."""
        return iter((self.scenario, self.findings))

    @property
    def errors(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.severity == "error"]

    @property
    def warnings(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.severity == "warning"]


def load(
    path: str | os.PathLike[str],
    *,
    robot: str | None = None,
    mode: str | None = None,
    places: Mapping[str, str] | None = None,
) -> Loaded:
    """Read and check a scenario.

    Arguments:
        path: its folder, or the `scenario.toml` in it.
        robot: the name of a profile (docs/reference/robots.md), instead of the one that the file names.
        mode: "debug" or "real", instead of what the file says.
        places: where acts, rules and memory lie, instead of what the file says: paths relative to the folder, by
            `acts`, `rules` and `memory`.

    Returns the checked scenario with its warnings, or no scenario and everything that is wrong, each with file, line,
    column and a sentence. Nothing that an author wrote raises an error, nor does a file that cannot be read.

    >>> loaded = load("scenarios/greeting")
    >>> loaded.scenario.title, "person_name" in loaded.scenario.memory
    ('Greeting a visitor', True)
    >>> loaded.findings
    []
    >>> str(load("scenarios/greetings").findings[0]).partition(";")[0]
    'scenarios/greetings:1:1: error unreadable: there is no such folder'
    """
    with few_comparisons():
        return _Loader(Path(path)).load(robot, mode, places or {})


class _Loader:
    def __init__(self, path: Path) -> None:
        self.findings = Findings()
        self.path = path
        is_file = path.name == NAME or path.suffix == ".toml"
        self.folder = Path(os.path.abspath(path.parent if is_file else path))  # noqa: PTH100  # keeps symbolic links
        self.files = Files(self.folder, self.findings)
        self.draft = Draft()
        self.file = TomlFile(Source(NAME, b"", ""), {})
        self.named: dict[str, str] = {}
        self.asked = Place(str(path))
        """Where what the caller asked for, and no file says, is reported."""

    def load(self, robot: str | None, mode: str | None, places: Mapping[str, str]) -> Loaded:
        findings, draft = self.findings, self.draft
        if not self.folder.is_dir():
            findings.error("unreadable", Place(str(self.path)), f"there is no such folder{hint()}")
            return Loaded(None, findings.sorted())
        self.read_settings()
        settings = Settings(self.file, draft, findings)
        if mode is not None and mode not in ("debug", "real"):
            findings.error("wrong-value", self.asked, f'the mode asked for is "debug" or "real", not "{mode}"')
        profile = self.robot(robot if robot is not None else settings.robot, asked=robot is not None)
        self.named = {**settings.places, **places}
        paths = {key: self.named.get(key) or place for key, place in DEFAULT_PLACES.items()}

        for file in self.xml_files("acts", paths["acts"]):
            read_acts(file, profile, draft, findings)
        for file in self.xml_files("rules", paths["rules"]):
            read_rules(file, draft, findings)
        self.read_memory(paths["memory"])
        check_links(draft, findings)

        allows = [*read_allows(self.files.read, findings), *allows_of_memory(settings.allows, draft.memory_places)]
        found = findings.sorted()
        silenced: list[Silenced] = []
        if allows:
            found, silenced = silence(found, allows, findings, complete=not findings.errors)
        if findings.errors:
            return Loaded(None, found, silenced=silenced)
        files = self.by_usual_path(paths)
        scenario = Scenario(
            title=settings.title or self.folder.name,
            folder=str(self.folder),
            mode="real" if (mode or settings.mode) == "real" else "debug",
            robot=profile,
            acts=draft.acts,
            rules=draft.rules,
            memory=draft.memory,
            keys=settings.keys,
            act_settings=settings.act_settings,
            fillers=settings.fillers,
            study=settings.study,
            may_release=settings.may_release,
            paths=paths,
            known_keys=frozenset(draft.key_sets),
            topics=frozenset(mention.name for mention in draft.waits),
            hash=_hash(files, profile.name),
        )
        return Loaded(scenario, found, files, silenced)

    def read_settings(self) -> None:
        path = self.folder / (self.path.name if self.path.suffix == ".toml" else NAME)
        source = self.files.source(path, MAX_TOML_BYTES) if os.path.lexists(path) else None
        file = read_toml(source, self.findings) if source is not None else None
        self.file = file or self.file

    def robot(self, name: str, *, asked: bool) -> RobotProfile:
        file = self.file
        place = self.asked if asked else file.value_place("robot")
        profile = read_robot(name or DEFAULT, self.files, place, asked=asked)
        if "actions" in file.values:
            profile = replace(profile, actions=declare(file, profile.actions, "scenario", self.findings))
        return profile

    def read_memory(self, place: str) -> None:
        path = self.folder / place
        if self.exists("memory", path):
            source = self.files.source(path)
            if source is None:
                self.draft.unread.add("memory")
            else:
                read_memory(source, self.draft, self.findings)

    def xml_files(self, kind: str, place: str) -> Iterator[XmlFile]:
        """The XML files of a folder in the order of their names, or the one file that was named."""
        path = self.folder / place
        if not self.exists(kind, path):
            return
        paths = [path]
        if path.is_dir():
            try:
                names = sorted(each.name for each in path.iterdir())
            except OSError as error:
                self.findings.error(
                    "unreadable", Place(place), f"this folder cannot be read: {error.strerror or error}"
                )
                names = []
            paths = [path / name for name in names if name.lower().endswith(".xml") and not name.startswith(".")]
        for each in paths:
            source = self.files.source(each)
            file = read_xml(source, self.findings) if source is not None else None
            if file is None:
                self.draft.unread.add(kind)
            else:
                yield file

    def exists(self, kind: str, path: Path) -> bool:
        """Whether a place is there. One that was named must be; the usual ones need not."""
        try:
            if os.path.lexists(path):  # a link that leads nowhere is there, and cannot be read
                return True
        except (OSError, ValueError):  # a name that no file can have
            pass
        if self.named.get(kind):
            where = self.file.value_place(kind) if self.named[kind] == self.file.values.get(kind) else self.asked
            self.findings.error("unreadable", where, f"there is no file or folder `{self.named[kind]}`")
            self.draft.unread.add(kind)
        return False

    def by_usual_path(self, paths: Mapping[str, str]) -> dict[str, bytes]:
        """What was read, by its usual place."""
        settings = {NAME, self.path.name}
        acts, rules, memory = (self.folder / paths[kind] for kind in ("acts", "rules", "memory"))
        files: dict[str, bytes] = {}
        for source in self.files.read:
            path = self.folder / source.name
            if path == memory:
                name = DEFAULT_PLACES["memory"]
            elif acts in (path, path.parent):
                name = f"acts/{path.name}"
            elif rules in (path, path.parent):
                name = f"rules/{path.name}"
            elif source.name in settings:
                name = NAME
            else:
                name = f"robots/{path.name}"
            files[name] = source.data
        return files


def _hash(files: Mapping[str, bytes], robot: str) -> str:
    """Over everything that was read, in a fixed order, wherever it lay."""
    digest = sha256()
    for name, data in [*sorted(files.items()), ("robot", robot.encode())]:
        digest.update(f"{name}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.hexdigest()
