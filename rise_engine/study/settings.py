"""The settings of study.toml: what each of them does, in a sentence. For the editor.

The readers decide which values are valid (docs/reference/study.md).
"""

from __future__ import annotations

from rise_engine.scenario.settings import Setting, SettingTable, make_table
from rise_engine.study.publishing import PUBLISHING_ITEMS, REPORT_ITEMS

STUDY_TABLES: tuple[SettingTable, ...] = (
    make_table(
        "",
        "The study",
        Setting("title", "text", "The study's name on screens and in results"),
        Setting("id", "text", "Its short name, of letters and digits, in the names of files"),
        Setting("seed", "whole number", "A number that you choose: the plan and all chance are drawn from it"),
        Setting("n", "whole number", "How many complete participants you want"),
        Setting("scenario", "text", "The scenario's folder", "scenario"),
        Setting("mode", "text", "Whether a robot moves", "real",
                {"real": "sessions with the robot", "debug": "simulated: no session counts"}),
        Setting("robot", "text", "Another robot than the scenario's", "the scenario's"),
    ),
    make_table(
        "factors.*",
        "What differs between sessions",
        Setting("kind", "text", "Who gets which levels", "",
                {"between": "each participant has one level", "within": "each has every level, one in each run"}),
        Setting("labels.*", "text", "What screens show instead of this level's name"),
        Setting("label_only", "yes or no", "The robot does the same: only people or the room differ", "no"),
    ),
    make_table(
        "factors.*.levels.*",
        "One level of a factor",
        Setting("memory.*", "value", "A memory value at the start of its sessions"),
        Setting("scenario", "text", "Another scenario's folder for its sessions", "the study's"),
        Setting("description", "text", "The level in words, for data sets"),
    ),
    make_table(
        "assignment",
        "How participants get their levels",
        Setting("between", "text", "How a participant gets a cell: the levels of the between factors", "blocks",
                {"blocks": "blocks with every cell equally often, in random order",
                 "minimise": "mostly the cell that makes the cells differ least (Pocock and Simon 1975)",
                 "random": "each is drawn, so cells are equally full only in the long run",
                 "list": "your own plan.csv"}),
        Setting("block", "whole numbers", "How often each cell occurs in a block; one of these is drawn for each", "1"),
        Setting("strata", "names", "Columns of participants.csv within whose values the cells are balanced", "none"),
        Setting("within", "text", "How the orders of a participant's runs are balanced", "williams",
                {"williams": "positions, and which run follows which", "latin": "positions",
                 "all": "both, by every order, for at most 6 runs", "fixed": "everybody has the order of the file",
                 "random": "each order is drawn"}),
        Setting("spare", "number", "More rows for dropouts, as a share of n", "0.25"),
        Setting("hidden", "yes or no", "Screens show the condition only when the session begins", "no"),
    ),
    make_table(
        "strata",
        "Columns of participants.csv with their values, for balancing",
        Setting("*", "names", "The values that this column can have"),
    ),
    make_table(
        "consent",
        "What participants must consent to",
        Setting("needed", "names", "Each is a column consent_NAME of participants.csv with a date", "none"),
    ),
    make_table(
        "check.*",
        "A check before or after each session",
        Setting("id", "text", "Its name, unique in the study"),
        Setting("ask", "text", "A sentence that somebody confirms"),
        Setting("auto", "text", "A check that the program makes itself"),
        Setting("run", "value", 'A program that makes it: ["./check.sh"]'),
        Setting("when", "text", "When the check is made", "before",
                {"before": "before the session", "after": "after the session"}),
        Setting("min", "text", "For the check of the disk: the space that is needed: 20 GB"),
        Setting("every", "text", "How long a pass is valid: 8 h, 30 d", "one session"),
        Setting("blocks", "yes or no", "A failure stops the session until somebody skips it with a reason", "yes"),
        Setting("limit", "text", "How long the program may take: 30 s"),
    ),
    make_table(
        "participants",
        "Who takes part",
        Setting("columns", "names", "More columns of participants.csv: age, handedness", "none"),
    ),
    make_table(
        "participants.columns",
        "More columns of participants.csv",
        Setting("*", "text", "What this column contains"),
    ),
    make_table("wizards", "The wizards", Setting("*", "text", "This wizard's code in exports: W1")),
    make_table(
        "retention",
        "When you want to delete data; the program reminds you",
        Setting("media", "text", "How long films and sound are kept: 365 d", "no limit"),
        Setting("sessions", "text", "How long sessions are kept: 10 y", "no limit"),
    ),
    make_table(
        "recording",
        "What records each session",
        Setting("lsl", "value", "Whether markers are sent to LSL: true", "no"),
        Setting("sync", "value", "Whether start and end are marked for films: true", "no"),
        Setting("folder", "text", "Where recorders without a file of their own write", "the session's folder"),
        Setting("consent", "text", "The consent that recording needs", "recording"),
    ),
    make_table(
        "recording.lsl",
        "Markers for LSL",
        Setting("scope", "text", "Who may receive them", "machine",
                {"machine": "this computer", "link": "the network segment", "site": "the whole network"}),
        Setting("payload", "text", "What they contain", "short", {"short": "short names", "json": "all of a record"}),
    ),
    make_table(
        "recording.sync",
        "Marks that films show or hear",
        Setting("start", "yes or no", "One at the start", "yes"),
        Setting("end", "yes or no", "One at the end", "yes"),
        Setting("medium", "text", "What they are", "sound", {"sound": "a sound", "flash": "a flash of the screen"}),
        Setting("play", "value", 'The program that plays the sound: ["aplay", "{file}"]'),
    ),
    make_table(
        "recording.*",
        "A recorder",
        Setting("by", "text", "The program that records", "its name"),
        Setting("stalled", "text", "How long its file may stop growing before it counts as stalled: 10 s"),
    ),
    make_table(
        "questionnaire.*",
        "Answers from a survey tool",
        Setting("file", "text", "Its CSV file in the study's folder: questionnaires/godspeed.csv"),
        Setting("key", "text", "The column with the pseudonym", "participant"),
        Setting("run", "text", "The column with the run after which it was asked", "none"),
        Setting("about", "text", "Its name in a paper"),
        Setting("columns.*", "value", "What this column asks"),
        Setting("leave_out", "names", "Columns that no export contains", "none"),
    ),
    make_table(
        "report",
        "Texts for the reporting sheet, bundles and BIDS",
        *(Setting(each.name, "text", each.question[0].upper() + each.question[1:])
          for each in (*REPORT_ITEMS, *PUBLISHING_ITEMS)),
    ),
)  # fmt: skip
"""All tables of study.toml."""
