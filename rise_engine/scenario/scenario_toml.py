"""Reading scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rise_engine.expression import Assignment, ExpressionError
from rise_engine.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.action_declarations import report_unknown_keys
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import KnownLocation, Mention, ScenarioDraft
from rise_engine.scenario.expression_checks import expression_message, note_assignment
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.scenario.model import (
    ActSettings,
    FillerSettings,
    FunctionName,
    KeyBinding,
    Mode,
    SourceLocation,
    normal_topic,
)
from rise_engine.scenario.suppressions import check_warning_code
from rise_engine.scenario.toml_locations import TomlFile, TomlTable

TOP_KEYS = (
    "title",
    "robot",
    "mode",
    "acts",
    "rules",
    "memory",
    "keys",
    "act",
    "fillers",
    "control",
    "study",
    "actions",
    "check",
)
BINDINGS: dict[str, FunctionName] = {
    "act": "startCommunicationRobotAct",
    "rule": "startInteractionRule",
    "event": "raiseEventTopic",
    "set": "assignValue",
    "stop_act": "stopCommunicationRobotAct",
    "stop_rule": "stopInteractionRule",
}
"""What a key can submit, and the function of the DomainTask that comes of it."""
_WANTED = {
    "act": "name an act",
    "rule": "name a rule",
    "event": "name a topic",
    "set": "write an assignment",
    "stop_act": "name an act",
    "stop_rule": "name a rule",
}
MAX_LABEL_LENGTH = 24
"""Characters of a key's `label`: it stands beside others in one line."""
_ACT_KEYS = ("hold", "debounce", "filler", "calling_type")
_CALLING_TYPES = {"none": "None", "blocking": "Blocking"}
MAX_DEBOUNCE = 60.0
_CHECK_KEYS = ("allow",)
_ALLOW_KEYS = ("code", "key", "reason")
_STUDY_KEYS = ("participants", "conditions")
MAX_PARTICIPANTS = 1_000_000
_CONTROL_KEYS = ("may_release",)
_FILLER_KEYS = ("offer_after", "auto_after")
MIN_AUTO_AFTER, MAX_FILLER_DELAY = 0.5, 600.0
"""Seconds. A filler that comes sooner than the first would fall into the participant's own pauses."""


