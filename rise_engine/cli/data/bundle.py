"""`rise-engine study bundle`: a study as one folder for others, and a summary of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from rise_engine.base.text import pluralize
from rise_engine.cli.data.export import ended_by_signals, level_option, select_sessions, uncounted_text
from rise_engine.cli.options import PRIVATE, STUDY_OR_HERE
from rise_engine.cli.terminal import print_lines
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.bundle.about import BundleOptions
from rise_engine.results.bundle.making import make_bundle
from rise_engine.study.state import read_state


@click.command("bundle")
@STUDY_OR_HERE
@click.option(
    "-o", "--output", metavar="NEW", required=True, type=click.Path(), help="Write this new folder or new .zip."
)
@level_option(
    "shared",
    "Choose how much to include. shared: for other researchers; public: for everybody; full: for your own archive.",
)
@PRIVATE
@click.option("--license", metavar="NAME", default="", help="State what others may do with it: CC-BY-4.0, CC0-1.0, ...")
@click.option("--all", "all_sessions", is_flag=True, help="Include sessions that do not count.")
def bundle(
    study: Path, output: str, level: ExportLevel, private: tuple[str, ...], license: str, all_sessions: bool
) -> None:
    """Put everything that others need of STUDY into a new folder or zip file: design, scenarios, replayable
    sessions, tables, BIDS, report, the program itself, checksums, and a description for programs (an RO-Crate).

    It lists what is in it, what was left out, and what you should look at before you share it.

    Exit status: 0; 1 if it cannot be made; 2 if there is no study.
    """
    selection = select_sessions([str(study)], all=all_sessions)
    options = BundleOptions(level, private, license.strip())
    with ended_by_signals():
        report = make_bundle(
            read_state(study.absolute()),
            selection.folders,
            Path(output),
            options,
            omitted=selection.omitted,
            remarks=[uncounted_text(each) for each in selection.uncounted.values()],
        )
    print_lines(
        f"{output}: a bundle of {pluralize(report.sessions, 'session')}, level {options.level}",
        "",
        "in it:",
        *_indent(report.contents),
        "left out:",
        *_indent(report.omitted),
        "look at this before anybody else gets it:",
        *_indent([*selection.notes, *report.to_check]),
        "its fingerprint, for the paper (rise-engine reproduce prints it):",
        f"  {report.fingerprint}",
    )


def _indent(lines: Sequence[str]) -> list[str]:
    return [f"  {line}" for line in lines]
