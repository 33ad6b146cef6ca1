"""Who publishes a study, and what others may do with it, out of `[report]` of study.toml: for bundles and exports."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

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
"""Addresses of licences, by their SPDX ids."""
ORCID = "https://orcid.org/"
_AUTHOR = re.compile(r"(?P<name>[^()]*?)\s*(?:\(\s*(?:https?://orcid\.org/)?(?P<orcid>[^()]*?)\s*\))?")
_DIGITS = re.compile(r"\d{4}-\d{4}-\d{4}-\d{3}[\dX]")


class Author(Struct, frozen=True):
    """One of those who publish."""

    name: str
    orcid: str = ""
    """`0000-0002-1825-0097`; empty: none is given."""


def authors_of(report: Mapping[str, str]) -> tuple[Author, ...]:
    """The authors of a study, in their order.

    :param report: `[report]` of study.toml.

    >>> authors_of({"authors": "Doe, J. (0000-0002-1825-0097); Roe, M."})
    (Author(name='Doe, J.', orcid='0000-0002-1825-0097'), Author(name='Roe, M.', orcid=''))
    """
    parts = [each.strip() for each in report.get("authors", "").split(";") if each.strip()]
    found = [(part, _AUTHOR.fullmatch(part)) for part in parts]
    return tuple(Author(match["name"], match["orcid"] or "") if match else Author(part) for part, match in found)


def orcid_problem(orcid: str) -> str:
    """What is wrong with an ORCID, as the end of a sentence; empty: nothing.

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
    """The address of a licence; empty: nobody knows it."""
    if license.startswith(("https://", "http://")):
        return license
    return next((url for name, url in LICENSES.items() if name.casefold() == license.casefold()), "")


def package_facts(report: Mapping[str, str]) -> dict[str, Any]:
    """What datapackage.json says of it: `licenses` and `contributors` of the standard, and `ethics` and `funding`.

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
