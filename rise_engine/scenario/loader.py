"""Reads a folder into a checked scenario, or refuses it as a whole (docs/reference/scenario.md)."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, limited_comparisons
from rise_engine.scenario.checking.cross_references import check_cross_references, check_failures
from rise_engine.scenario.checking.find_uses_in_settings import uses_in_memory, uses_in_settings, uses_in_trials
from rise_engine.scenario.checking.memory_paths import factors_read, keys_read
from rise_engine.scenario.checking.uses import Use, Uses, uses_in_acts, uses_in_rules
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import MAX_TOML_BYTES, FileReader, Memo, SourceFile, Value
from rise_engine.scenario.files.study_paths import (
    DEFAULT_PATHS,
    LEXICON_FILE,
    SCENARIO_FILE,
    TEXTS_FOLDER,
    why_not_read,
)
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, toml_of
from rise_engine.scenario.files.tree import FileTree, Held, contents_of_interrupted_save
from rise_engine.scenario.files.xml import XmlFile, xml_of
from rise_engine.scenario.model import SESSION, LexiconTable, RobotProfile, Scenario, SourceLocation
from rise_engine.scenario.reading.act_settings import ActTables
from rise_engine.scenario.reading.action_declarations import apply_declarations, name_places, read_places
from rise_engine.scenario.reading.acts import read_acts, report_unsent_ssml
from rise_engine.scenario.reading.element_templates import LIBRARY, PATTERNS, ElementTemplate, TemplateCollection
from rise_engine.scenario.reading.expansion import expand_files
from rise_engine.scenario.reading.lexicon import read_lexicon
from rise_engine.scenario.reading.memory import read_memory
from rise_engine.scenario.reading.robot_profiles import DEFAULT_ROBOT, builtin_robot, read_robot, robot_names
from rise_engine.scenario.reading.rules import read_rules
from rise_engine.scenario.reading.scenario_toml import ScenarioSettings
from rise_engine.scenario.reading.suppressions import (
    SuppressedWarning,
    Suppression,
    apply_suppressions,
    memory_suppressions,
    read_suppressions,
    with_ends,
)
from rise_engine.scenario.reading.tables import TABLES_FOLDER, ScenarioLanguages, read_tables
from rise_engine.scenario.reading.translations import LanguageTexts, TranslationReader, translated_languages
from rise_engine.scenario.shipped_studies import shipped_hint
from rise_engine.scenario.speech.spoken_texts import SpokenText, TableText


class WrittenParts(Struct, frozen=True):
    """The files of acts and rules, as written and with their templates expanded."""

    acts: Sequence[XmlFile] = ()
    rules: Sequence[XmlFile] = ()
    templates: Mapping[str, Mapping[str, str | None]] = {}
    """The parameters of each used template with their defaults; None: the parameter is required."""
    unreadable: Mapping[str, str] = {}
    """Files that are not well-formed XML, each with its first error. Some are still read after a repair."""


class LoadResult(Struct, frozen=True):
    """The result of reading a scenario. There is a scenario if and only if no diagnostic is an error."""

    scenario: Scenario | None
    diagnostics: list[Diagnostic]
    """Errors and warnings, in reading order."""
    files: dict[str, bytes] = {}
    """The files that were read, by their path in a usual folder (`acts/greet.xml`, `memory.json`, `robots/nao.toml`).
    Written to these paths (`DEFAULT_PATHS`), they make the same scenario."""
    suppressed: list[SuppressedWarning] = []
    """Warnings that are silenced on purpose, in reading order. `diagnostics` lacks them."""
    act_tables: ActTables = field(default_factory=ActTables)
    """The settings of acts in scenario.toml."""
    draft: ScenarioDraft = field(default_factory=ScenarioDraft)
    """All readable parts, even with errors: acts, rules, memory, tables, and the names that they use."""
    robot: RobotProfile = field(default_factory=builtin_robot)
    """The robot's profile; with errors, the valid part."""
    translations: dict[str, LanguageTexts] = {}
    """By language; with errors, the readable part."""
    texts: tuple[SpokenText, ...] = ()
    """All texts of the acts, untranslated and in order; also with errors."""
    uses: Uses = field(default_factory=partial(Uses, ()))
    """The uses of names in the readable files."""
    table_texts: tuple[TableText, ...] = ()
    """The texts in the tables; empty: the study has only one language."""
    parts: WrittenParts = field(default_factory=WrittenParts)

    def __iter__(self) -> Iterator[Any]:
        """Support `scenario, diagnostics = load(...)`."""
        return iter((self.scenario, self.diagnostics))

    @property
    def errors(self) -> list[Diagnostic]:
        return [diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error"]


def load(
    path: str | os.PathLike[str],
    *,
    robot: str | None = None,
    mode: str | None = None,
    paths: Mapping[str, str] | None = None,
    language: str | None = None,
    allow_untranslated: bool = False,
    held: Held | None = None,
) -> LoadResult:
    """Read and check a scenario.

    Arguments:
        path: its folder, or the `scenario.toml` in it.
        robot: the name of a profile (docs/reference/robots.md); overrides the file.
        mode: "debug" or "real"; overrides the file.
        paths: the places of `acts`, `rules` and `memory`, relative to the folder; overrides the file.
        language: the language in which the robot speaks (`texts/LANGUAGE.toml`); None: the language of the acts.
        allow_untranslated: whether untranslated texts may be spoken in the language of the acts.
        held: contents of files that replace those on the disk, by their names relative to the folder
            (`acts/greet.xml`); None: as if the file did not exist. The disk is not read for these files.

    Returns the checked scenario with its warnings, or no scenario and all errors, each with file, line, column and a
    sentence. Mistakes in the files and unreadable files raise no exception.

    >>> loaded = load("scenarios/greeting")
    >>> loaded.scenario.title, "person_name" in loaded.scenario.memory
    ('Greeting a visitor', True)
    >>> loaded.diagnostics
    []
    >>> str(load("scenarios/greetings").diagnostics[0]).partition(";")[0]
    'scenarios/greetings:1:1: error unreadable: there is no such folder'
    """
    with limited_comparisons():
        return ScenarioLoader(Path(path), held).load(robot, mode, paths or {}, language or "", allow_untranslated)


def expanded_files(scenario: Scenario) -> list[XmlFile]:
    """The files of acts and rules of a scenario that `load` has accepted, with their templates expanded."""
    loader = ScenarioLoader(Path(scenario.folder))
    files = {kind: list(loader.read_xml_files(kind, scenario.paths[kind])) for kind in ("acts", "rules")}
    return [file for kind in loader.expand_files(files).values() for file in kind]


class ScenarioLoader:
    """Reads one scenario once, as documented in `load`; `ScenarioChecker` repeats it."""

    def __init__(self, path: Path, held: Held | None = None, memo: Memo | None = None) -> None:
        """
        :param path: the scenario's folder, or the `scenario.toml` in it.
        :param held: contents that replace those on the disk.
        :param memo: cached results.
        """
        self.memo = memo or Memo()
        self.diagnostics = Diagnostics()
        self.path = path
        is_file = path.name == SCENARIO_FILE or path.suffix == ".toml"
        self.folder = Path(os.path.abspath(path.parent if is_file else path))  # noqa: PTH100  # keeps symbolic links
        self.tree = FileTree(self.folder, {**contents_of_interrupted_save(self.folder), **(held or {})}, closed=True)
        self.files = FileReader(self.folder, self.diagnostics, self.tree, self.memo)
        self.draft = ScenarioDraft(self.memo.expressions, self.memo.assignments)
        self.file = self.memo.get("no scenario.toml", lambda: TomlFile(SourceFile(SCENARIO_FILE, b"", ""), {}))
        self.memory_source: SourceFile | None = None
        self.named: dict[str, str] = {}
        self.caller = SourceLocation(str(path))
        """The location for errors in the caller's arguments, which no file contains."""
        self.templates: Mapping[str, ElementTemplate] = {}
        self.unread: list[str] = []
        """The files of acts and rules that are not well-formed XML."""

    def load(
        self,
        robot: str | None,
        mode: str | None,
        paths: Mapping[str, str],
        language: str = "",
        allow_untranslated: bool = False,
    ) -> LoadResult:
        diagnostics, draft = self.diagnostics, self.draft
        if not self.tree.is_folder(self.folder):
            diagnostics.error("unreadable", SourceLocation(str(self.path)), f"there is no such folder{shipped_hint()}")
            return LoadResult(None, diagnostics.sorted())
        self.read_settings()
        settings = self.read_part(("settings", self.file), partial(ScenarioSettings, self.file))
        if mode is not None and mode not in ("debug", "real"):
            diagnostics.error("wrong-value", self.caller, f'the mode asked for is "debug" or "real", not "{mode}"')
        profile = self.read_robot_profile(robot if robot is not None else settings.robot, asked=robot is not None)
        self.named = {**settings.paths, **paths}
        paths = {key: self.named.get(key) or usual_path for key, usual_path in DEFAULT_PATHS.items()}

        languages = ScenarioLanguages(settings.language, translated_languages(self.files, settings.languages))
        read_tables(self.files, draft, diagnostics, languages)
        expanded = self.expand_files({kind: list(self.read_xml_files(kind, paths[kind])) for kind in ("acts", "rules")})
        number = self.memo.number("robot", profile)
        for file in expanded["acts"]:
            self.read_part(("acts", file, number), partial(read_acts, file, profile))
        for file in expanded["rules"]:
            self.read_part(("rules", file), partial(read_rules, file))
        self.draft.define(diagnostics)
        self.read_memory(paths["memory"])
        report_unsent_ssml(profile, draft, diagnostics)
        translations = self.read_translations(settings, profile, language, allow_untranslated)
        lexicon = self.read_lexicon(settings.language, profile.name)
        check_cross_references(draft, diagnostics)
        if "acts" not in draft.unreadable_parts:
            settings.act_tables.check_patterns(draft.acts, diagnostics)
            if self.file.values:  # RISE's own files alone do not define the reaction to a failure
                check_failures(draft, settings.act_tables, settings.on_failure, profile, diagnostics)

        suppressions = [
            *(each for source in self.files.sources for each in self.read_suppressions(source)),
            *memory_suppressions(settings.suppressions, draft.memory_key_locations),
        ]
        found, silenced = apply_suppressions(suppressions, diagnostics)
        found = with_ends(found, {source.name: source for source in self.files.sources})
        read = LoadResult(
            None,
            found,
            suppressed=silenced,
            draft=draft,
            robot=profile,
            uses=Uses(self.find_uses(expanded, number, profile)),
            translations=translations.found,
            texts=translations.all_texts,
            table_texts=translations.table_texts,
            parts=self.written_parts(expanded, found),
        )
        if diagnostics.errors:
            return read
        files = self.files_by_usual_path(paths)
        scenario = Scenario(
            title=settings.title or self.folder.name,
            folder=str(self.folder),
            mode="real" if (mode or settings.mode) == "real" else "debug",
            robot=profile,
            acts=translations.translated(language) if language else draft.acts,
            rules=draft.rules,
            memory=draft.memory,
            tables={name: table.in_language(language) for name, table in draft.tables.items()},
            keys=settings.keys,
            act_settings=settings.act_tables.settings_by_act(draft.acts),
            fillers=settings.fillers,
            cue_keep=settings.cue_keep,
            study=settings.study,
            conditions=settings.conditions,
            private=settings.private,
            language=language or settings.language,
            languages=tuple(translations.found),
            says_language=bool(language),
            lexicon=lexicon,
            may_release=settings.may_release,
            on_failure=settings.on_failure,
            explore=settings.explore,
            properties=settings.properties,
            trials=settings.trials,
            paths=paths,
            known_keys=frozenset(draft.settable_keys),
            keys_read=keys_read(draft),
            reads_session=bool(draft.session_keys),
            factors_read=factors_read(draft),
            topics=frozenset(mention.name for mention in draft.awaited_topics),
            hash=_hash(files, profile.name, language),
        )
        return replace(read, scenario=scenario, files=files, act_tables=settings.act_tables)

    def read_part(self, key: Hashable, read: Callable[[ScenarioDraft, Diagnostics], Value]) -> Value:
        return self.memo.read_part(key, self.draft, self.diagnostics, read)

    def find_uses(self, files: dict[str, list[XmlFile]], robot_number: int, robot: RobotProfile) -> Iterator[Use]:
        """The uses of names, in no order. Unchanged files are not searched again."""
        draft, memo = self.draft, self.memo
        sources = {source.name: source for source in self.files.sources}
        lists = [memo.get(("uses", self.file), partial(uses_in_settings, self.file))]
        lists.append(uses_in_trials(self.file, draft.rules))
        if self.memory_source is not None:
            lists.append(memo.get(("uses", self.memory_source), partial(uses_in_memory, self.memory_source)))
        for file in files["acts"]:
            lists.append(memo.get(("uses", file, robot_number), partial(uses_in_acts, file, robot, sources)))
        for file in files["rules"]:
            lists.append(memo.get(("uses", file), partial(uses_in_rules, file, sources)))
        for use in (use for uses in lists for use in uses):
            head = use.name.partition(".")[0]
            is_of_engine = use.kind == "key" and (head in draft.tables or (head == SESSION and draft.session_keys))
            if not is_of_engine and (not use.may_be_text or draft.settable_keys & {use.name, head}):
                yield use

    def read_settings(self) -> None:
        path = self.folder / (self.path.name if self.path.suffix == ".toml" else SCENARIO_FILE)
        exists = self.tree.exists(path)
        source = self.files.read(path, MAX_TOML_BYTES) if exists else None
        file = toml_of(source, self.files) if source is not None else None
        if exists and (file is None or file.source is not source):  # without the lines that are not TOML
            self.draft.unreadable_parts.add("settings")
        self.file = file or self.file

    def read_robot_profile(self, name: str, *, asked: bool) -> RobotProfile:
        file = self.file
        location = self.caller if asked else file.value_location("robot")
        profile = read_robot(name or DEFAULT_ROBOT, self.files, location, asked=asked)

        def make(diagnostics: Diagnostics) -> RobotProfile:
            table = TomlTable(file, (), file.values, diagnostics)
            places = read_places(table, profile.places)
            actions = apply_declarations(table, profile.actions, "scenario")
            return replace(profile, actions=name_places(actions, places), places=places)

        return self.memo.read(("robot", file, self.memo.number("profile", profile)), self.diagnostics, make)

    def read_memory(self, relative_path: str) -> None:
        path = self.folder / relative_path
        if self.check_exists("memory", path):
            source = self.memory_source = self.files.read(path)
            if source is None:
                self.draft.unreadable_parts.add("memory")
            else:
                tables = tuple(self.draft.tables)
                self.read_part(("memory", source, tables), partial(read_memory, source, tables))

    def read_suppressions(self, source: SourceFile) -> list[Suppression]:
        return self.memo.read(("allow", source), self.diagnostics, lambda found: read_suppressions([source], found))

    def read_translations(
        self, settings: ScenarioSettings, robot: RobotProfile, language: str, allow_untranslated: bool
    ) -> TranslationReader:
        """Read the translations and compare them with the acts; report a missing chosen language."""
        reader = TranslationReader(robot, self.draft, settings.language, language, self.diagnostics)
        reader.read(self.files, settings.languages)
        reader.report_missing(allow=allow_untranslated)
        self.draft.spoken_languages.update(reader.found)
        known = [*filter(None, (settings.language, *reader.found))]
        if language and language not in known:
            near = did_you_mean(language, known, limit=0)
            has = f"; it is in {in_backquotes(known)}" if known and not near else near
            remedy = "" if known else '; write its language in scenario.toml: language = "en"'
            message = f"this study is not in the language `{language}`{has}{remedy}"
            self.diagnostics.error("unknown-language", self.caller, message)
        return reader

    def read_lexicon(self, language: str, robot: str) -> tuple[LexiconTable, ...]:
        """Read the lexicon; empty: the folder has no such file."""
        path = self.folder / LEXICON_FILE
        source = self.files.read(path, MAX_TOML_BYTES) if self.tree.exists(path) else None
        file = toml_of(source, self.files) if source is not None else None
        if file is None:
            return ()
        return read_lexicon(file, language, {*robot_names(self.folder, self.tree), robot}, self.draft, self.diagnostics)

    def read_xml_files(self, kind: str, relative_path: str) -> Iterator[XmlFile]:
        """Yield the XML files of a folder in the order of their names, or the single file."""
        path = self.folder / relative_path
        if not self.check_exists(kind, path):
            return
        paths = [path]
        if self.tree.is_folder(path):
            try:
                names = self.tree.names(path)
            except OSError as error:
                message = f"this folder cannot be read: {error.strerror or error}"
                self.diagnostics.error("unreadable", SourceLocation(relative_path), message)
                names = []
            paths = [path / name for name in names if name.lower().endswith(".xml") and not name.startswith(".")]
        for each in paths:
            source = self.files.read(each)
            file = xml_of(source, self.files) if source is not None else None
            if file is None or file.repaired is not None:
                self.unread.append(self.files.display_name(each))
            if file is None:
                self.draft.unreadable_parts.add(kind)
            else:
                yield file

    def expand_files(self, files: dict[str, list[XmlFile]]) -> dict[str, list[XmlFile]]:
        """Expand the templates in these files."""
        templates = TemplateCollection(self.files, self.draft, self.diagnostics)
        templates.read(file for kind in files for file in files[kind] if file.may_have_templates)
        self.templates = templates.templates
        rest = iter(expand_files([file for kind in files for file in files[kind]], templates))
        expanded = {kind: [next(rest) for _ in files[kind]] for kind in files}
        for kind, those in expanded.items():
            if not all(file.is_complete(file.root) for file in those):
                self.draft.unreadable_parts.add(kind)
        return expanded

    def written_parts(self, files: Mapping[str, list[XmlFile]], found: Iterable[Diagnostic]) -> WrittenParts:
        """The files from which the acts and rules were read."""
        unreadable: dict[str, str] = {}
        for each in found:
            if each.severity == "error" and each.location.file in self.unread:
                unreadable.setdefault(each.location.file, f"line {each.location.line}: {each.message}")
        return WrittenParts(
            tuple(file for file in files["acts"] if file.source.name not in unreadable),
            tuple(file for file in files["rules"] if file.source.name not in unreadable),
            {name: template.defaults for name, template in self.templates.items()},
            unreadable,
        )

    def check_exists(self, kind: str, path: Path) -> bool:
        """Whether a place in the study's folder exists. A place in the settings must exist; the usual ones need not."""
        named = self.named.get(kind, "")
        where = SourceLocation(path.name)
        if named:
            where = self.file.value_location(kind) if named == self.file.values.get(kind) else self.caller
        try:
            if problem := why_not_read(self.folder, named or path.name):
                self.diagnostics.error("outside-study", where, problem)
                self.draft.unreadable_parts.add(kind)
                return False
            if self.tree.exists(path):  # true also for a broken link, which cannot be read
                return True
        except (OSError, ValueError):  # a name that is not allowed
            pass
        if named:
            self.diagnostics.error("unreadable", where, f"there is no file or folder `{named}`")
            self.draft.unreadable_parts.add(kind)
        return False

    def files_by_usual_path(self, paths: Mapping[str, str]) -> dict[str, bytes]:
        """The files that were read, by their usual paths."""
        settings = {SCENARIO_FILE, self.path.name}
        acts, rules, memory = (self.folder / paths[kind] for kind in ("acts", "rules", "memory"))
        files: dict[str, bytes] = {}
        for source in self.files.sources:
            path = self.folder / source.name
            if path.parent == self.folder / TABLES_FOLDER:
                name = f"{TABLES_FOLDER}/{path.name}"
            elif path == memory:
                name = DEFAULT_PATHS["memory"]
            elif acts in (path, path.parent):
                name = f"acts/{path.name}"
            elif rules in (path, path.parent):
                name = f"rules/{path.name}"
            elif path.parent == self.folder / TEXTS_FOLDER:
                name = f"{TEXTS_FOLDER}/{path.name}"
            elif path.parent in (LIBRARY, self.folder / PATTERNS) and path.suffix == ".xml":
                name = f"{PATTERNS}/{path.name}"
            elif source.name in settings:
                name = SCENARIO_FILE
            elif source.name == LEXICON_FILE:
                name = LEXICON_FILE
            else:
                name = f"robots/{path.name}"
            files[name] = source.data
        return files


def _hash(files: Mapping[str, bytes], robot: str, language: str = "") -> str:
    """Hash all files in a fixed order, independent of their places, and the requested language."""
    digest = sha256()
    asked = [("language", language.encode())] if language else []
    for name, data in [*sorted(files.items()), ("robot", robot.encode()), *asked]:
        digest.update(f"{name}\0{len(data)}\0".encode())
        digest.update(data)
    return digest.hexdigest()