class ScenarioSettings:
    """What scenario.toml says, checked; everything has a default."""

    def __init__(self, file: TomlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        self.file = file
        self.draft = draft
        self.diagnostics = diagnostics
        self.table = TomlTable(file, (), file.values)
        report_unknown_keys(self.table, TOP_KEYS, diagnostics)
        self.title = self.read_text("title", "")
        self.robot = self.read_text("robot", "")
        self.mode: Mode = "real" if self.read_text("mode", "debug") == "real" else "debug"
        if self.read_text("mode", "debug") not in ("debug", "real"):
            self.report_error("wrong-value", file.value_location("mode"), '`mode` is "debug" or "real"')
        self.paths: dict[str, str] = {
            key: self.read_text(key, "") for key in ("acts", "rules", "memory") if key in file.values
        }
        self.study = self.read_study()
        self.keys = self.read_keys()
        self.act_settings = self.read_acts()
        self.fillers = self.read_fillers()
        self.may_release = self.read_control()
        self.suppressions = self.read_suppressions()
        """Warnings about keys of the memory file that are meant: location, code, key, reason."""

    def report_error(self, code: str, location: SourceLocation, message: str) -> None:
        self.diagnostics.error(code, location, message)

    def read_text(self, key: str, otherwise: str) -> str:
        value = self.file.values.get(key, otherwise)
        if isinstance(value, str):
            return value
        message = f'`{key}` is a text: {key} = "..."'
        if key == "acts" and isinstance(value, dict):
            names = [_toml_key(name) for name in value] or ["NAME"]
            message = f"`acts` says where the acts are; settings of an act stand in [act.{names[0]}], not [acts...]"
        self.report_error("wrong-type", self.file.value_location(key), message)
        return otherwise

    def subtable(self, key: str) -> TomlTable | None:
        values = self.file.values.get(key)
        if values is None:
            return None
        if isinstance(values, dict):
            return TomlTable(self.file, (key,), values)
        self.report_error("wrong-type", self.file.key_location(key), f"`{key}` is a table: [{key}]")
        return None

    def read_suppressions(self) -> list[tuple[SourceLocation, str, str, str]]:
        table = self.subtable("check")
        if table is None:
            return []
        report_unknown_keys(table, _CHECK_KEYS, self.diagnostics)
        listed_ = table.values.get("allow", [])
        form = 'allow = [{ code = "unwritable-key", key = "...", reason = "..." }]'
        if not isinstance(listed_, list) or not all(isinstance(each, dict) for each in listed_):
            self.report_error("wrong-type", table.value_location("allow"), f"`allow` is a list of tables: {form}")
            return []
        allows: list[tuple[SourceLocation, str, str, str]] = []
        for at, each in enumerate(listed_):
            inner = TomlTable(self.file, ("check", "allow", str(at)), each)
            report_unknown_keys(inner, _ALLOW_KEYS, self.diagnostics)
            code, key, reason = (each.get(name) for name in _ALLOW_KEYS)
            texts = [value.strip() for value in (code, key, reason) if isinstance(value, str)]
            if len(texts) < len(_ALLOW_KEYS) or not all(texts):
                self.diagnostics.warning("bad-allow", inner.key_location(), f"say what is meant, and why: {form}")
            elif check_warning_code(str(code), inner.key_location(), self.diagnostics):
                allows.append((inner.key_location(), str(code), str(key), str(reason)))
        return allows

    def read_study(self) -> dict[str, Any]:
        """Who takes part and in which conditions. What only people read stands in a comment, or in a README."""
        table = self.subtable("study")
        if table is None:
            return {}
        report_unknown_keys(table, _STUDY_KEYS, self.diagnostics)
        study: dict[str, Any] = {}
        participants = table.values.get("participants")
        if participants is not None:
            if isinstance(participants, bool) or not isinstance(participants, int):
                message = "`participants` is a whole number: how many take part"
                self.report_error("wrong-type", table.value_location("participants"), message)
            elif not 1 <= participants <= MAX_PARTICIPANTS:
                message = f"`participants` is from 1 to {MAX_PARTICIPANTS}"
                self.report_error("out-of-range", table.value_location("participants"), message)
            else:
                study["participants"] = participants
        conditions = table.values.get("conditions")
        if conditions is not None:
            names = [one for one in conditions if isinstance(one, str)] if isinstance(conditions, list) else []
            where = table.value_location("conditions")
            if not isinstance(conditions, list) or len(names) < len(conditions):
                self.report_error("wrong-type", where, '`conditions` is a list of texts: ["A", "B"]')
            elif not names or not all(name.strip() == name and name for name in names):
                self.report_error("missing-value", where, "each condition has a name, without blanks around it")
            elif len(set(names)) < len(names):
                twice = Counter(names).most_common(1)[0][0]
                self.report_error("duplicate-name", where, f"the condition `{twice}` stands there twice")
            else:
                study["conditions"] = names
        return study

    def read_keys(self) -> dict[str, KeyBinding]:
        table = self.subtable("keys")
        bindings: dict[str, KeyBinding] = {}
        for written, value in (table.values if table else {}).items():
            assert table is not None
            location = table.key_location(written)
            try:
                key = bindable_key_name(written)
            except KeyRefusedError as refused:
                self.report_error("key-taken" if refused.taken else "key-refused", location, str(refused))
                key = ""
            if key in bindings:
                first = bindings[key]
                self.report_error(
                    "key-twice",
                    location,
                    f"`{written}` is the same key as `{first.label}` in line {first.location.line}",
                )
                key = ""
            binding = self.read_binding(table, written, value, key, location)
            if binding is not None and key:
                bindings[key] = binding
        return bindings

    def read_binding(
        self, table: TomlTable, written: str, value: Any, key: str, location: SourceLocation
    ) -> KeyBinding | None:
        example = f'write {_toml_key(written)} = {{ act = "..." }} (or {", ".join(list(BINDINGS)[1:])})'
        if not isinstance(value, dict):
            self.report_error("binding", table.value_location(written), f"a key submits something; {example}")
            return None
        inner = TomlTable(self.file, ("keys", written), value)
        report_unknown_keys(inner, (*BINDINGS, "label"), self.diagnostics)
        title = self.read_label(inner)
        given = [name for name in BINDINGS if name in value]
        if len(given) != 1:
            if len(given) > 1 or not value.keys() - {"label"}:
                self.report_error("binding", location, f"a key submits exactly one thing; {example}")
            return None
        name = given[0]
        where = inner.value_location(name)
        behavior = value[name]
        if not isinstance(behavior, str):
            self.report_error("wrong-type", where, f'`{name}` is a text: {name} = "..."')
            return None
        behavior = behavior.strip()
        if not behavior or (name == "event" and not normal_topic(behavior)):
            self.report_error("missing-value", where, f'`{name}` is empty; {_WANTED[name]}: {name} = "..."')
            return None
        if name in ("act", "stop_act"):
            self.draft.act_mentions.append(Mention(behavior, KnownLocation(where)))
        elif name in ("rule", "stop_rule"):
            self.draft.rule_mentions.append(Mention(behavior, KnownLocation(where)))
        elif name == "event":
            self.draft.raised_topics.append(Mention(normal_topic(behavior), KnownLocation(where)))
        else:
            try:
                note_assignment(Assignment.parse(behavior), KnownLocation(where), self.draft)
            except ExpressionError as error:
                # the column counts in the text, which begins behind the quotation mark
                column = where.column + error.column
                self.report_error(
                    "assignment", SourceLocation(where.file, where.line, column), expression_message(error)
                )
                return None
        return KeyBinding(key, written, BINDINGS[name], behavior, location, title)

    def read_label(self, binding: TomlTable) -> str:
        """What the author calls a key: a word or two, or empty."""
        value = binding.values.get("label", "")
        if "label" not in binding.values:
            return ""
        where = binding.value_location("label")
        if not isinstance(value, str):
            self.report_error("wrong-type", where, '`label` is a text: label = "not understood"')
            return ""
        title = " ".join(value.split())
        if not title:
            message = "`label` is empty; write what the key means in a word or two, or leave `label` out"
            self.report_error("missing-value", where, message)
        elif len(title) > MAX_LABEL_LENGTH:
            message = f"`label` has {len(title)} characters; there is room for {MAX_LABEL_LENGTH}"
            self.report_error("out-of-range", where, message)
        elif not title.isprintable():
            self.report_error("wrong-value", where, "`label` has a character that cannot be shown")
        else:
            return title
        return ""

    def read_acts(self) -> dict[str, ActSettings]:
        table = self.subtable("act")
        result: dict[str, ActSettings] = {}
        for name, values in (table.values if table else {}).items():
            location = self.file.key_location("act", name)
            self.draft.act_mentions.append(Mention(name, KnownLocation(location)))
            if not isinstance(values, dict):
                self.report_error("wrong-type", location, f"settings of an act are a table: [act.{_toml_key(name)}]")
                continue
            inner = TomlTable(self.file, ("act", name), values)
            report_unknown_keys(inner, _ACT_KEYS, self.diagnostics)
            calling = values.get("calling_type", "Blocking")
            if not isinstance(calling, str) or calling.lower() not in _CALLING_TYPES:
                self.report_error(
                    "wrong-value",
                    inner.value_location("calling_type"),
                    f"`calling_type` is one of {in_backquotes(_CALLING_TYPES.values())}"
                    + (did_you_mean(calling, _CALLING_TYPES.values(), limit=0) if isinstance(calling, str) else ""),
                )
                calling = "Blocking"
            result[name] = ActSettings(
                hold=self.read_flag(inner, "hold"),
                debounce=self.read_debounce(inner),
                filler=self.read_flag(inner, "filler"),
                calling_type="None" if calling.lower() == "none" else "Blocking",
            )
        return result

    def read_fillers(self) -> FillerSettings:
        table = self.subtable("fillers")
        usual = FillerSettings()
        if table is None:
            return usual
        report_unknown_keys(table, _FILLER_KEYS, self.diagnostics)
        offer = self.read_seconds(table, "offer_after", usual.offer_after, 0.0)
        auto = self.read_seconds(table, "auto_after", usual.auto_after, MIN_AUTO_AFTER)
        if auto is not None and not any(settings.filler for settings in self.act_settings.values()):
            message = "no act is a filler, so none will ever be started: `filler = true` under [act.NAME] makes one"
            self.diagnostics.warning("no-filler", table.key_location("auto_after"), message)
        return FillerSettings(usual.offer_after if offer is None else offer, auto)

    def read_seconds(self, table: TomlTable, key: str, otherwise: float | None, least: float) -> float | None:
        value = table.values.get(key, otherwise)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.report_error("wrong-type", table.value_location(key), f"`{key}` is a number of seconds")
        elif not least <= value <= MAX_FILLER_DELAY:
            self.report_error(
                "out-of-range", table.value_location(key), f"`{key}` is from {least:g} to {MAX_FILLER_DELAY:g} seconds"
            )
        else:
            return float(value)
        return otherwise

    def read_control(self) -> tuple[str, ...]:
        """Who may release a stop beside who holds control."""
        table = self.subtable("control")
        if table is None:
            return ()
        report_unknown_keys(table, _CONTROL_KEYS, self.diagnostics)
        names = table.values.get("may_release", [])
        if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() for name in names):
            self.report_error(
                "wrong-type",
                table.value_location("may_release"),
                "`may_release` is a list of names: of ROS nodes, with namespace, or of programs on the link: "
                'may_release = ["/supervisor"]',
            )
            return ()
        return tuple(name.strip() for name in names)

    def read_flag(self, table: TomlTable, key: str) -> bool:
        value = table.values.get(key, False)
        if isinstance(value, bool):
            return value
        self.report_error("wrong-type", table.value_location(key), f"`{key}` is true or false")
        return False

    def read_debounce(self, table: TomlTable) -> float:
        value = table.values.get("debounce", ActSettings().debounce)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.report_error("wrong-type", table.value_location("debounce"), "`debounce` is a number of seconds")
        elif not 0 <= value <= MAX_DEBOUNCE:
            self.report_error(
                "out-of-range", table.value_location("debounce"), f"`debounce` is from 0 to {MAX_DEBOUNCE:g} seconds"
            )
        else:
            return float(value)
        return ActSettings().debounce


def _toml_key(key: str) -> str:
    bare = key.replace("_", "").replace("-", "")
    if bare.isascii() and bare.isalnum():
        return key
    return '"' + key.replace("\\", "\\\\").replace('"', '\\"') + '"'
