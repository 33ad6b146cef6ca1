"""Reads scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

from functools import partial
from typing import Any

from rise_engine.base.nearest_name import suggest
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import Mention, ScenarioDraft, StateMention
from rise_engine.scenario.durations import MAX_SECONDS, parse_time
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, read_seconds
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.scenario.model import (
    CUE_TOPICS,
    Condition,
    FillerSettings,
    FunctionName,
    KeyBinding,
    Mode,
    SourceLocation,
    normal_topic,
)
from rise_engine.scenario.reading.act_settings import read_act_tables, read_on_failure
from rise_engine.scenario.reading.conditions import read_conditions, read_private, read_study
from rise_engine.scenario.reading.element_reader import MIN_SECONDS
from rise_engine.scenario.reading.explore_tables import read_explore, read_properties, read_trials
from rise_engine.scenario.reading.expression_checks import expression_message, note_assignment
from rise_engine.scenario.reading.suppressions import check_warning_code
from rise_engine.scenario.settings import SCENARIO_TABLES, names_in
from rise_engine.scenario.speech.languages import language_problem
from rise_engine.syntax.toml import toml_key

TOP_KEYS = tuple(names_in(SCENARIO_TABLES, ""))
BINDINGS: dict[str, tuple[FunctionName, str]] = {
    "act": ("startCommunicationRobotAct", "name an act"),
    "rule": ("startInteractionRule", "name a rule"),
    "event": ("raiseEventTopic", "name a topic"),
    "set": ("assignValue", "write an assignment"),
    "stop_act": ("stopCommunicationRobotAct", "name an act"),
    "stop_rule": ("stopInteractionRule", "name a rule"),
}
"""The bindings of a key: the function of its DomainTask, and the form of its value."""
_START_KEYS = ("state", "enter")
"""With `rule`: the state in which the rule begins, and whether it runs `onEntry`."""
MAX_LABEL_LENGTH = 24
"""Maximum characters of the `label` of a key, because several share one line."""
_ALLOW_KEYS = tuple(names_in(SCENARIO_TABLES, "check.allow.*"))
MIN_AUTO_AFTER, MAX_FILLER_DELAY = 0.5, 600.0
"""Seconds. An earlier filler would interrupt the participant's own pauses."""


