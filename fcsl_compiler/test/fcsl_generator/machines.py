# SPDX-License-Identifier: Apache-2.0
"""Machines: the JSON around generated algorithms, and what a host does to them tick by tick."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from . import tree as t
from .algorithms import REQUESTS, algorithm, palette
from .choices import Choices
from .places import ways
from .types import FLOATS, HEALTH, HEALTH_NAMES, SCALARS, Array, Struct, Type, leaves

#: What `machine` offers to connect from.
SOURCES: dict[str, Type] = {"dt": "f64", "time_ns": "i64", "tick": "u64"}

MAX_TICKS = 9


@dataclass(frozen=True)
class Action:
    """What a host does before a tick: set a leaf (path), overrun or fault (instance), health (instance; the value is what it
    is left with at least), force (state), attach or sample (channel; the value is the sample's age in ticks and its stamp)."""

    kind: str
    target: str
    value: Any = None

    def __str__(self) -> str:
        return f"{self.kind} {self.target}" + (f" = {self.value!r}" if self.value is not None else "")


@dataclass(frozen=True, repr=False)
class Case:
    """One machine with the actions before each of its ticks."""

    config: dict[str, Any]
    algorithms: dict[str, t.Algorithm]
    structs: tuple[Struct, ...]
    ticks: tuple[tuple[Action, ...], ...]

    def write(self, folder: Path, name: str) -> Path:
        """The machine JSON and its algorithm files; returns the JSON's path."""
        folder.mkdir(parents=True, exist_ok=True)
        for stem, found in self.algorithms.items():
            (folder / f"{stem}.py").write_text(found.text())
        path = folder / f"{name}.json"
        path.write_text(json.dumps(self.config, indent=1))
        return path

    def __repr__(self) -> str:
        return "the case above"  # what Hypothesis adds to a message that shows it already

    def __str__(self) -> str:
        parts = [f"# ---- {stem}.py\n{a.text()}" for stem, a in self.algorithms.items()]
        parts.append(f"# ---- machine JSON\n{json.dumps(self.config, indent=1)}\n")
        parts.append("# ---- the host, before each tick")
        parts += [f"tick {n}: {'; '.join(map(str, actions)) or '-'}" for n, actions in enumerate(self.ticks)]
        return "\n".join(parts)


@st.composite
def cases(draw: Any, single: bool = False) -> Case:
    """Whole machines; `single` ones have one instance in one state, so that nothing but its program matters."""
    return _Maker(Choices(draw)).case(single)


@dataclass
class _Maker:
    c: Choices
    algorithms: dict[str, t.Algorithm] = field(default_factory=dict)
    config: dict[str, Any] = field(default_factory=dict)

    def case(self, single: bool) -> Case:
        c = self.c
        types = palette(c)
        for n in range(1 if single else c.between(1, 3)):
            self.algorithms[f"alg{n}"] = algorithm(c, f"alg{n}", types, c.chance(50))
        names = ["one"] if single else [f"b{n}" for n in range(c.between(1, 4))]
        hz = c.pick((100, 1, 10, 300, 1000))
        states = ["A"] if single else [f"P{n}" for n in range(c.weighted(((2, 1), (4, 2), (3, 3))))]
        self.config = {"tick_hz": hz, "initial_state": c.pick(states)}
        if types.structs:
            self.config["structs"] = {s.name: {n: str(m) for n, m in s.members} for s in types.structs}
        self.config["algorithms"] = {n: {"source": f"{n}.py"} for n in self.algorithms}
        self.config["instances"] = {n: self._instance() for n in names}
        if not single:
            self.config["connections"] = self._connections(names)
        self.config["states"] = {s: {"schedule": self._schedule(names, hz, single)} for s in states}
        if len(states) > 1:
            self.config["transitions"] = self._transitions(states, names)
        self.config["requests"] = list(REQUESTS)
        channels = [] if single else self._channels(names)
        if channels:
            self.config["channels"] = channels
        self._initial_inputs(names)
        ticks = tuple(self._actions(names, states, tick) for tick in range(c.between(3, MAX_TICKS)))
        return Case(self.config, self.algorithms, types.structs, ticks)

    def _of(self, instance: str) -> t.Algorithm:
        return self.algorithms[self.config["instances"][instance]["algorithm"]]

    def _ports(self, instance: str, record: str) -> dict[str, Type]:
        return dict(self._of(instance).ports[record])

    # ---- JSON ------------------------------------------------------------------------------------------------------

    def _instance(self) -> dict[str, Any]:
        c = self.c
        name = c.pick(list(self.algorithms))
        found: dict[str, Any] = {"algorithm": name}
        parameters = self.algorithms[name].ports["parameters"]
        if parameters:
            frozen: Any = []
            if c.chance(40):
                frozen = found["frozen"] = c.some([n for n, _ in parameters], 70) if c.chance(60) else True
            given = found["parameters"] = {n: c.literal(k) for n, k in parameters}
            for n, k in parameters:
                if (frozen is True or n in frozen) and isinstance(k, Array) and k.element in FLOATS and c.chance(70):
                    given[n] = c.sparse(given[n])
        if c.chance(30):
            found["max_wcet_us"] = 1000
        return found

    def _connections(self, names: list[str]) -> list[dict[str, Any]]:
        """At most one source for each input; plain ones lead forward in an order of their own, so there is no cycle."""
        c, found = self.c, []
        rank = {n: c.upto(9) * 10 + i for i, n in enumerate(names)}
        for target in names:
            for port, type_ in self._ports(target, "inputs").items():
                if not c.chance(60):
                    continue
                sources = [f"machine.{n}" for n, k in SOURCES.items() if k == type_]
                for source in names if not (sources and c.chance(30)) else ():
                    offered = {**self._ports(source, "outputs"), "health": HEALTH}
                    for output, k in offered.items():
                        sources += [f"{source}.outputs.{output}{p}" for p in members_of(k, type_)]
                if not sources:
                    continue
                chosen = c.pick(sources)
                connection: dict[str, Any] = {"from": chosen, "to": f"{target}.inputs.{port}"}
                source = chosen.split(".")[0]
                if source != "machine" and (rank[source] >= rank[target] or c.chance(25)):
                    initial = c.pick(HEALTH_NAMES) if type_ == HEALTH else c.literal(type_)
                    connection |= {"delayed": True, "initial": initial}
                found.append(connection)
        return found

    def _schedule(self, names: list[str], hz: int, single: bool) -> dict[str, Any]:
        due = names if single else [n for n in names if not self.c.chance(25)]
        return {n: hz if single else self._rate(hz) for n in due}

    def _rate(self, hz: int) -> Any:
        c = self.c
        kind = c.weighted(((6, "every tick"), (2, "hz"), (2, "phase"), (2, "every")))
        divisors = [d for d in (1, 2, 3, 4, 5) if hz % d == 0]
        divisor = c.pick(divisors)
        if kind == "hz":
            return hz // divisor
        if kind == "phase":
            return {"hz": hz // divisor, "phase": c.upto(divisor - 1)}
        if kind == "every":
            every = c.between(1, 4)
            return {"every": every, "phase": c.upto(every - 1)} if c.chance(60) else {"every": every}
        return hz

    def _transitions(self, states: list[str], names: list[str]) -> list[dict[str, Any]]:
        c, edges = self.c, []
        for n in range(c.between(2, 6)):
            to = c.pick(states)
            others = [s for s in states if s != to]
            sources: Any = c.weighted(((4, c.pick(others)), (2, "*"), (2, c.some(others) or others)))
            edge: dict[str, Any] = {"from": sources, "to": to, "priority": (n * 7) % 11 - 5}
            kind = c.weighted(((4, "request"), (3, "health"), (3, "both")))
            if kind != "health":
                edge["request"] = c.pick(REQUESTS)
            if kind != "request":
                words = c.some(HEALTH_NAMES, 40) or [c.pick(HEALTH_NAMES)]
                edge["health"] = {"instance": c.pick(names), "in": words}
            edges.append(edge)
        return edges

    def _channels(self, names: list[str]) -> list[dict[str, Any]]:
        """Sensors on inputs that nothing feeds and on outputs that no algorithm writes; actuators on any output."""
        c = self.c
        connected = {x["to"] for x in self.config["connections"]}
        found: list[dict[str, Any]] = []
        for name in names:
            written = assigned_outputs(self._of(name))
            sensors, actuators = [], []
            for record in ("inputs", "outputs"):
                for port, type_ in self._ports(name, record).items():
                    path = f"{name}.{record}.{port}"
                    fed = path in connected or (record == "outputs" and port in written)
                    fields = [] if fed and record == "inputs" else actuators if fed else sensors
                    fields += [path + member for member in _wired(type_)]
            for direction, fields in (("sensor", sensors), ("actuator", actuators)):
                for path in c.some(fields, 15):
                    at = len(found)
                    channel = {"name": f"c.n{at}", "id": at, "field": path, "direction": direction}
                    if direction == "sensor" and c.chance(70):
                        channel["max_age_ticks"] = c.upto(2)
                    found.append(channel)
        return found

    def _initial_inputs(self, names: list[str]) -> None:
        connected = {x["to"] for x in self.config.get("connections", [])}
        for name in names:
            free = {n: k for n, k in self._ports(name, "inputs").items() if f"{name}.inputs.{n}" not in connected}
            given = {n: self.c.literal(k) for n, k in free.items() if self.c.chance(50)}
            if given:
                self.config["instances"][name]["inputs"] = given

    # ---- the host --------------------------------------------------------------------------------------------------

    def _actions(self, names: list[str], states: list[str], tick: int) -> tuple[Action, ...]:
        c = self.c
        connected = {x["to"] for x in self.config.get("connections", [])}
        guarded = {e["health"]["instance"] for e in self.config.get("transitions", []) if "health" in e}
        found: list[Action] = []
        for name in names:
            for record, percent in (("inputs", 45), ("parameters", 8), ("outputs", 4), ("state", 4)):
                frozen = self.config["instances"][name].get("frozen", [])
                for port, type_ in self._ports(name, record).items():
                    path = f"{name}.{record}.{port}"
                    fixed = record == "parameters" and (frozen is True or port in frozen)
                    if path in connected or fixed or not c.chance(percent):
                        continue
                    found += [Action("set", leaf, value) for leaf, _, value in leaves(type_, c.value(type_), path)]
            if "max_wcet_us" in self.config["instances"][name] and c.chance(20):
                found.append(Action("overrun", name))
            if c.chance(4):
                found.append(Action("fault", name))
            if c.chance(30 if name in guarded else 3):
                found.append(Action("health", name, c.pick(("degraded", "failed"))))
        if len(states) > 1 and c.chance(15):
            found.append(Action("force", c.pick(states)))
        for channel in self.config.get("channels", []):
            if channel["direction"] == "sensor":
                if tick == 0 and c.chance(70):
                    found.append(Action("attach", channel["name"]))
                if c.chance(50):
                    age = c.weighted(((5, 0), (3, c.upto(4)), (1, 2**32 - 1)))
                    found.append(Action("sample", channel["name"], (age, c.pick((0, tick * 10**6 + 1, -1)))))
        return tuple(found)


def members_of(type_: Type, wanted: Type) -> list[str]:
    """Ways by members alone from an output to what a connection may take: "", ".m0", ".m0.m1"."""
    found = []
    for way, k in ways(type_):
        if k == wanted and all(step.member for step in way):
            found.append("".join(f".{step.member}" for step in way))
    return found


def assigned_outputs(algorithm: t.Algorithm) -> set[str]:
    """Outputs that execute or start assigns somewhere."""
    found = set()
    for function in (algorithm.execute, *([algorithm.start] if algorithm.start else [])):
        for s in t.walk(function.block):
            for target in s.targets if isinstance(s, t.Unpack) else [s.target] if isinstance(s, t.Assign) else []:
                place = t.root(target)
                if isinstance(place, t.Field) and place.record == "outputs":
                    found.add(place.name)
    return found


def _wired(type_: Type) -> list[str]:
    """Members that can travel on a channel: numbers and bools, alone or in arrays; "" is the port itself."""
    found = []
    for way, k in ways(type_):
        element = k.element if isinstance(k, Array) else k
        if element in SCALARS and all(step.member for step in way):
            found.append("".join(f".{step.member}" for step in way))
    return found
