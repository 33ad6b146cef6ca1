"""From a folder to a checked scenario: read whole, checked whole, refused with all findings at once (semantics, section 1)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_engine.scenario.acts import read_acts
from rise_engine.scenario.draft import Draft
from rise_engine.scenario.findings import Finding, Findings
from rise_engine.scenario.links import check_links, is_set
from rise_engine.scenario.memory import read_memory
from rise_engine.scenario.model import Place, RobotProfile, Scenario
from rise_engine.scenario.robots import DEFAULT, read_robot
from rise_engine.scenario.rules import read_rules
from rise_engine.scenario.schema import act_schema, rule_schema, validate
from rise_engine.scenario.settings import NAME, Settings
from rise_engine.scenario.source import Files, Source
from rise_engine.scenario.toml_places import TomlFile, read_toml
from rise_engine.scenario.xml import XmlFile, read_xml

DEFAULT_PLACES = {"acts": "acts", "rules": "rules", "memory": "memory.json"}


class Loaded(Struct, frozen=True):
    """What came of reading a scenario. There is one exactly when no finding is an error."""

    scenario: Scenario | None
    findings: list[Finding]
    """In reading order, errors and warnings."""

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
    """Read and check a scenario: a folder, or its `scenario.toml`.

    `robot`, `mode` ("debug" or "real") and `places` (keys `acts`, `rules`, `memory`) take precedence over the file.
    Never raises for what a scenario's author wrote.
    """
    return _Loader(Path(path)).load(robot, mode, places or {})


class _Loader:
    def __init__(self, path: Path) -> None:
        self.findings = Findings()
        self.path = path
        is_file = path.name == NAME or path.suffix == ".toml"
        self.folder = Path(os.path.abspath(path.parent if is_file else path))  # noqa: PTH100  # keeps symbolic links
        self.files = Files(self.folder, self.findings)
        self.draft = Draft()

    def load(self, robot: str | None, mode: str | None, places: Mapping[str, str]) -> Loaded:
        findings, draft = self.findings, self.draft
        if not self.folder.is_dir():
            findings.error("unreadable", Place(str(self.path)), "there is no such folder")
            return Loaded(None, findings.sorted())
        file = self.settings_file()
        settings = Settings(file, draft, findings)
        if mode is not None and mode not in ("debug", "real"):
            findings.error("wrong-value", Place(NAME), f'the mode is "debug" or "real", not "{mode}"')
        profile = self.robot(robot if robot is not None else settings.robot, file, asked=robot is not None)
        paths = {key: places.get(key) or settings.places.get(key) or DEFAULT_PLACES[key] for key in DEFAULT_PLACES}
        explicit = {key for key in DEFAULT_PLACES if places.get(key) or settings.places.get(key)}

        checked: list[tuple[XmlFile, str]] = []
        for kind in ("acts", "rules"):
            for source in self.sources(kind, paths[kind], kind in explicit, file):
                before = findings.errors
                xml = read_xml(source, findings)
                if xml is None:
                    continue
                if kind == "acts":
                    read_acts(xml, profile, draft, findings)
                else:
                    read_rules(xml, draft, findings)
                if findings.errors == before:
                    checked.append((xml, kind))
        memory = self.folder / paths["memory"]
        if memory.exists() or "memory" in explicit:
            source_or_none = self.existing(memory, "memory", paths["memory"], file)
            if source_or_none is not None:
                read_memory(source_or_none, draft, findings)
        check_links(draft, findings)
        self.validate(checked, profile)

        found = findings.sorted()
        if findings.errors:
            return Loaded(None, found)
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
            study=settings.study,
            paths=paths,
            known_keys=frozenset(draft.key_sets),
            topics=frozenset(mention.name for mention in draft.waits),
            hash=self.hash(profile.name),
        )
        return Loaded(scenario, found)

    def settings_file(self) -> TomlFile:
        path = self.folder / (self.path.name if self.path.suffix == ".toml" else NAME)
        source = self.files.source(path) if path.exists() else None
        file = read_toml(source, self.findings) if source is not None else None
        return file if file is not None else TomlFile(Source(NAME, b"", ""), {})

    def robot(self, name: str, file: TomlFile, *, asked: bool) -> RobotProfile:
        from msgspec.structs import replace

        from rise_engine.scenario.actions import declare

        place = Place(NAME) if asked or "robot" not in file.values else file.value_place("robot")
        profile = read_robot(name or DEFAULT, self.files, place)
        if "actions" in file.values:
            profile = replace(profile, actions=declare(file, profile.actions, "scenario", self.findings))
        return profile

    def sources(self, kind: str, place: str, explicit: bool, file: TomlFile) -> list[Source]:
        """The XML files of a folder in the order of their names, or the one file that was named."""
        path = self.folder / place
        if not path.exists():
            if explicit:
                self.missing(kind, place, file)
            return []
        if not path.is_dir():
            source = self.files.source(path)
            return [source] if source is not None else []
        try:
            names = sorted(os.listdir(path))  # noqa: PTH208  # one system call
        except OSError as error:
            self.findings.error("unreadable", Place(place), f"this folder cannot be read: {error.strerror or error}")
            return []
        wanted = [name for name in names if name.lower().endswith(".xml") and not name.startswith(".")]
        sources = [self.files.source(path / name) for name in wanted]
        return [source for source in sources if source is not None]

    def existing(self, path: Path, kind: str, place: str, file: TomlFile) -> Source | None:
        if path.exists():
            return self.files.source(path)
        self.missing(kind, place, file)
        return None

    def missing(self, kind: str, place: str, file: TomlFile) -> None:
        where = file.value_place(kind) if kind in file.values else Place(NAME)
        self.findings.error("unreadable", where, f"there is no file or folder `{place}`")

    def validate(self, files: list[tuple[XmlFile, str]], profile: RobotProfile) -> None:
        """The schemas that editors use must agree with the checks above; if one does not, that is told, not hidden."""
        schemas: dict[str, Any] = {}
        for xml, kind in files:
            if kind not in schemas:
                schemas[kind] = act_schema(profile.actions) if kind == "acts" else rule_schema()
            validate(xml, schemas[kind], self.findings)

    def hash(self, robot: str) -> str:
        """Over everything that was read, in a fixed order, wherever it lay."""
        from hashlib import sha256

        digest = sha256()
        parts = sorted(
            (source.name if not Path(source.name).is_absolute() else f"/{Path(source.name).name}", source.data)
            for source in self.files.read
        )
        for name, data in [*parts, ("robot", robot.encode())]:
            digest.update(f"{name}\0{len(data)}\0".encode())
            digest.update(data)
        return digest.hexdigest()


__all__ = ["Loaded", "is_set", "load"]
