"""The authors, licence and statements of a published study, from `[report]` in study.toml."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from rise_engine.scenario.files.toml_files import TomlTable

LICENSES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/",
    "CC-BY-SA-4.0": "https://creativecommons.org/licenses/by-sa/4.0/",
    "CC-BY-NC-4.0": "https://creativecommons.org/licenses/by-nc/4.0/",
    "ODbL-1.0": "https://opendatacommons.org/licenses/odbl/1-0/",
    "ODC-By-1.0": "https://opendatacommons.org/licenses/by/1-0/",
    "PDDL-1.0": "https://opendatacommons.org/licenses/pddl/1-0/",
    "MIT": "https://opensource.org/license/mit",
}
"""URLs of licences by their SPDX ids."""
ORCID = "https://orcid.org/"
_AUTHOR = re.compile(r"(?P<name>[^()]*?)\s*(?:\(\s*(?:https?://orcid\.org/)?(?P<orcid>[^()]*?)\s*\))?")
_DIGITS = re.compile(r"\d{4}-\d{4}-\d{4}-\d{3}[\dX]")


class Author(Struct, frozen=True):
    """An author of the published study."""

    name: str
    orcid: str = ""
    """`0000-0002-1825-0097`. Empty: none is given."""


def authors_of(report: Mapping[str, str]) -> tuple[Author, ...]:
    """Return the authors of a study in their order.

    :param report: `[report]` of study.toml.

    >>> authors_of({"authors": "Doe, J. (0000-0002-1825-0097); Roe, M."})
    (Author(name='Doe, J.', orcid='0000-0002-1825-0097'), Author(name='Roe, M.', orcid=''))
    """
    parts = [each.strip() for each in report.get("authors", "").split(";") if each.strip()]
    found = [(part, _AUTHOR.fullmatch(part)) for part in parts]
    return tuple(Author(match["name"], match["orcid"] or "") if match else Author(part) for part, match in found)


def orcid_problem(orcid: str) -> str:
    """Return what is wrong with an ORCID, as the end of a sentence. Empty: nothing.

    https://support.orcid.org/hc/en-us/articles/360006897674-Structure-of-the-ORCID-Identifier

    >>> [orcid_problem(each) for each in ("0000-0002-1825-0097", "0000-0002-1825-0098")]
    ['', 'its last digit does not fit the others: one of them is mistyped']
    """
    if not _DIGITS.fullmatch(orcid):
        return "it has four groups of four digits, as 0000-0002-1825-0097"
    digits, total = orcid.replace("-", ""), 0
    for digit in digits[:-1]:
        total = (total + int(digit)) * 2
    check = (12 - total % 11) % 11
    if digits[-1] == ("X" if check == 10 else str(check)):
        return ""
    return "its last digit does not fit the others: one of them is mistyped"


def license_url(license: str) -> str:
    """Return the URL of a licence. Empty: it is unknown."""
    if license.startswith(("https://", "http://")):
        return license
    return next((url for name, url in LICENSES.items() if name.casefold() == license.casefold()), "")


def package_facts(report: Mapping[str, str]) -> dict[str, Any]:
    """Return datapackage.json's `licenses` and `contributors` (from the standard), and `ethics` and `funding`.

    :param report: `[report]` of study.toml.
    """
    facts: dict[str, Any] = {}
    if license := report.get("license", ""):
        url = license_url(license)
        facts["licenses"] = [{"name": license, **({"path": url} if url else {})}]
    if authors := authors_of(report):
        facts["contributors"] = [
            {"title": each.name, "role": "author", **({"path": ORCID + each.orcid} if each.orcid else {})}
            for each in authors
        ]
    return facts | {name: report[name] for name in ("ethics", "funding") if report.get(name)}


class ReportItem(Struct, frozen=True):
    """A question of the reporting sheet for the researchers."""

    name: str
    """Its key in `[report]`."""
    question: str


REPORT_ITEMS = (
    ReportItem("robot_make", "make and model of the robot, and how many there were"),
    ReportItem("autonomy", "what the robot did by itself and what the wizard did, in words"),
    ReportItem("robot_hypotheses", "what you expected of the robot"),
    ReportItem("recruitment", "how participants were found"),
    ReportItem("compensation", "what participants got for it"),
    ReportItem("demographics", "age, gender and what else is known of the participants"),
    ReportItem("instructions", "what participants were told before the session"),
    ReportItem("hypotheses", "what you expected of the participants"),
    ReportItem("preregistration", "where the study was registered before, or that it was not"),
    ReportItem("expectations", "whether expectations were asked before and after, and how"),
    ReportItem("convincing", "how it was found out whether participants suspected a wizard, and how many did"),
    ReportItem("wizard_role", "who the wizards were: researchers, confederates, others"),
    ReportItem("wizard_demographics", "what is known of the wizards, and how well they knew the robot"),
    ReportItem("wizard_knew", "whether the wizards knew the hypotheses"),
    ReportItem(
        "wizard_perceived", "what the wizards saw and heard of the participants, through what, and with what delay"
    ),
    ReportItem("wizard_rules", "which answers the wizards had to give to what, and what they were free to do"),
    ReportItem("wizard_training", "how the wizards were trained"),
    ReportItem("wizard_errors", "how errors of the wizards were prevented, and looked for in recordings"),
    ReportItem("place", "where it took place"),
    ReportItem("environment", "the room: its light, its noise, other people in it"),
    ReportItem("story", "what the interaction was about, for participants"),
    ReportItem("iterations", "what was changed after pilots"),
    ReportItem("limits", "what having a wizard means for the conclusions"),
)
ITEM_NAMES = tuple(item.name for item in REPORT_ITEMS)
PUBLISHING_ITEMS = (
    ReportItem("authors", "the authors with their ORCIDs: Doe, J. (0000-0002-1825-0097); Roe, Mary"),
    ReportItem("license", "the licence of the data: CC-BY-4.0"),
    ReportItem("institution", "where the study was done: the institution"),
    ReportItem("institution_address", "its address"),
    ReportItem("department", "the department"),
    ReportItem("ethics", "the ethics committee and its approval"),
    ReportItem("funding", "who paid for the study"),
)
"""Entries that the sheet does not ask for but bundles and BIDS data sets contain."""
PUBLISHING_NAMES = tuple(item.name for item in PUBLISHING_ITEMS)


def read_report(study: TomlTable) -> dict[str, str]:
    """Read the answers by the names of their items. Items without an answer are omitted.

    :param study: the whole study.toml.
    """
    table = study.section("report", (*ITEM_NAMES, *PUBLISHING_NAMES))
    answers: dict[str, str] = {}
    for name in table.values:
        if name in ITEM_NAMES or name in PUBLISHING_NAMES:
            text = table.read(name, str, "", form=f': {name} = "..."').strip()
            if text:
                answers[name] = text
    for author in authors_of(answers):
        if author.orcid and (problem := orcid_problem(author.orcid)):
            table.report_value(
                "wrong-value", "authors", f"`{author.orcid}` of {author.name} is not an ORCID: {problem}"
            )
    return answers