class ScenarioSettings:
    """The checked settings of scenario.toml, with defaults."""

    def __init__(self, file: TomlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.draft = draft
        self.table = TomlTable(file, (), file.values, diagnostics)
        self.table.report_unknown_keys(TOP_KEYS)
        self.title = self.read_text("title", "")
        self.language = self.read_language()
        self.languages = self.read_languages()
        """The languages in `[languages]`, into which the study should be translated."""
        self.robot = self.read_text("robot", "")
        mode = self.read_text("mode", "debug")
        self.mode: Mode = "real" if mode == "real" else "debug"
        if mode not in ("debug", "real"):
            self.table.report_value("wrong-value", "mode", '`mode` is "debug" or "real"')
        self.paths: dict[str, str] = {
            key: self.read_text(key, "") for key in ("acts", "rules", "memory") if key in file.values
        }
        self.study, self.conditions = self.read_study()
        self.private = read_private(self.table, draft)
        self.keys = self.read_keys()
        self.on_failure = read_on_failure(self.table) if "on_failure" in file.values else "go_on"
        """The reaction to a failed act without its own setting."""
        self.act_tables = read_act_tables(self.table.section("act"), draft)
        self.fillers = self.read_fillers()
        self.cue_keep = self.read_cue()
        self.may_release = self.read_control()
        self.explore = read_explore(self.table, draft)
        self.properties = read_properties(self.table, draft)
        self.trials = read_trials(self.table, draft)
        self.suppressions = self.read_suppressions()
        """Silenced warnings about keys of the memory file: location, code, key, reason."""

    def section(self, name: str) -> TomlTable:
        """A table with its known entries only."""
        return self.table.section(name, names_in(SCENARIO_TABLES, name))

    def read_text(self, key: str, usual: str) -> str:
        value = self.table.values.get(key)
        if key == "acts" and isinstance(value, dict):
            names = [toml_key(name) for name in value] or ["NAME"]
            message = f"`acts` says where the acts are; settings of an act belong in [act.{names[0]}], not [acts...]"
            self.table.report_value("wrong-type", key, message)
            return usual
        text: str = self.table.read(key, str, usual, form=f': {key} = "..."')
        return text

    def read_language(self) -> str:
        """Read the language of the acts; empty: not set."""
        if "language" not in self.table.values:
            return ""
        language = self.read_text("language", "").strip()
        problem = language_problem(language) if isinstance(self.table.values["language"], str) else ""
        if problem:
            self.table.report_value("unknown-language", "language", problem)
        return "" if problem else language

    def read_languages(self) -> tuple[str, ...]:
        """Read the languages into which the texts should be translated, with or without a file."""
        table = self.table.section("languages")
        for key in table.values:
            if key == "default":
                message = 'write the language of the acts as `language = "en"` at the top of the file, not as `default`'
                table.report_key("unknown-key", message, key)
            elif key != "also":
                table.report_key("unknown-key", f"unknown key `{key}`", key, suggestion=suggest(key, ("also",)))
        also = table.read_texts("also", ())
        for index, tag in enumerate(also):
            if problem := language_problem(tag):
                table.report_key("unknown-language", problem, "also", str(index))
            elif tag.lower() == self.language.lower():
                message = f"`{tag}` is the language that the acts are in; `also` lists the others"
                table.report_key("wrong-value", message, "also", str(index))
        return tuple(tag for tag in also if not language_problem(tag) and tag.lower() != self.language.lower())

    def read_suppressions(self) -> list[tuple[SourceLocation, str, str, str]]:
        table = self.section("check")
        listed = table.values.get("allow", [])
        form = 'allow = [{ code = "unwritable-key", key = "...", reason = "..." }]'
        if not isinstance(listed, list) or not all(isinstance(each, dict) for each in listed):
            table.report_value("wrong-type", "allow", f"`allow` is a list of tables: {form}")
            return []
        suppressions: list[tuple[SourceLocation, str, str, str]] = []
        for index, values in enumerate(listed):
            inner = TomlTable(table.file, ("check", "allow", str(index)), values, table.diagnostics)
            inner.report_unknown_keys(_ALLOW_KEYS)
            code, key, reason = texts = [values.get(name) for name in _ALLOW_KEYS]
            location = inner.key_location()
            if not all(isinstance(text, str) and text.strip() for text in texts):
                table.diagnostics.warning("bad-allow", location, f"say what is meant, and why: {form}")
            elif check_warning_code(code, location, table.diagnostics):
                suppressions.append((location, code, key, reason))
        return suppressions

    def read_study(self) -> tuple[dict[str, Any], dict[str, Condition]]:
        """Read the number of participants, the conditions, and their memory values."""
        table = self.section("study")
        study = read_study(table)
        conditions = read_conditions(self.table.section("conditions"), table, study.get("conditions", []), self.draft)
        return study, conditions

    def read_keys(self) -> dict[str, KeyBinding]:
        table = self.table.section("keys")
        bindings: dict[str, KeyBinding] = {}
        for written in table.values:
            try:
                key = bindable_key_name(written)
            except KeyRefusedError as refused:
                code = "key-taken" if refused.taken else "key-refused"
                table.report_key(code, str(refused), written, suggestion=refused.suggestion)
                key = ""
            if key in bindings:
                first = bindings[key]
                message = f"`{written}` is the same key as `{first.label}` in line {first.location.line}"
                table.report_key("key-twice", message, written)
                key = ""
            binding = self.read_binding(table, written, key)
            if binding is not None and key:
                bindings[key] = binding
        return bindings

    def read_binding(self, table: TomlTable, written: str, key: str) -> KeyBinding | None:
        example = f'write {toml_key(written)} = {{ act = "..." }} (or {", ".join(list(BINDINGS)[1:])})'
        if not isinstance(table.values[written], dict):
            table.report_value("binding", written, f"a key submits something; {example}")
            return None
        inner = TomlTable(table.file, ("keys", written), table.values[written], table.diagnostics)
        inner.report_unknown_keys((*BINDINGS, "label", *_START_KEYS, "keep"))
        if_empty = "write what the key means in a word or two, or leave `label` out"
        title = inner.read_label('"not understood"', MAX_LABEL_LENGTH, if_empty)
        given = [name for name in BINDINGS if name in inner.values]
        if len(given) != 1:
            if len(given) > 1 or not inner.values.keys() - {"label", *_START_KEYS}:
                inner.report_key("binding", f"a key submits exactly one thing; {example}")
            return None
        name = given[0]
        function, wanted = BINDINGS[name]
        behavior = inner.read(name, str, None, form=f': {name} = "..."')
        if behavior is None:
            return None
        behavior = behavior.strip()
        if not behavior or (name == "event" and not normal_topic(behavior)):
            inner.report_value("missing-value", name, f'`{name}` is empty; {wanted}: {name} = "..."')
            return None
        locate = partial(inner.value_location, name)
        if name in ("act", "stop_act"):
            self.draft.act_mentions.append(Mention(behavior, locate))
        elif name in ("rule", "stop_rule"):
            self.draft.rule_mentions.append(Mention(behavior, locate))
        elif name == "event":
            self.draft.raised_topics.append(Mention(normal_topic(behavior), locate))
        else:
            try:
                note_assignment(Assignment.parse(behavior), locate, self.draft)
            except ExpressionError as error:
                start = locate()  # the column counts in the text, which begins after the quotation mark
                location = SourceLocation(start.file, start.line, start.column + error.column)
                inner.diagnostics.error("assignment", location, expression_message(error), error.suggestion)
                return None
        state, enter = self.read_start(inner, name, behavior)
        keep = self.read_keep(inner, name) if "keep" in inner.values else None
        return KeyBinding(key, written, function, behavior, inner.key_location(), title, state, enter, keep)

    def read_cue(self) -> float | None:
        """Read how long the participant's cue is kept for a rule that waits for it later."""
        table = self.section("cue")
        if "keep" not in table.values:
            return None
        self.draft.raised_topics.append(Mention(CUE_TOPICS[0], partial(table.key_location, "keep")))
        return self.read_keep(table, "event")

    def read_keep(self, binding: TomlTable, what: str) -> float | None:
        """Read how long an event is kept for a rule that waits for it later."""
        text = binding.read("keep", str, None, form=': keep = "2s"')
        seconds = parse_time(text) if text is not None else None
        if what != "event":
            binding.report_key("binding", '`keep` says how long an event is kept; it goes with event = "..."', "keep")
        elif text is not None and seconds is None:
            binding.report_value("time", "keep", f"`{text}` is not a time; write 500ms, 2s or 1min")
        elif seconds is not None and not MIN_SECONDS <= seconds <= MAX_SECONDS:
            binding.report_value("out-of-range", "keep", f"`keep` is from 1ms to 24 hours; `{text}` is outside")
        else:
            return seconds
        return None

    def read_start(self, binding: TomlTable, name: str, rule: str) -> tuple[str | None, bool]:
        """Read the state in which a rule begins, and whether it runs `onEntry` there."""
        if name != "rule":
            for key in binding.values.keys() & set(_START_KEYS):
                binding.report_key("binding", f'`{key}` says how a rule begins; it goes with rule = "..."', key)
            return None, True
        enter = binding.read("enter", bool, True)
        state = binding.read("state", str, None, form=': state = "..."')
        if state is not None and not state.strip():
            binding.report_value("missing-value", "state", "`state` is empty; name a state, or leave it out")
        if state is None or not state.strip():
            return None, enter
        locate = partial(binding.value_location, "state")
        self.draft.state_mentions.append(StateMention(state.strip(), locate, rule))
        return state.strip(), enter

    def read_fillers(self) -> FillerSettings:
        table = self.section("fillers")
        usual = FillerSettings()
        offer = read_seconds(table, "offer_after", usual.offer_after, 0.0, MAX_FILLER_DELAY)
        auto = read_seconds(table, "auto_after", usual.auto_after, MIN_AUTO_AFTER, MAX_FILLER_DELAY)
        if auto is not None and not any(table.given.get("filler") for table in self.act_tables.tables):
            message = "no act is a filler, so none will ever be started: `filler = true` under [act.NAME] makes one"
            table.diagnostics.warning("no-filler", table.key_location("auto_after"), message)
        return FillerSettings(offer or 0.0, auto)

    def read_control(self) -> tuple[str, ...]:
        """Read who may release a stop besides the client with control."""
        table = self.section("control")
        names = table.values.get("may_release", [])
        if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() for name in names):
            message = (
                "`may_release` is a list of names: of ROS nodes, with namespace, or of programs on the link: "
                'may_release = ["/supervisor"]'
            )
            table.report_value("wrong-type", "may_release", message)
            return ()
        return tuple(name.strip() for name in names)
