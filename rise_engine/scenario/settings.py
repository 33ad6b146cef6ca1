"""Reading scenario.toml (docs/reference/scenario.md)."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rise_engine.expression import Assignment, ExpressionError
from rise_engine.nearest_name import listed, suggestion
from rise_engine.scenario.actions import unknown_keys
from rise_engine.scenario.allow import known_code
from rise_engine.scenario.conditions import expression_message, note_assignment
from rise_engine.scenario.draft import At, Draft, Mention
from rise_engine.scenario.findings import Findings
from rise_engine.scenario.keys import KeyRefusedError, normal_key
from rise_engine.scenario.model import ActSettings, FillerSettings, FunctionName, KeyBinding, Mode, Place, normal_topic
from rise_engine.scenario.toml_places import Table, TomlFile

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
LONGEST_TITLE = 24
"""Characters of a key's `label`: it stands beside others in one line."""
_ACT_KEYS = ("hold", "debounce", "filler", "calling_type")
_CALLING_TYPES = {"none": "None", "blocking": "Blocking"}
MAX_DEBOUNCE = 60.0
_CHECK_KEYS = ("allow",)
_ALLOW_KEYS = ("code", "key", "reason")
_STUDY_KEYS = ("participants", "conditions")
MOST_PARTICIPANTS = 1_000_000
_CONTROL_KEYS = ("may_release",)
_FILLER_KEYS = ("offer_after", "auto_after")
LEAST_AUTO, MOST_FILLER = 0.5, 600.0
"""Seconds. A filler that comes sooner than the first would fall into the participant's own pauses."""


