"""The metadata of bundles, before roc-validator: Process Run Crate 0.5 on RO-Crate 1.1."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rise_engine.results.bundle.about import BundleOptions
from rise_engine.results.bundle.crate import METADATA
from rise_engine.results.bundle.making import make_bundle
from rise_engine.study.state import read_state
from tests.results.analysis.samples import make_study, sessions_of

PYTHON = Path(__file__).parents[3] / ".venv-crate" / "bin" / "python"
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
    "does not include the Data Entity 'gone.csv'": _lose_file,
    "The Root Data Entity MUST have a `license` property": lambda graph: graph[1].pop("license"),
    "The Root Data Entity MUST have a `datePublished`": lambda graph: graph[1].pop("datePublished"),
    "The Action MUST have an instrument": lambda graph: _of(graph, "CreateAction").pop("instrument"),
    'The 1 occurrence of the JSON-LD key "sha256" is not allowed': _add_hash,
}
"""What is refused, in the validator's words."""


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
def test_the_validator_takes_it_and_refuses_a_broken_one(bundle: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(bundle, tmp_path / "broken"))
    document = json.loads((broken / METADATA).read_text("utf-8"))
    for damage in BROKEN.values():
        damage(document["@graph"])
    (broken / METADATA).write_text(json.dumps(document), "utf-8")
    command = [PYTHON, Path(__file__).with_name("crate_validator.py"), CONTEXT, bundle, broken]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    required, refused = (
        [text for severity, text in found[str(crate)] if severity == "REQUIRED"] for crate in (bundle, broken)
    )
    assert required == []
    assert [words for words in BROKEN if not any(words in text for text in refused)] == [], refused
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
