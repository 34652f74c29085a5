# SPDX-License-Identifier: Apache-2.0
"""Generates machines: the JSON around generated algorithms, and the actions of a host in every tick."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from . import tree as t
from .algorithms import Program, palette, program
from .choices import Choices
from .externs import c_files
from .places import ways
from .tree import EXTERN, EXTERN_CASE
from .types import FLOATS, HEALTH, HEALTH_NAMES, REQUEST, REQUESTS, SCALARS, Array, Struct, Type, leaves

#: Sources of `machine` for connections.
SOURCES: dict[str, Type] = {"dt": "f64", "time_ns": "i64", "tick": "u64", "period": "f64", "resumed": "bool"}
SOURCES |= {"elapsed": "f64", "ticks_in_state": "u64"}
#: Sources of a sensor's channel for connections.
CHANNEL_SOURCES: dict[str, Type] = {"valid": "bool", "age_ticks": "u32", "fresh": "bool"}

MAX_TICKS = 9


@dataclass(frozen=True)
class Action:
    """An action of a host before a tick: set a leaf (path), overrun or fault (instance), health (instance; the value is
    the minimum health), force (state), attach or sample (channel; the value is the sample's age in ticks and its
    stamp)."""

    kind: str
    target: str
    value: Any = None

    def __str__(self) -> str:
        return f"{self.kind} {self.target}" + (f" = {self.value!r}" if self.value is not None else "")


@dataclass(frozen=True)
class Case:
    """One machine with the actions before each of its ticks. A board, if present, answers its hardware calls. `acting`: its
    requirements that act, as their oracle has them."""

    config: dict[str, Any]
    program: Program
    structs: tuple[Struct, ...]
    ticks: tuple[tuple[Action, ...], ...]
    board: bool = True
    acting: tuple[Any, ...] = ()

    def algorithm(self, instance: str) -> t.Algorithm:
        return self.program.algorithms[self.config["instances"][instance]["algorithm"]][1]

    def write(self, folder: Path, name: str) -> Path:
        """Writes the machine JSON, its algorithm files and the C of its externs. Returns the path of the JSON."""
        texts = {file.path: file.text() for file in self.program.files}
        config, outside = self.config, f"{EXTERN}{name}"
        if self.program.externs:
            texts[f"{outside}.h"], texts[f"{outside}.c"] = c_files(name, self.program.externs)
            config = {**config, "targets": {"simulation": {"sources": [f"{outside}.c"], "include": ["."]}}}
        texts[f"{name}.json"] = json.dumps(config, indent=1)
        for path, text in texts.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text.replace(EXTERN_CASE, outside))
        return folder / f"{name}.json"

    def _repr_pretty_(self, printer: Any, _: bool) -> None:
        printer.text("the case above")  # Hypothesis would repeat the case in the message

    def __str__(self) -> str:
        parts = [f"# ---- {file.path}\n{file.text()}" for file in self.program.files]
        parts.append(f"# ---- machine JSON\n{json.dumps(self.config, indent=1)}\n")
        parts.append(f"# ---- the host, {'with' if self.board else 'without'} hardware, before each tick")
        parts += [f"tick {n}: {'; '.join(map(str, actions)) or '-'}" for n, actions in enumerate(self.ticks)]
        return "\n".join(parts)


@st.composite
def cases(draw: Any, single: bool = False) -> Case:
    """Whole machines. `single`: one instance in one state, so that only its program is tested."""
    return _Maker(Choices(draw)).case(single)


@dataclass
class _Maker:
    c: Choices
    program: Program = field(default_factory=lambda: Program((), {}))
    config: dict[str, Any] = field(default_factory=dict)

    def case(self, single: bool) -> Case:
        c = self.c
        types = palette(c)
        self.program = program(c, types, 1 if single else c.between(1, 3))
        listed = not single or c.chance(75)  # without a list, the names in algorithms are requests
        c.requests = REQUESTS if listed else ()
        names = ["one"] if single else [f"b{n}" for n in range(c.between(1, 4))]
        hz = c.pick((100, 1, 10, 300, 1000))
        states = ["A"] if single else [f"P{n}" for n in range(c.weighted(((2, 1), (4, 2), (3, 3))))]
        self.config = {"tick_hz": hz, "initial_state": c.pick(states)}
        if types.structs:
            self.config["structs"] = {s.name: {n: str(m) for n, m in s.members} for s in types.structs}
        self.config["algorithms"] = {
            key: {"source": file.path} | ({} if key == found.name else {"class": found.name})
            for key, (file, found) in self.program.algorithms.items()
        }
        self.config["instances"] = {n: self._instance() for n in names}
        if not single:
            self.config["connections"] = self._connections(names)
        self._states(states, names, hz, single)
        if len(states) > 1:
            self.config["transitions"] = self._transitions(states, names, hz)
        if listed:
            self.config["requests"] = list(REQUESTS)
        channels = [] if single else self._channels(names)
        if channels:
            self.config["channels"] = channels
            self._connect_channels(names)
        self._initial_inputs(names)
        ticks = tuple(self._actions(names, states, tick) for tick in range(c.between(3, MAX_TICKS)))
        return Case(self.config, self.program, types.structs, ticks, c.chance(85))

    def _of(self, instance: str) -> t.Algorithm:
        return self.program.algorithms[self.config["instances"][instance]["algorithm"]][1]

    def _ports(self, instance: str, record: str) -> dict[str, Type]:
        return dict(self._of(instance).ports[record])

    # ---- JSON ------------------------------------------------------------------------------------------------------

    def _instance(self) -> dict[str, Any]:
        c = self.c
        name = c.pick(list(self.program.algorithms))
        found: dict[str, Any] = {"algorithm": name}
        parameters = self.program.algorithms[name][1].ports["parameters"]
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
        """At most one source per input. Plain connections follow a fixed order, so there is no cycle."""
        c, found = self.c, []
        rank = {n: c.upto(9) * 10 + i for i, n in enumerate(names)}
        for target in names:
            for port, type_ in self._ports(target, "inputs").items():
                if not c.chance(60):
                    continue
                sources = [f"machine.{n}" for n, k in SOURCES.items() if k == type_]
                for source in names if not (sources and c.chance(30)) else ():
                    offered = {**self._ports(source, "outputs"), "health": HEALTH}
                    offered |= {"transition_request": REQUEST} if self._of(source).requests else {}
                    for output, k in offered.items():
                        sources += [f"{source}.{output}{p}" for p in members_of(k, type_)]
                if not sources:
                    continue
                chosen = c.pick(sources)
                connection: dict[str, Any] = {"from": chosen, "to": f"{target}.{port}"}
                source = chosen.split(".")[0]
                if source != "machine" and (rank[source] >= rank[target] or c.chance(25)):
                    connection |= {"delayed": True, "initial": c.literal(type_)}
                found.append(connection)
        return found

    def _states(self, states: list[str], names: list[str], hz: int, single: bool) -> None:
        always = self.c.some(names, 30) if not single and self.c.chance(50) else []
        if always:
            self.config["always"] = {n: self._rate(hz) for n in always}
        rest = [n for n in names if n not in always]
        found = self.config["states"] = {s: {"schedule": self._schedule(rest, hz, single)} for s in states}
        for state in found.values():
            if always and not state["schedule"] and self.c.chance(50):
                del state["schedule"]

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

    def _transitions(self, states: list[str], names: list[str], hz: int) -> list[dict[str, Any]]:
        c, edges = self.c, []
        for n in range(c.between(2, 6)):
            to = c.pick(states)
            others = [s for s in states if s != to]
            sources: Any = c.weighted(((4, c.pick(others)), (2, "*"), (2, c.some(others) or others)))
            edge: dict[str, Any] = {"from": sources, "to": to, "priority": (n * 7) % 11 - 5}
            kinds = ((5, "request"), (4, "health"), (4, "request health"), (2, "time"), (1, "request time"))
            kind = c.weighted((*kinds, (1, "health time"), (1, "request health time"))).split()
            if "request" in kind:
                edge["request"] = c.pick(REQUESTS)
            if "health" in kind:
                words = c.some(HEALTH_NAMES, 40) or [c.pick(HEALTH_NAMES)]
                edge["health"] = {"instance": c.pick(names), "in": words}
            if "time" in kind:
                edge["after_s"] = self._seconds(c.between(1, 4))
            edges.append(edge)
        return edges

    def _channels(self, names: list[str]) -> list[dict[str, Any]]:
        """Sensors on unconnected inputs and on outputs that no algorithm writes; actuators on any output."""
        c, connected = self.c, self._connected()
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
                    if direction == "sensor" and c.chance(30):
                        channel["start_grace_s"] = self._seconds(c.upto(3))
                    found.append(channel)
        return found

    def _seconds(self, ticks: int) -> float:
        """A time with a finite decimal text, of at least so many ticks."""
        hz = self.config["tick_hz"]
        return ticks * (3 if hz % 3 == 0 else 1) / hz

    def _connect_channels(self, names: list[str]) -> None:
        """Connects some inputs without connection and channel to values of sensor channels."""
        c, fed = self.c, self._connected() | {channel["field"] for channel in self.config["channels"]}
        sensors = [channel["name"] for channel in self.config["channels"] if channel["direction"] == "sensor"]
        for name in names if sensors else ():
            for port, type_ in self._ports(name, "inputs").items():
                offered = [n for n, k in CHANNEL_SOURCES.items() if k == type_]
                if offered and f"{name}.inputs.{port}" not in fed and c.chance(75):
                    source = f"channels.{c.pick(sensors)}.{c.pick(offered)}"
                    self.config["connections"].append({"from": source, "to": f"{name}.{port}"})

    def _connected(self) -> set[str]:
        """Paths of the inputs that have a source."""
        ends = (x["to"].split(".") for x in self.config.get("connections", []))
        return {f"{instance}.inputs.{port}" for instance, port in ends}

    def _initial_inputs(self, names: list[str]) -> None:
        connected = self._connected()
        for name in names:
            free = {n: k for n, k in self._ports(name, "inputs").items() if f"{name}.inputs.{n}" not in connected}
            given = {n: self.c.literal(k) for n, k in free.items() if self.c.chance(50)}
            if given:
                self.config["instances"][name]["inputs"] = given

    # ---- the host --------------------------------------------------------------------------------------------------

    def _actions(self, names: list[str], states: list[str], tick: int) -> tuple[Action, ...]:
        c, connected = self.c, self._connected()
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
            if c.chance(45 if name in guarded else 3):
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
    """Paths of members from an output to a type that a connection may have: "", ".m0", ".m0.m1"."""
    found = []
    for way, k in ways(type_):
        if k == wanted and all(step.member for step in way):
            found.append("".join(f".{step.member}" for step in way))
    return found


def assigned_outputs(algorithm: t.Algorithm) -> set[str]:
    """Outputs that execute or start assigns."""
    found = set()
    for function in (algorithm.execute, *([algorithm.start] if algorithm.start else [])):
        for s in t.walk(function.block):
            for target in s.targets if isinstance(s, t.Unpack) else [s.target] if isinstance(s, t.Assign) else []:
                place = t.root(target)
                if isinstance(place, t.Field) and place.record == "outputs":
                    found.add(place.name)
    return found


def _wired(type_: Type) -> list[str]:
    """Members that a channel can carry: numbers and bools, alone or in arrays; "" is the port itself."""
    found = []
    for way, k in ways(type_):
        element = k.element if isinstance(k, Array) else k
        if element in SCALARS and all(step.member for step in way):
            found.append("".join(f".{step.member}" for step in way))
    return found