class Settings:
    """What scenario.toml says, checked; everything has a default."""

    def __init__(self, file: TomlFile, draft: Draft, findings: Findings) -> None:
        self.file = file
        self.draft = draft
        self.findings = findings
        self.table = Table(file, (), file.values)
        unknown_keys(self.table, TOP_KEYS, findings)
        self.title = self.text("title", "")
        self.robot = self.text("robot", "")
        self.mode: Mode = "real" if self.text("mode", "debug") == "real" else "debug"
        if self.text("mode", "debug") not in ("debug", "real"):
            self.error("wrong-value", file.value_place("mode"), '`mode` is "debug" or "real"')
        self.places: dict[str, str] = {
            key: self.text(key, "") for key in ("acts", "rules", "memory") if key in file.values
        }
        self.study = self.read_study()
        self.keys = self.read_keys()
        self.act_settings = self.read_acts()
        self.fillers = self.read_fillers()
        self.may_release = self.read_control()
        self.allows = self.read_allows()
        """Warnings about keys of the memory file that are meant: place, code, key, reason."""

    def error(self, code: str, place: Place, message: str) -> None:
        self.findings.error(code, place, message)

    def text(self, key: str, otherwise: str) -> str:
        value = self.file.values.get(key, otherwise)
        if isinstance(value, str):
            return value
        message = f'`{key}` is a text: {key} = "..."'
        if key == "acts" and isinstance(value, dict):
            names = [_toml_key(name) for name in value] or ["NAME"]
            message = f"`acts` says where the acts are; settings of an act stand in [act.{names[0]}], not [acts...]"
        self.error("wrong-type", self.file.value_place(key), message)
        return otherwise

    def subtable(self, key: str) -> Table | None:
        values = self.file.values.get(key)
        if values is None:
            return None
        if isinstance(values, dict):
            return Table(self.file, (key,), values)
        self.error("wrong-type", self.file.place(key), f"`{key}` is a table: [{key}]")
        return None

    def read_allows(self) -> list[tuple[Place, str, str, str]]:
        table = self.subtable("check")
        if table is None:
            return []
        unknown_keys(table, _CHECK_KEYS, self.findings)
        listed_ = table.values.get("allow", [])
        form = 'allow = [{ code = "unwritable-key", key = "...", reason = "..." }]'
        if not isinstance(listed_, list) or not all(isinstance(each, dict) for each in listed_):
            self.error("wrong-type", table.value_place("allow"), f"`allow` is a list of tables: {form}")
            return []
        allows: list[tuple[Place, str, str, str]] = []
        for at, each in enumerate(listed_):
            inner = Table(self.file, ("check", "allow", str(at)), each)
            unknown_keys(inner, _ALLOW_KEYS, self.findings)
            code, key, reason = (each.get(name) for name in _ALLOW_KEYS)
            texts = [value.strip() for value in (code, key, reason) if isinstance(value, str)]
            if len(texts) < len(_ALLOW_KEYS) or not all(texts):
                self.findings.warning("bad-allow", inner.place(), f"say what is meant, and why: {form}")
            elif known_code(str(code), inner.place(), self.findings):
                allows.append((inner.place(), str(code), str(key), str(reason)))
        return allows

    def read_study(self) -> dict[str, Any]:
        """Who takes part and in which conditions. What only people read stands in a comment, or in a README."""
        table = self.subtable("study")
        if table is None:
            return {}
        unknown_keys(table, _STUDY_KEYS, self.findings)
        study: dict[str, Any] = {}
        participants = table.values.get("participants")
        if participants is not None:
            if isinstance(participants, bool) or not isinstance(participants, int):
                message = "`participants` is a whole number: how many take part"
                self.error("wrong-type", table.value_place("participants"), message)
            elif not 1 <= participants <= MOST_PARTICIPANTS:
                message = f"`participants` is from 1 to {MOST_PARTICIPANTS}"
                self.error("out-of-range", table.value_place("participants"), message)
            else:
                study["participants"] = participants
        conditions = table.values.get("conditions")
        if conditions is not None:
            names = [one for one in conditions if isinstance(one, str)] if isinstance(conditions, list) else []
            where = table.value_place("conditions")
            if not isinstance(conditions, list) or len(names) < len(conditions):
                self.error("wrong-type", where, '`conditions` is a list of texts: ["A", "B"]')
            elif not names or not all(name.strip() == name and name for name in names):
                self.error("missing-value", where, "each condition has a name, without blanks around it")
            elif len(set(names)) < len(names):
                twice = Counter(names).most_common(1)[0][0]
                self.error("duplicate-name", where, f"the condition `{twice}` stands there twice")
            else:
                study["conditions"] = names
        return study

    def read_keys(self) -> dict[str, KeyBinding]:
        table = self.subtable("keys")
        bindings: dict[str, KeyBinding] = {}
        for written, value in (table.values if table else {}).items():
            assert table is not None
            place = table.place(written)
            try:
                key = normal_key(written)
            except KeyRefusedError as refused:
                self.error("key-taken" if refused.taken else "key-refused", place, str(refused))
                key = ""
            if key in bindings:
                first = bindings[key]
                self.error(
                    "key-twice", place, f"`{written}` is the same key as `{first.label}` in line {first.place.line}"
                )
                key = ""
            binding = self.binding(table, written, value, key, place)
            if binding is not None and key:
                bindings[key] = binding
        return bindings

    def binding(self, table: Table, written: str, value: Any, key: str, place: Place) -> KeyBinding | None:
        example = f'write {_toml_key(written)} = {{ act = "..." }} (or {", ".join(list(BINDINGS)[1:])})'
        if not isinstance(value, dict):
            self.error("binding", table.value_place(written), f"a key submits something; {example}")
            return None
        inner = Table(self.file, ("keys", written), value)
        unknown_keys(inner, (*BINDINGS, "label"), self.findings)
        title = self.title_of(inner)
        given = [name for name in BINDINGS if name in value]
        if len(given) != 1:
            if len(given) > 1 or not value.keys() - {"label"}:
                self.error("binding", place, f"a key submits exactly one thing; {example}")
            return None
        name = given[0]
        where = inner.value_place(name)
        behavior = value[name]
        if not isinstance(behavior, str):
            self.error("wrong-type", where, f'`{name}` is a text: {name} = "..."')
            return None
        behavior = behavior.strip()
        if not behavior or (name == "event" and not normal_topic(behavior)):
            self.error("missing-value", where, f'`{name}` is empty; {_WANTED[name]}: {name} = "..."')
            return None
        if name in ("act", "stop_act"):
            self.draft.act_mentions.append(Mention(behavior, At(where)))
        elif name in ("rule", "stop_rule"):
            self.draft.rule_mentions.append(Mention(behavior, At(where)))
        elif name == "event":
            self.draft.raises.append(Mention(normal_topic(behavior), At(where)))
        else:
            try:
                note_assignment(Assignment.parse(behavior), At(where), self.draft)
            except ExpressionError as error:
                # the column counts in the text, which begins behind the quotation mark
                column = where.column + error.column
                self.error("assignment", Place(where.file, where.line, column), expression_message(error))
                return None
        return KeyBinding(key, written, BINDINGS[name], behavior, place, title)

    def title_of(self, binding: Table) -> str:
        """What the author calls a key: a word or two, or empty."""
        value = binding.values.get("label", "")
        if "label" not in binding.values:
            return ""
        where = binding.value_place("label")
        if not isinstance(value, str):
            self.error("wrong-type", where, '`label` is a text: label = "not understood"')
            return ""
        title = " ".join(value.split())
        if not title:
            message = "`label` is empty; write what the key means in a word or two, or leave `label` out"
            self.error("missing-value", where, message)
        elif len(title) > LONGEST_TITLE:
            message = f"`label` has {len(title)} characters; there is room for {LONGEST_TITLE}"
            self.error("out-of-range", where, message)
        elif not title.isprintable():
            self.error("wrong-value", where, "`label` has a character that cannot be shown")
        else:
            return title
        return ""

    def read_acts(self) -> dict[str, ActSettings]:
        table = self.subtable("act")
        result: dict[str, ActSettings] = {}
        for name, values in (table.values if table else {}).items():
            place = self.file.place("act", name)
            self.draft.act_mentions.append(Mention(name, At(place)))
            if not isinstance(values, dict):
                self.error("wrong-type", place, f"settings of an act are a table: [act.{_toml_key(name)}]")
                continue
            inner = Table(self.file, ("act", name), values)
            unknown_keys(inner, _ACT_KEYS, self.findings)
            calling = values.get("calling_type", "Blocking")
            if not isinstance(calling, str) or calling.lower() not in _CALLING_TYPES:
                self.error(
                    "wrong-value",
                    inner.value_place("calling_type"),
                    f"`calling_type` is one of {listed(_CALLING_TYPES.values())}"
                    + (suggestion(calling, _CALLING_TYPES.values(), limit=0) if isinstance(calling, str) else ""),
                )
                calling = "Blocking"
            result[name] = ActSettings(
                hold=self.flag(inner, "hold"),
                debounce=self.debounce(inner),
                filler=self.flag(inner, "filler"),
                calling_type="None" if calling.lower() == "none" else "Blocking",
            )
        return result

    def read_fillers(self) -> FillerSettings:
        table = self.subtable("fillers")
        usual = FillerSettings()
        if table is None:
            return usual
        unknown_keys(table, _FILLER_KEYS, self.findings)
        offer = self.seconds(table, "offer_after", usual.offer_after, 0.0)
        auto = self.seconds(table, "auto_after", usual.auto_after, LEAST_AUTO)
        if auto is not None and not any(settings.filler for settings in self.act_settings.values()):
            message = "no act is a filler, so none will ever be started: `filler = true` under [act.NAME] makes one"
            self.findings.warning("no-filler", table.place("auto_after"), message)
        return FillerSettings(usual.offer_after if offer is None else offer, auto)

    def seconds(self, table: Table, key: str, otherwise: float | None, least: float) -> float | None:
        value = table.values.get(key, otherwise)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.error("wrong-type", table.value_place(key), f"`{key}` is a number of seconds")
        elif not least <= value <= MOST_FILLER:
            self.error("out-of-range", table.value_place(key), f"`{key}` is from {least:g} to {MOST_FILLER:g} seconds")
        else:
            return float(value)
        return otherwise

    def read_control(self) -> tuple[str, ...]:
        """Who may release a stop beside who holds control."""
        table = self.subtable("control")
        if table is None:
            return ()
        unknown_keys(table, _CONTROL_KEYS, self.findings)
        names = table.values.get("may_release", [])
        if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() for name in names):
            self.error(
                "wrong-type",
                table.value_place("may_release"),
                "`may_release` is a list of names: of ROS nodes, with namespace, or of programs on the link: "
                'may_release = ["/supervisor"]',
            )
            return ()
        return tuple(name.strip() for name in names)

    def flag(self, table: Table, key: str) -> bool:
        value = table.values.get(key, False)
        if isinstance(value, bool):
            return value
        self.error("wrong-type", table.value_place(key), f"`{key}` is true or false")
        return False

    def debounce(self, table: Table) -> float:
        value = table.values.get("debounce", ActSettings().debounce)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.error("wrong-type", table.value_place("debounce"), "`debounce` is a number of seconds")
        elif not 0 <= value <= MAX_DEBOUNCE:
            self.error(
                "out-of-range", table.value_place("debounce"), f"`debounce` is from 0 to {MAX_DEBOUNCE:g} seconds"
            )
        else:
            return float(value)
        return ActSettings().debounce


def _toml_key(key: str) -> str:
    bare = key.replace("_", "").replace("-", "")
    if bare.isascii() and bare.isalnum():
        return key
    return '"' + key.replace("\\", "\\\\").replace('"', '\\"') + '"'
