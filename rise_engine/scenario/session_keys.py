"""What the engine itself keeps in the memory under `session`, for studies that ask for it (semantics.md 7.2).

A scenario that sets `session` itself has a key of its own of that name, as it always had: then the engine has none.
"""

from __future__ import annotations

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.model import SESSION, Json

EXAMPLE: dict[str, Json] = {
    "speaking": False,
    "cue": False,
    "stopped": False,
    "participant": "",
    "condition": "",
    "factors": None,
    "language": "",
}
"""What there is in it; of the factors nobody knows the names before the study says them."""


def add_session_keys(draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """See whether anything in the scenario asks for a value of the session."""
    reads = [
        mention
        for mentions in (
            draft.key_reads,
            draft.optional_key_reads,
            draft.property_reads,
            draft.bare_words,
            draft.bare_keys,
        )
        for mention in mentions
        if mention.name.partition(".")[0] == SESSION
    ]
    if not reads:
        return
    is_own = SESSION in draft.tables or any(key.partition(".")[0] == SESSION for key in draft.settable_keys)
    if not is_own:
        draft.session_keys = EXAMPLE
        draft.settable_keys.add(SESSION)
    elif known := next((each for each in reads if each.name.partition(".")[2].partition(".")[0] in EXAMPLE), None):
        message = (
            f"`{known.name}` is a key of this scenario, because it sets `{SESSION}` itself; what the engine knows of "
            "the session is not there under that name: call your own key something else"
        )
        diagnostics.warning("own-session", known.locate(), message)


def factors_read(draft: ScenarioDraft) -> frozenset[str]:
    """The names of the study's factors that anything asks for and that has no fallback: `pace` of
    `session.factors.pace`."""
    if not draft.session_keys:
        return frozenset()
    paths = (mention.name.split(".") for mention in (*draft.key_reads, *draft.bare_words, *draft.bare_keys))
    return frozenset(path[2] for path in paths if path[:2] == [SESSION, "factors"] and len(path) > 2)


def session_problem(draft: ScenarioDraft, key: str) -> str:
    """What to say of a part of the session that there is not; empty for other keys."""
    head, _, part = key.partition(".")
    if head != SESSION or not draft.session_keys:
        return ""
    near = did_you_mean(key, [f"{SESSION}.{name}" for name in EXAMPLE])
    return f"the engine keeps no `{part}` under `{SESSION}`{near}"
