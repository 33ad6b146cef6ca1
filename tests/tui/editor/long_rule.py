"""A study whose course has 40 states and 120 ways: nine tasks that can be helped with, repeated and given up."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

TASKS = ("Red cubes", "Blue cubes", "All cubes", "Cups", "Plates", "Forks", "Napkins", "Glasses", "A whole table")
SAID = {
    "R_Welcome": "Welcome! We will set a table together.",
    "R_Introduction": "Here is the next task.",
    "R_Help": "Have another look at the picture.",
    "R_Check": "Let me see whether all is there.",
    "R_Goodbye": "Thank you for your help. Goodbye!",
}


def _way(target: str, **trigger: str) -> str:
    given = "".join(f" {name}={quoteattr(value)}" for name, value in trigger.items())
    return f"    <transition{given} target={quoteattr(target)}/>\n"


def _state(id: str, act: str, *ways: str) -> str:
    entered = f'    <onEntry><function startCommunicationRobotAct="{act}"/></onEntry>\n' if act else ""
    return f"  <State id={quoteattr(id)}>\n{entered}{''.join(ways)}  </State>\n"


def _task(number: int) -> str:
    introduction, working, help, check = (
        f"{TASKS[number]}, {part}" for part in ("introduction", "at work", "help", "check")
    )
    following = f"{TASKS[number + 1]}, introduction" if number + 1 < len(TASKS) else "Goodbye"
    stop = _way("Goodbye", eventTopic="/give_up")
    return "".join(
        (
            _state(introduction, "R_Introduction", _way(working, eventTopic="/R_Introduction_end"),
                   _way(introduction, eventTopic="/repeat"), stop),
            _state(working, "", _way(check, eventTopic="/done"), _way(help, eventTopic="/help"),
                   _way(help, after="90s"), stop),
            _state(help, "R_Help", _way(working, eventTopic="/R_Help_end"), _way(check, eventTopic="/done"), stop),
            _state(check, "R_Check", _way(following, eventTopic="/right"), _way(working, eventTopic="/wrong"), stop),
        )
    )  # fmt: skip


def long_rule_files() -> dict[str, bytes]:
    """The files of the study."""
    acts = "".join(
        f'<Dialog name="{name}"><Speech><actionID>1</actionID><message>{text}</message></Speech></Dialog>\n'
        for name, text in SAID.items()
    )
    states = (
        _state("Start", "", _way("Welcome", eventTopic="/begin")),
        _state("Welcome", "R_Welcome", _way(f"{TASKS[0]}, introduction", eventTopic="/R_Welcome_end")),
        *(_task(number) for number in range(len(TASKS))),
        _state("Goodbye", "R_Goodbye", _way("Over", eventTopic="/R_Goodbye_end")),
        _state("Over", ""),
    )
    keys = {"b": "begin", "d": "done", "h": "help", "r": "repeat", "y": "right", "n": "wrong", "g": "give_up"}
    return {
        "acts/acts.xml": f"<Dialogs>\n{acts}</Dialogs>\n".encode(),
        "rules/course.xml": (
            '<InteractionRules>\n<InteractionRule name="Course" initial="Start" priority="1">\n'
            f"{''.join(states)}</InteractionRule>\n</InteractionRules>\n"
        ).encode(),
        "memory.json": b"{}\n",
        "scenario.toml": (
            'title = "Forty states"\nrobot = "pepper"\nlanguage = "en"\n\n[keys]\nt = { rule = "Course" }\n'
            + "".join(f'{key} = {{ event = "/{event}" }}\n' for key, event in keys.items())
        ).encode(),
    }
