"""The metadata of a bundle: RO-Crate 1.1 with Process Run Crate 0.5, one JSON-LD file.

Each session is a CreateAction, with the program as instrument, design and scenario as inputs, the record as result.

https://www.researchobject.org/ro-crate/specification/1.1/
https://www.researchobject.org/workflow-run-crate/profiles/0.5/process_run_crate/
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeAlias

from msgspec import Struct

from rise_engine import __version__
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.bundle.manifest import files_in
from rise_engine.study.publishing import ORCID, Author, license_url

METADATA = "ro-crate-metadata.json"
CRATE = "https://w3id.org/ro/crate/1.1"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
PROGRAM = "#rise-tui"
Entity: TypeAlias = dict[str, Any]
_FORMATS = {
    ".R": "text/x-r",
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".jsonl": "application/jsonl",
    ".md": "text/markdown",
    ".sps": "text/plain",
    ".toml": "application/toml",
    ".tsv": "text/tab-separated-values",
    ".txt": "text/plain",
    ".whl": "application/zip",
    ".xml": "application/xml",
}


class CrateSession(Struct, frozen=True):
    """A session in a bundle."""

    facts: SessionFacts
    folder: str
    """Relative to the bundle. Empty: only the exports have the session."""


class CrateContents(Struct, frozen=True):
    """The facts for the metadata."""

    name: str
    description: str
    published: str
    """The date in ISO 8601."""
    license: str
    """An SPDX id, a URL, or empty: see the file LICENSE."""
    authors: tuple[Author, ...]
    funding: str
    """The funder as written by people. Empty: not given."""
    sessions: tuple[CrateSession, ...]
    inputs: tuple[str, ...]
    """Files and folders from which every session was run, relative to the bundle: the design, the scenarios."""


def metadata_text(root: Path, contents: CrateContents) -> str:
    """Write the metadata of everything in a bundle's folder as JSON."""
    graph = [_descriptor(), *_dataset(root, contents), *_license(contents), _profile(), _program()]
    graph += [
        {"@id": _author_id(number, each), "@type": "Person", "name": each.name}
        for number, each in enumerate(contents.authors, 1)
    ]
    if contents.funding:
        graph.append({"@id": "#funder", "@type": "Organization", "name": contents.funding})
    graph.append({"@id": "#team", "@type": "Organization", "name": "The people who ran the study"})
    graph += [_run_of(session, contents) for session in contents.sessions]
    return json.dumps({"@context": f"{CRATE}/context", "@graph": graph}, indent=2, ensure_ascii=False) + "\n"


def _descriptor() -> Entity:
    return {
        "@id": METADATA,
        "@type": "CreativeWork",
        "conformsTo": {"@id": CRATE},
        "about": {"@id": "./"},
    }


def _profile() -> Entity:
    return {"@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5"}


def _program() -> Entity:
    return {
        "@id": PROGRAM,
        "@type": "SoftwareApplication",
        "name": "rise-tui",
        "description": "Runs human-robot interaction studies from a terminal",
        "softwareVersion": __version__,
    }


def _dataset(root: Path, contents: CrateContents) -> list[Entity]:
    """Describe the bundle, its folders and its files."""
    files = [name for name in files_in(root) if name != METADATA]
    folders = sorted({f"{parent.as_posix()}/" for name in files for parent in Path(name).parents if parent.name})
    url = license_url(contents.license)
    dataset: Entity = {
        "@id": "./",
        "@type": "Dataset",
        "name": contents.name,
        "description": contents.description,
        "datePublished": contents.published,
        "license": {"@id": url or "LICENSE"},
        "conformsTo": {"@id": PROFILE},
        "hasPart": [{"@id": name} for name in [*folders, *files]],
        "mentions": _one_or_all([{"@id": _run_id(each)} for each in contents.sessions]),
    }
    if contents.authors:
        dataset["author"] = _one_or_all(
            [{"@id": _author_id(number, each)} for number, each in enumerate(contents.authors, 1)]
        )
    if contents.funding:
        dataset["funder"] = {"@id": "#funder"}
    entities: list[Entity] = [dataset]
    for folder in folders:
        entities.append({"@id": folder, "@type": "Dataset", "name": folder.rstrip("/")})
    for name in files:
        path = root / name
        entity: Entity = {
            "@id": name,
            "@type": "File",
            "name": name,
            "contentSize": str(path.stat().st_size),
        }
        if form := _FORMATS.get(path.suffix):
            entity["encodingFormat"] = form
        elif not path.suffix:
            entity["encodingFormat"] = "text/plain"
        entities.append(entity)
    return entities


def _author_id(number: int, author: Author) -> str:
    return ORCID + author.orcid if author.orcid else f"#author-{number}"


def _license(contents: CrateContents) -> list[Entity]:
    url = license_url(contents.license)
    if not url:
        return []
    return [
        {
            "@id": url,
            "@type": "CreativeWork",
            "name": contents.license,
            "description": f"The licence of this bundle: {contents.license}",
        }
    ]


def _run_of(session: CrateSession, contents: CrateContents) -> Entity:
    facts = session.facts
    outcome = facts.outcome or ("complete" if facts.ended else "aborted")
    about = ", ".join(filter(None, [facts.participant, facts.condition, f"{facts.duration:.0f} s", outcome]))
    action: Entity = {
        "@id": _run_id(session),
        "@type": "CreateAction",
        "name": f"Session {facts.session}",
        "description": f"A session with a robot ({facts.robot or 'unknown'}): {about}",
        "instrument": {"@id": PROGRAM},
        "agent": {"@id": "#team"},
        "object": _one_or_all([{"@id": each} for each in contents.inputs]),
        "actionStatus": f"http://schema.org/{'Failed' if outcome == 'aborted' else 'Completed'}ActionStatus",
    }
    if session.folder:
        action["result"] = {"@id": session.folder}
    if outcome == "aborted":
        action["error"] = facts.outcome_reason or "the session was broken off"
    if facts.started:
        action["startTime"] = facts.started
    return action


def _one_or_all(entities: list[Entity]) -> Entity | list[Entity]:
    """Return a list as JSON-LD compacts it: a single entity is not in a list."""
    return entities[0] if len(entities) == 1 else entities


def _run_id(session: CrateSession) -> str:
    return f"#session-{session.facts.session}"
