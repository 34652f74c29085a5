# SPDX-License-Identifier: Apache-2.0
"""Requirements that act on generated machines, and their meaning: from docs/guide/requirements.md, by whole histories."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .machines import Action, Case

if TYPE_CHECKING:
    from .ticks import Fields, OracleMachine

#: True, False, or None for what compares a NaN.
Truth = bool | None
_FORMS = ("{}", "{}", "held({}, {})", "once({})", "rose({})")


@dataclass(frozen=True)
class Atom:
    """A condition on the fields of a tick. `needs`: the instance without whose value it has none."""

    text: str
    of: Callable[[Fields], Truth]
    needs: str = ""


@dataclass(frozen=True)
class Acting:
    """`health` of `target` (may be "") at best, while the condition, of one of _FORMS, is violated."""

    id: str
    never: bool
    form: str
    atom: Atom
    ticks: int
    seconds: float
    clock: str
    hold: bool
    target: str
    health: str

    @property
    def instance(self) -> str:
        return f"requirements.{self.id.lower().replace('-', '_')}"

    def json(self) -> dict[str, Any]:
        found: dict[str, Any] = {"id": self.id, "text": "generated"}
        found["never" if self.never else "then"] = self.form.format(self.atom.text, self.seconds)
        found |= {"clock": self.clock} if self.clock else {}
        found |= {"stale": "hold"} if self.hold else {}
        if self.target:
            found["effect"] = {"fail" if self.health == "failed" else "degrade": self.target}
        return found


def with_requirements(case: Case, seed: int) -> Case:
    """The case with some that have effects and guard transitions, of which the host makes some fault."""
    draw, names = random.Random(seed), list(case.config["instances"])
    target = draw.choice(names)
    acting = tuple(_acting(case, draw, f"R-{n}", target if n % 2 else "") for n in range(3))
    edges = [*case.config.get("transitions", [])]
    states = list(case.config["states"])
    for n, one in enumerate(acting if len(states) > 1 else ()):
        edge = {"from": "*", "to": draw.choice(states), "priority": 100 + n, "requirement": one.id}
        edges.append(edge | ({"request": "GO"} if draw.random() < 0.2 and "GO" in case.config["requests"] else {}))
    config = {**case.config, "transitions": edges, "requirements": [one.json() for one in acting]}
    faults = [one.instance for one in acting if (one.target or len(states) > 1) and not one.clock]
    ticks = tuple(
        (*actions, *(Action("fault", name) for name in faults if draw.random() < 0.1)) for actions in case.ticks
    )
    unused = [one for one in acting if one.target or len(states) > 1]
    return replace(case, config=config, ticks=ticks, acting=tuple(unused))


def _acting(case: Case, draw: random.Random, id_: str, target: str) -> Acting:
    names, hz = list(case.config["instances"]), case.config["tick_hz"]
    atom = draw.choice(_atoms(case, draw, names))
    ticks = draw.randint(1, 3) * (3 if hz % 3 == 0 else 1)  # a time with a finite decimal text
    clock = draw.choice(names) if draw.random() < 0.25 else ""
    form, hold = draw.choice(_FORMS), draw.random() < 0.25
    health = draw.choice(("degraded", "failed"))
    return Acting(id_, draw.random() < 0.5, form, atom, ticks, ticks / hz, clock, hold, target, health)


def _atoms(case: Case, draw: random.Random, names: list[str]) -> list[Atom]:
    """Of the tick, the state, faults, and scalars of the instances."""
    states = draw.sample(list(case.config["states"]), 1)
    n = draw.randint(0, 2)
    found = [
        Atom(f"machine.tick % 3 == {n}", lambda f: f["machine.tick"][0] % 3 == n),
        Atom(f"machine.state == '{states[0]}'", lambda f: f["machine.state"] == states),
    ]
    for name in names:
        faults = f"{name}.counters.faults"
        found.append(Atom(f"{faults} <= {n}", lambda f, path=faults: f[path][0] <= n))
        for port, type_ in case.algorithm(name).ports["outputs"]:
            path = f"{name}.outputs.{port}"
            if type_ == "bool":
                found.append(Atom(path, lambda f, path=path: bool(f[path][0]), name))
            elif type_ in ("i32", "u32"):
                found.append(Atom(f"{path} > {n}", lambda f, path=path: int(f[path][0]) > n, name))
            elif type_ in ("f64", "f32"):
                found.append(Atom(f"{path} > 0.5", lambda f, path=path: _more(float(f[path][0])), name))
    return found


def _more(value: float) -> Truth:
    return None if math.isnan(value) else value > 0.5


class ActingOracle:
    """What one requirement has seen since it last began anew."""

    def __init__(self, one: Acting):
        self.one, self.health = one, "stale"
        self._seen: list[tuple[int, Truth]] = []

    @property
    def is_violated(self) -> bool:
        return self.health == "degraded"

    def step(self, m: OracleMachine, ran: list[str]) -> None:
        """At the end of a tick. `ran`: the instances that completed a run."""
        one, fields = self.one, m.fields()
        fields["machine.tick"] = [m.tick + 1]
        self.health = "nominal"
        if m.injected.pop(one.instance, "") == "fault":
            self.health, self._seen = "failed", []
            return
        needed = [name for name in (one.atom.needs, one.clock) if name and not one.hold]
        if any(fields[f"{name}.outputs.health"] == ["stale"] for name in needed):
            self._seen = []
            return
        if one.clock and one.clock not in ran:
            return
        self._seen.append((m.tick, one.atom.of(fields)))
        if self._value() is not (not one.never):
            self.health = "degraded"

    def _value(self) -> Truth:
        now = self._seen[-1]
        if self.one.form.startswith("held"):
            begin = now[0] - self.one.ticks
            return self._seen[0][0] <= begin and _all([truth for tick, truth in self._seen if tick >= begin])
        if self.one.form.startswith("once"):
            return _not(_all([_not(truth) for _, truth in self._seen]))
        if self.one.form.startswith("rose"):
            return _all([now[1], _not(self._seen[max(len(self._seen) - 2, 0)][1])])
        return now[1]


def _not(truth: Truth) -> Truth:
    return None if truth is None else not truth


def _all(parts: list[Truth]) -> Truth:
    return False if False in parts else None if None in parts else True
