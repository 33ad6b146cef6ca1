"""Reading `[report]` of study.toml: what only people can say for the reporting sheet of a study's report.

The items are paraphrased from the reporting guidelines in Riek 2012, "Wizard of Oz Studies in HRI: A Systematic Review
and New Reporting Guidelines", Journal of Human-Robot Interaction 1(1), 119-136 (doi 10.5898/JHRI.1.1.Riek). What the
record of the sessions knows itself is asked of nobody (`rise_engine.results.report.sheet`).
"""

from __future__ import annotations

from msgspec import Struct

from rise_engine.scenario.toml_files import TomlTable
from rise_engine.study.publishing import authors_of, orcid_problem


class ReportItem(Struct, frozen=True):
    """Something that people are asked for."""

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
    ReportItem("instructions", "what participants were told before, in words"),
    ReportItem("hypotheses", "what you expected of the participants"),
    ReportItem("preregistration", "where the study was registered before, or that it was not"),
    ReportItem("expectations", "whether expectations were asked before and after, and how"),
    ReportItem("convincing", "how it was found out whether participants suspected a wizard, and how many did"),
    ReportItem("wizard_role", "who the wizards were: researchers, confederates, others"),
    ReportItem("wizard_demographics", "what is known of the wizards, and how well they knew the robot"),
    ReportItem("wizard_knew", "whether the wizards knew the hypotheses"),
    ReportItem("wizard_perceived", "what the wizards saw and heard of the participants, by what, and how late"),
    ReportItem("wizard_rules", "what the wizards were to answer to what, and what they were free to do"),
    ReportItem("wizard_training", "how the wizards were trained"),
    ReportItem("wizard_errors", "how errors of the wizards were prevented, and looked for in recordings"),
    ReportItem("place", "where it took place"),
    ReportItem("environment", "the room: its light, its noise, who else was there"),
    ReportItem("story", "what the interaction was about, for participants"),
    ReportItem("iterations", "what was changed after pilots"),
    ReportItem("limits", "what having a wizard means for the conclusions"),
)
ITEM_NAMES = tuple(item.name for item in REPORT_ITEMS)
PUBLISHING_NAMES = ("authors", "license", "institution", "institution_address", "department", "ethics", "funding")
"""What the sheet does not ask for, and bundles and data sets of BIDS say: who publishes, and what others may do."""


def read_report(study: TomlTable) -> dict[str, str]:
    """What people have said, by the name of its item; items that nobody has said anything about are left out.

    :param study: the whole study.toml.
    """
    table = study.section("report", (*ITEM_NAMES, *PUBLISHING_NAMES))
    said: dict[str, str] = {}
    for name in table.values:
        if name in ITEM_NAMES or name in PUBLISHING_NAMES:
            text = table.read(name, str, "", form=f': {name} = "..."').strip()
            if text:
                said[name] = text
    for author in authors_of(said):
        if author.orcid and (problem := orcid_problem(author.orcid)):
            table.report_value("wrong-value", "authors", f"`{author.orcid}` of {author.name} is no ORCID: {problem}")
    return said
