"""Makes a bundle: all parts of a study that others need, at one level, with a list of its contents."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path, PurePosixPath

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import make_private_folder, write_private_file
from rise_engine.base.text import pluralize
from rise_engine.privacy.sharing import share_session
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.bundle.about import (
    ABOUT_FILE,
    AboutBundle,
    BundleOptions,
    ReviewList,
    license_text,
    readme_text,
    write_about,
)
from rise_engine.results.bundle.contents import (
    ENVIRONMENT_FILE,
    PROGRAM,
    copy_scenarios,
    environment_text,
    log_text,
    name_at_level,
    participants_text,
    study_text,
    wheel_in,
    write_program,
)
from rise_engine.results.bundle.crate import (
    METADATA,
    CrateContents,
    CrateSession,
    fingerprint,
    manifest_text,
    metadata_text,
    write_zip,
)
from rise_engine.results.bundle.derived import (
    FORMATS,
    REPORT,
    check_inputs,
    sessions_in_order,
    with_license,
    write_derived,
)
from rise_engine.results.export.format import HAS_WITHDRAWN, ExportError, OmittedSession, load_format
from rise_engine.results.export.trial_tables import answers_at_level, answers_text
from rise_engine.results.export.writing import export_context, new_export
from rise_engine.session.coded import coded_paths
from rise_engine.session.folder import INFO, JOURNAL
from rise_engine.session.media import MEDIA_FILE
from rise_engine.session.scenario_copies import copy_folders
from rise_engine.session.shadow import shadow_files
from rise_engine.study.labels import RUN_BY_WITHDRAWN
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.proof import prove_sessions
from rise_engine.study.publishing import authors_of
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.study_log import LOG_FILE
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import MANIFEST_FILE, PARTICIPANTS_FILE, wizard_names

SESSIONS = "sessions"
UNPROVED = "unproved"
"""Exports of sessions that are not in the bundle, so that they cannot be made again."""


class BundleReport(Struct):
    """The result of making a bundle, in lines for a person."""

    contents: list[str] = field(default_factory=list)
    omitted: list[str] = field(default_factory=list)
    to_check: list[str] = field(default_factory=list)
    """What a person should check before sharing it."""
    sessions: int = 0
    """The number of sessions in it."""
    fingerprint: str = ""
    """The checksum of its checksums."""


def make_bundle(
    state: StudyStatus,
    folders: Sequence[Path],
    out: Path,
    options: BundleOptions,
    *,
    omitted: Sequence[OmittedSession] = (),
    remarks: Sequence[str] = (),
) -> BundleReport:
    """Make the bundle of a study.

    :param state: the study's state.
    :param folders: its sessions, in the order of their starts.
    :param out: a new folder, or a new file whose name ends in `.zip`.
    :param options: the options of the bundle.
    :param omitted: sessions of the study that are not in `folders`.
    :param remarks: sentences on other omitted sessions, without names and paths.
    :raises ExportError: it cannot be made. Nothing of it remains.
    """
    if state.interrupted or state.damaged:
        raise ExportError("no bundle was made", *state.interrupted, *state.damaged)
    if not folders:
        raise ExportError("there is no session to put into a bundle", *map(str, omitted), *remarks)
    study, is_folder = Path(state.study.folder).resolve(), out.suffix != ".zip"
    people = {study: state.pseudonyms}
    try:
        with new_export(out, folders, "bundle", options.level, folder=is_folder, people=people) as export:
            bundle = _Bundle(read_state(study), folders, options)  # read again: from now on, changes are detected
            bundle.report.to_check += [*map(str, omitted), *export.problems]
            here = export.here
            root = here if out.suffix != ".zip" else here.with_name("bundle")
            root.mkdir(0o700)
            bundle.write(root, omitted, remarks)
            if root != here:
                write_zip(root, here)
    except (ExportError, SessionError) as error:
        raise ExportError(str(error)) from None
    return bundle.report


class _Bundle:
    """The work of making one bundle."""

    def __init__(self, state: StudyStatus, folders: Sequence[Path], options: BundleOptions) -> None:
        self._state = state
        self._study = with_license(state.study, options)
        self._folders = list(folders)
        self._options = options
        self._level = options.level
        self._people = dict(wizard_names(Path(state.study.folder)))
        """The code of each wizard, by name."""
        self._sessions: list[CrateSession] = []
        self._names: dict[str, str] = {}
        """The name of each session in the bundle, by its folder's name."""
        self._unread: list[OmittedSession] = []
        self._absent: dict[str, str] = {}
        """Why logged sessions are not in the bundle, by their names in its log."""
        self._versions: dict[str, set[str]] = {}
        self._identical = 0
        """The number of sessions that replay record for record."""
        self._review_list = ReviewList(state.study, options.level)
        self.report = BundleReport()

    def write(self, root: Path, omitted: Sequence[OmittedSession], remarks: Sequence[str]) -> None:
        """Write everything; metadata and checksums come last. Raises SessionError, ExportError, OSError."""
        self._write_sessions(root / SESSIONS)
        self._list_omitted([*omitted, *self._unread])
        self.report.omitted += remarks
        inputs = self._write_study(root)
        about = AboutBundle(self._options, rehearsals=self._rehearsals(), absent=self._absent)
        write_about(root, about)
        for name, warning in write_derived(root, root, about):
            self._review_list.add_warnings(name, [warning])
        self._write_unproved(root)
        license = self._study.report.get("license", "")
        (root / "LICENSE").write_text(license_text(license, self._study), "utf-8")
        if why := write_program(root):
            self.report.omitted.append(f"the program, because {why}; {ENVIRONMENT_FILE} says which one it was")
        (root / ENVIRONMENT_FILE).write_text(environment_text(self._versions), "utf-8")
        state = read_state(root)
        changed = check_inputs(root, state, sessions_in_order(root, state)).problems
        for proof in prove_sessions(root, state, absent=self._absent):
            self._identical += proof.identical
            if not proof.proved:
                differs = (proof.comparison.why,) if proof.comparison is not None and not proof.identical else ()
                changed += [f"{proof.name}: {each}" for each in (*differs, *proof.problems)]
        self.report.to_check += [f"{each}. rise-engine reproduce will report it too" for each in changed]
        self.report.to_check += self._review_list.sentences(root, self._people, license)
        self.report.contents += self._contents(root)
        readme = readme_text(self._study, self._level, self.report.contents, self.report.omitted, wheel_in(root))
        (root / "README.md").write_text(readme, "utf-8")
        (root / METADATA).write_text(metadata_text(root, self._crate_contents(inputs, license)), "utf-8")
        (root / MANIFEST_FILE).write_text(manifest_text(root), "utf-8")
        self.report.fingerprint = fingerprint(root)

    # --- sessions ---

    def _read(self) -> Iterator[SessionData]:
        return read_sessions(
            self._folders, level=self._level, private=self._options.private, on_unreadable=self._note_unreadable
        )

    def _note_unreadable(self, folder: Path, error: SessionError) -> None:
        why = OmittedSession(folder.name, "it cannot be read", f"it cannot be read: {error}", unread=True)
        if why not in self._unread:
            self._unread.append(why)
            self.report.to_check.append(str(why))

    def _list_omitted(self, omitted: Sequence[OmittedSession]) -> None:
        """List the omitted sessions for others, with their names at the level. Withdrawn participants are not named."""
        gone = [each for each in omitted if each.why == HAS_WITHDRAWN]
        if gone:
            self.report.omitted.append(f"{pluralize(len(gone), 'session')}, because the participant has withdrawn")
        known = {each.name for each in self._state.sessions}
        for each in omitted:
            if each not in gone:
                name = f"session {name_at_level(each.name, self._names, self._level)}"
                self.report.omitted.append(f"{name if each.name in known else 'a folder'}, because {each.why}")

    def _write_sessions(self, target: Path) -> None:
        target.mkdir(0o700)
        for data in self._read():
            name = data.facts.session
            self._names[data.folder.name] = name
            for program, version in data.facts.versions.items():
                self._versions.setdefault(program, set()).add(version)
            self._review_list.add(data)
            where = f"{SESSIONS}/{name}/"
            try:
                self._write_session(data, target / name)
                self.report.sessions += 1
            except SessionError as error:
                why = str(error).replace(str(data.folder), name)
                self.report.omitted.append(
                    f"session {name} itself, because {why}. Its exports at this level are in {UNPROVED}/"
                )
                where = ""
                self._absent[name] = f"it could not be shared; its exports at this level are in {UNPROVED}/"
            self._sessions.append(CrateSession(data.facts, where))
            if self._level != "full" and (shadows := len(shadow_files(data.folder))):
                self.report.omitted.append(
                    f"{pluralize(shadows, 'shadow')} of {name}: they hold what second wizards typed, so only level "
                    "full includes them; rise-engine agree shows what they decided"
                )
            if self._level == "full" and data.media:
                recordings = pluralize(len(data.media), "recording")
                self.report.omitted.append(f"{recordings} of {name}: add the files yourself, if people agreed to that")
        if not self._sessions:
            raise ExportError("no session could be read", *map(str, self._unread))

    def _write_session(self, data: SessionData, target: Path) -> None:
        if self._level == "full":
            _copy_session(data.folder, target)
            return
        run_as = data.facts.run_as if data.facts.run_as == RUN_BY_WITHDRAWN else ""
        shared = share_session(
            data.folder,
            target,
            level=self._level,
            private=self._options.private,
            wizards=self._people,
            run_as=run_as,
        )
        self._people.update(shared.people)
        self._review_list.add_shared(target, shared)

    # --- the study ---

    def _write_study(self, root: Path) -> list[str]:
        """Write the study's files. Returns those from which all sessions were run."""
        study, folder = self._study, Path(self._study.folder)
        text = (folder / STUDY_FILE).read_text("utf-8")
        (root / STUDY_FILE).write_text(study_text(text, self._people, self._level), "utf-8")
        there = {each.facts.participant for each in self._sessions}
        people = [each for each in self._state.participants if each.participant in there]
        (root / PARTICIPANTS_FILE).write_text(participants_text(study, people, self._level), "utf-8")
        self._review_list.add_people(people)
        others = len(self._state.participants) - len(people)
        if others:
            self.report.omitted.append(
                f"{pluralize(others, 'participant')} of {PARTICIPANTS_FILE} who {'has' if others == 1 else 'have'} no "
                "session in it"
            )
        self.report.omitted.append(f"the comments in {PARTICIPANTS_FILE}")
        inputs = [STUDY_FILE]
        standing = self._state.standing
        if standing.complete >= standing.wanted and (folder / PLAN_FILE).is_file():
            shutil.copyfile(folder / PLAN_FILE, root / PLAN_FILE)
            inputs.append(PLAN_FILE)
        elif (folder / PLAN_FILE).is_file():
            self.report.omitted.append(
                f"{PLAN_FILE}, because the study is not complete and it says what the next participants get"
            )
        warnings: list[str] = []
        for answers in answers_at_level(study, self._level, (each.facts for each in self._sessions), warnings):
            file = root / answers.settings.file
            make_private_folder(file.parent)
            write_private_file(file, answers_text(answers).encode())
            inputs.append(answers.settings.file)
            self.report.omitted += answers.omitted
        names, people_names = self._names, self._people
        (root / LOG_FILE).write_text(log_text(self._state.log, names, people_names, self._level), "utf-8")
        for each in self._state.sessions:
            if each.name not in names and (self._level == "full" or each.entry.purpose == "counted"):
                self._absent[name_at_level(each.name, names, self._level)] = "it was left out when the bundle was made"
        copied, omitted = copy_scenarios(study, root)
        self.report.omitted += omitted
        return [*inputs, *copied]

    def _rehearsals(self) -> dict[str, int]:
        """Count the omitted rehearsals by their purpose."""
        omitted = (each.entry.purpose for each in self._state.sessions if each.name not in self._names)
        return dict(Counter(purpose for purpose in omitted if purpose != "counted"))

    # --- exports ---

    def _write_unproved(self, root: Path) -> None:
        """Write the exports of sessions that cannot be shared."""
        if not any(not each.folder for each in self._sessions):
            return
        absent = {each.facts.session for each in self._sessions if not each.folder}
        (root / UNPROVED).mkdir(0o700)
        for name in FORMATS:
            context = export_context(self._folders, self._level)
            context.standing, context.study = self._state.standing, self._study
            sessions = (data for data in self._read() if data.facts.session in absent)
            load_format(name).write(root / UNPROVED / name, sessions, context)

    # --- about all of it ---

    def _contents(self, root: Path) -> list[str]:
        counts: Counter[str] = Counter()
        for path in root.rglob("*"):
            if path.is_file():
                counts[path.relative_to(root).parts[0]] += 1
        people = len({each.facts.participant for each in self._sessions})
        every = self._identical == self.report.sessions
        descriptions = {
            SESSIONS: f"{pluralize(self.report.sessions, 'session')} of {pluralize(people, 'participant')}, "
            f"{'which' if every else f'{self._identical} of which'} can be run again (rise-engine reproduce)",
            STUDY_FILE: "the design",
            PARTICIPANTS_FILE: "pseudonyms, strata, declared columns",
            PLAN_FILE: "who got what",
            LOG_FILE: "what happened with the study",
            "tables": "acts, events and sessions as tables",
            "bids": "the same as a data set of BIDS",
            REPORT: "the report, and the sheet of what a paper should say",
            PROGRAM: "the program that made it, for pip",
            **{PurePosixPath(each.file).parts[0]: "answers to questionnaires" for each in self._study.questionnaires},
            UNPROVED: "tables and BIDS of sessions that are not in it",
            ABOUT_FILE: "the options that it was made with",
            "LICENSE": "what others may do with it",
            ENVIRONMENT_FILE: "versions of programs, and where they come from",
        }
        lines = []
        for name in sorted(counts):
            files = f" ({pluralize(counts[name], 'file')})" if (root / name).is_dir() else ""
            lines.append(f"{name}{'/' if files else ''}: {descriptions.get(name, 'a scenario')}{files}")
        return lines

    def _crate_contents(self, inputs: Sequence[str], license: str) -> CrateContents:
        study = self._study
        standing = self._state.standing
        return CrateContents(
            name=study.title,
            description=f"The study {study.title!r} ({study.id}): design, scenario, records of "
            f"{pluralize(len(self._sessions), 'session')} with a robot, exports. Level: {self._level}. "
            f"{standing.complete} of {standing.wanted} participants are complete."
            + (f" Ethics: {study.report['ethics']}" if study.report.get("ethics") else ""),
            published=datetime.now().astimezone().date().isoformat(),
            license=license,
            authors=authors_of(study.report),
            funding=study.report.get("funding", ""),
            sessions=tuple(
                replace(each, facts=replace(each.facts, started="")) if self._level != "full" else each
                for each in self._sessions
            ),
            inputs=tuple(inputs),
        )


def _copy_session(source: Path, target: Path) -> None:
    copies = (path for copy in copy_folders(source) for path in sorted(copy.rglob("*")))
    files = [source / INFO, source / JOURNAL, source / MEDIA_FILE, *shadow_files(source), *coded_paths(source)]
    for path in [*files, *copies]:
        if path.is_file() and not path.is_symlink():
            copy = target / path.relative_to(source)
            make_private_folder(copy.parent)
            shutil.copyfile(path, copy)
