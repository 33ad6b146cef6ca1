"""Reading a rule of 1,000 states, compared with the minimum of any reader: parse the XML, compile the conditions and
the assignments, resolve the targets."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from lxml import etree
from measure import Report, interleave

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.loader import load

STATES = 1_000


def rule_file() -> str:
    states = "\n".join(
        f"""  <State id="S{n}">
    <onEntry>
      <if cond="score &gt; {n} and not finished">
        <function assignValue="score = score + {n}"/>
      <else>
        <function raiseEventTopic="/go_{n}"/>
      </else>
      </if>
    </onEntry>
    <transition eventTopic="/go_{n}" target="S{(n + 1) % STATES}"/>
  </State>"""
        for n in range(STATES)
    )
    return f'<InteractionRule name="Long" initial="S0" priority="1">\n{states}\n</InteractionRule>\n'


def floor(data: bytes) -> int:
    root = etree.fromstring(data)
    ids = {state.get("id") for state in root.iter("State")}
    guards = [Expression.parse(element.get("cond") or "") for element in root.iter("if")]
    functions = [element.get("assignValue") for element in root.iter("function")]
    assignments = [Assignment.parse_all(text) for text in functions if text is not None]
    assert all(transition.get("target") in ids for transition in root.iter("transition"))
    return len(guards) + len(assignments)


def main() -> bool:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rules").mkdir()
        text = rule_file()
        (folder / "rules" / "long.xml").write_text(text, encoding="utf-8")
        (folder / "memory.json").write_text('{"score": 0, "finished": false}', encoding="utf-8")
        scenario, findings = load(folder)
        assert scenario is not None and not findings, findings[:3]

        # another text each time, so that no cache applies
        count = 0

        def fresh() -> str:
            nonlocal count
            count += 1
            return text.replace("score &gt; ", f"score &gt; {count}")

        def ours() -> None:
            (folder / "rules" / "long.xml").write_text(fresh(), encoding="utf-8")
            load(folder)

        def least() -> None:
            (folder / "rules" / "long.xml").write_text(fresh(), encoding="utf-8")
            floor((folder / "rules" / "long.xml").read_bytes())

        figures = interleave({"load, all checks": (ours, 1), "floor": (least, 1)}, rounds=15)
    report = Report(f"A rule file of {STATES} states")
    for name, figure in figures.items():
        report.row(name, f"{figure.median * 1000:.1f} ms")
    report.target("times the floor", figures["load, all checks"].median / figures["floor"].median, 3, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
