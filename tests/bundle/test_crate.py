"""The metadata of bundles, before roc-validator: Process Run Crate 0.5 on RO-Crate 1.1."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rise_engine.bundle.about import BundleOptions
from rise_engine.bundle.crate import METADATA
from rise_engine.bundle.making import make_bundle
from rise_engine.study.state import read_state

from ..analysis.samples import make_study, sessions_of

PYTHON = Path(__file__).parents[2] / ".venv-crate" / "bin" / "python"
CONTEXT = Path(__file__).with_name("ro-crate-1.1-context.jsonld")
NOT_NEEDED = {
    "The Action SHOULD have an endTime in ISO 8601 format",  # the level tells no dates
    "The Application SHOULD have a url",
    "The SoftwareApplication id SHOULD be an absolute URI",
    "The organization SHOULD have a URL.",
    "The `publisher` property of a `Root Data Entity` SHOULD be an `Organization`",
    "The author SHOULD have an affiliation",
}
Graph = list[dict[str, Any]]


def _of(graph: Graph, kind: str) -> dict[str, Any]:
    return next(each for each in graph if each["@type"] == kind)


def _lose_file(graph: Graph) -> None:
    graph.append({"@id": "gone.csv", "@type": "File", "name": "gone"})
    graph[1]["hasPart"].append({"@id": "gone.csv"})


def _add_hash(graph: Graph) -> None:
    _of(graph, "File")["sha256"] = "0" * 64


BROKEN: dict[str, Callable[[Graph], object]] = {
    "a file that is not there": _lose_file,
    "no licence": lambda graph: graph[1].pop("license"),
    "no date": lambda graph: graph[1].pop("datePublished"),
    "no instrument": lambda graph: _of(graph, "CreateAction").pop("instrument"),
    "a word that the context does not have": _add_hash,
}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("crate")
    study = make_study(root / "study")
    toml = study / "study.toml"
    toml.write_text(toml.read_text("utf-8").replace('title = "Hesitation"', 'title = "Hesitation: \\"yes\\""'), "utf-8")
    make_bundle(read_state(study), sessions_of(study)[3:5], root / "bundle", BundleOptions(license="CC-BY-4.0"))
    return root / "bundle"


def graph_of(bundle: Path) -> Graph:
    graph: Graph = json.loads((bundle / METADATA).read_text("utf-8"))["@graph"]
    return graph


@pytest.mark.slow
@pytest.mark.skipif(
    not PYTHON.exists(), reason="roc-validator is not here: `./dev test` makes .venv-crate for it when it can"
)
def test_the_validator_takes_it_and_refuses_broken_ones(bundle: Path, tmp_path: Path) -> None:
    """All in one process, because to start the validator takes longer than to validate."""
    crates = {"whole": bundle}
    for name, damage in BROKEN.items():
        crates[name] = Path(shutil.copytree(bundle, tmp_path / name))
        document = json.loads((crates[name] / METADATA).read_text("utf-8"))
        damage(document["@graph"])
        (crates[name] / METADATA).write_text(json.dumps(document), "utf-8")
    command = [PYTHON, Path(__file__).with_name("crate_validator.py"), CONTEXT, *crates.values()]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    refused = {
        name: [text for severity, text in found[str(path)] if severity == "REQUIRED"] for name, path in crates.items()
    }
    assert refused.pop("whole") == []
    assert {name for name, texts in refused.items() if texts} == set(BROKEN), refused
    wished = {text for severity, text in found[str(bundle)] if severity != "REQUIRED"}
    assert {text for text in wished if "author" not in text} <= NOT_NEEDED


def test_every_file_is_named_once_and_nothing_else(bundle: Path) -> None:
    graph = graph_of(bundle)
    named = [each["@id"] for each in graph if each["@type"] == "File"]
    there = {path.relative_to(bundle).as_posix() for path in bundle.rglob("*") if path.is_file()}
    assert len(named) == len(set(named))
    assert set(named) == there - {METADATA, "manifest-sha256.txt"}
    ids = [each["@id"] for each in graph]
    assert len(ids) == len(set(ids))
    parts = {each["@id"] for each in graph[1]["hasPart"]}
    assert parts <= set(ids)


def test_each_session_is_an_action(bundle: Path) -> None:
    graph = graph_of(bundle)
    actions = [each for each in graph if each["@type"] == "CreateAction"]
    assert [each["actionStatus"].rpartition("/")[2] for each in actions] == [
        "FailedActionStatus",  # the one that was broken off
        "CompletedActionStatus",
    ]
    assert actions[0]["error"] == "[free text, 3 words]"
    assert all("startTime" not in each for each in actions)
    for action in actions:
        assert (bundle / action["result"]["@id"]).is_dir()
        assert {each["@id"] for each in action["object"]} == {"study.toml", "plan.csv", "scenario/"}
