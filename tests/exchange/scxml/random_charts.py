"""Charts by chance: compound and parallel states, histories, finals, internal and targetless transitions, `In`, raised
and sent events, conditions over variables. Every block sets `last` to a number of its own, so that the order shows."""

from __future__ import annotations

from itertools import count
from random import Random

EVENTS = ("e1", "e2", "e3", "e4")
INNER = ("i1", "i2", "done.extra")


class ChartMaker:
    """Makes one chart."""

    def __init__(self, random: Random, *, parallel: bool = True, sends: bool = True) -> None:
        self.random = random
        self.allows_parallel = parallel
        self.sends = sends
        self.numbers = count(1)
        self.ids: list[str] = []
        self.histories: list[str] = []
        self.kinds: dict[str, str] = {}
        self.children: dict[str, list[str]] = {"": []}
        self.parents: dict[str, str] = {}
        self.send_ids: list[str] = []

    def make(self) -> str:
        for _ in range(self.random.randint(2, 3)):
            self.plan("", 0)
        if self.random.random() < 0.5:
            self.plan("", 9, "final")
        body = "".join(self.write(id) for id in self.children[""])
        data = "".join(f'<data id="{name}" expr="0"/>' for name in ("last", "n", "m"))
        return (
            '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" datamodel="ecmascript">'
            f"<datamodel>{data}</datamodel>{body}</scxml>"
        )

    def plan(self, parent: str, depth: int, kind: str = "") -> None:
        """Think of a state and what is in it, so that transitions can lead anywhere."""
        random = self.random
        id = f"s{len(self.ids)}"
        self.ids.append(id)
        self.parents[id] = parent
        self.children[parent].append(id)
        self.children[id] = []
        inside = random.random() < (0.5, 0.4, 0.2)[depth] if depth < 3 else False
        if not kind:
            kind = "parallel" if inside and self.allows_parallel and random.random() < 0.4 else "state"
        self.kinds[id] = kind
        if inside and kind != "final":
            for _ in range(random.randint(2, 3) if kind == "state" else 2):
                self.plan(id, depth + 1)
            if kind == "state" and random.random() < 0.3:
                self.plan(id, 9, "final")
            if random.random() < 0.35:
                self.histories.append(id)

    def write(self, id: str) -> str:
        random = self.random
        kind = self.kinds[id]
        blocks = "".join(
            f"<{tag}>{self.content()}</{tag}>"
            for tag, chance in (("onentry", 0.6), ("onexit", 0.5))
            if random.random() < chance
        )
        if kind == "final":
            return f'<final id="{id}">{blocks}</final>'
        ways = "".join(self.transition(id) for _ in range(random.randint(0, 3)))
        inner = self.children[id]
        begin = ""
        if inner and kind == "state" and random.random() < 0.5:
            target = random.choice(inner)
            if id in self.histories and random.random() < 0.5:
                target = f"h{id}"
            begin = f'<initial><transition target="{target}">{self.content()}</transition></initial>'
        memory = ""
        if id in self.histories:
            depth = random.choice(("shallow", "deep"))
            target = random.choice(inner) if kind == "state" else " ".join(inner)
            way = f'<transition target="{target}">{self.content()}</transition>'
            memory = f'<history id="h{id}" type="{depth}">{way}</history>'
        return f'<{kind} id="{id}">{begin}{blocks}{ways}{memory}{"".join(map(self.write, inner))}</{kind}>'

    def transition(self, id: str) -> str:
        random = self.random
        attributes = ""
        if random.random() < 0.8:
            words = random.sample((*EVENTS, "i1", "i2", "e1.*", f"done.state.{random.choice(self.ids)}"), 1)
            attributes += f' event="{"*" if random.random() < 0.08 else " ".join(words)}"'
            if random.random() < 0.3:
                attributes += f' cond="{self.condition()}"'
        else:
            limit = random.randint(1, 4)
            return (
                f'<transition cond="n &lt; {limit}"{self.target(id)}>'
                f'<assign location="n" expr="n + 1"/>{self.content()}</transition>'
            )
        if random.random() < 0.8:
            attributes += self.target(id)
        return f"<transition{attributes}>{self.content()}</transition>"

    def target(self, id: str) -> str:
        random = self.random
        inner = [each for each in self.ids if self.is_inside(each, id)]
        if inner and random.random() < 0.4:
            kind = ' type="internal"' if random.random() < 0.7 else ""
            return f' target="{random.choice(inner)}"{kind}'
        if self.histories and random.random() < 0.25:
            return f' target="h{random.choice(self.histories)}"'
        return f' target="{random.choice(self.ids)}"'

    def is_inside(self, id: str, other: str) -> bool:
        while id:
            id = self.parents[id]
            if id == other:
                return True
        return False

    def condition(self) -> str:
        random = self.random
        simple = [f"n {random.choice(('&lt;', '==', '!=', '&gt;='))} {random.randint(0, 3)}" for _ in range(2)]
        simple += [f"m == {random.randint(0, 2)}", f"In('{random.choice(self.ids)}')", "m"]
        a, b = random.sample(simple, 2)
        return random.choice((a, a, f"{a} &amp;&amp; {b}", f"{a} || {b}", f"!({a})", f"!(m) || {a}"))

    def content(self, depth: int = 0) -> str:
        random = self.random
        parts = [f'<assign location="last" expr="{next(self.numbers)}"/>']
        if random.random() < 0.15:
            parts.append(f'<raise event="{random.choice(INNER[:2])}"/>')
        if random.random() < 0.2:
            parts.append(f'<assign location="m" expr="{random.choice(("m + 1", "m - 1", "n", "2 * m - n", "0"))}"/>')
        if depth < 2 and random.random() < 0.15:
            other = f"<else/>{self.content(depth + 1)}" if random.random() < 0.5 else ""
            middle = f'<elseif cond="{self.condition()}"/>{self.content(depth + 1)}' if random.random() < 0.3 else ""
            parts.append(f'<if cond="{self.condition()}">{self.content(depth + 1)}{middle}{other}</if>')
        if self.sends and random.random() < 0.08:
            id = f"x{len(self.send_ids)}"
            self.send_ids.append(id)
            delay = random.choice(("", ' delay="101ms"', ' delay="239ms"', ' delay="383ms"'))
            parts.append(
                f'<cancel sendid="{id}"/><send id="{id}" event="{random.choice(("t1", *EVENTS[:2]))}"{delay}/>'
            )
        elif self.send_ids and random.random() < 0.08:
            parts.append(f'<cancel sendid="{random.choice(self.send_ids)}"/>')
        return "".join(parts)
