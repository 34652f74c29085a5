# SPDX-License-Identifier: Apache-2.0
"""Meaning of a machine: the tick, implemented from docs/reference/language.md around the oracle's algorithms."""

from __future__ import annotations

from fractions import Fraction
from itertools import chain, combinations
from typing import Any

import numpy as np

from . import oracle
from . import tree as t
from .externs import Calls
from .hardware import Board
from .machines import Action, Case
from .requirements import ActingOracle
from .types import HEALTH_NAMES, Type, leaves

EVENTS_PER_TICK = 64
#: Path of a leaf and its plain values, flat: one field as seen by a host.
Fields = dict[str, list[Any]]


class OracleMachine:
    """A machine run by the oracle. `failed_start`: the instance whose start() faulted, and the cause; or empty."""

    def __init__(self, case: Case):
        self.case, self.config = case, case.config
        self.names = list(self.config["instances"])
        self.records = {n: oracle.records_of(self.algorithm(n)) for n in self.names}
        self.counters: dict[str, dict[str, Any]] = {
            n: {"faults": 0, "overruns": 0, "fault_place": ""} for n in self.names
        }
        self.overrun: set[str] = set()
        self.injected: dict[str, str] = {}  # "fault", or the minimum health
        self.last_run: dict[str, int] = {}  # tick of an instance's last run without a fault
        self.resumes = set(self.names)  # that have not run without a fault since they were stale
        self.channels: dict[str, dict[str, Any]] = {
            c["name"]: {"attached": False, "fresh": False, "valid": True, "age": 0, "sample": 0, "stamp": 0, **c}
            for c in self.config.get("channels", [])
            if c["direction"] == "sensor"
        }
        self.connections = self.config.get("connections", [])
        self.state = self.next_state = self.config["initial_state"]
        self.tick = self.ticks_in_state = 0
        #: Requests that were lost to another transition, by state and priority.
        self.lost = {(s, e["priority"]): 0 for s in self.config["states"] for e in self._edges(s)}
        self.board = Board(case.board, Calls())
        self.events: list[list[Any]] = []  # of the last tick: instance and text, values
        self.acting = {one.id: ActingOracle(one) for one in case.acting}
        self.failed_start = self._init()

    def algorithm(self, instance: str) -> t.Algorithm:
        return self.case.algorithm(instance)

    def _types(self, instance: str, record: str) -> dict[str, Type]:
        return dict(self.algorithm(instance).ports[record])

    def _init(self) -> list[str]:
        for name in self.names:
            for record in ("parameters", "inputs"):
                for port, value in self.config["instances"][name].get(record, {}).items():
                    found = oracle.typed(self._types(name, record)[port], value)
                    frozen = record == "parameters" and self._is_frozen(name, port)
                    self.records[name][record][port] = oracle.constant(found) if frozen else found
        for connection in self.connections:
            if connection.get("delayed"):
                self._deliver(connection, connection["initial"])
        for name in self.names:
            start = self.algorithm(name).start
            if start is not None:
                try:
                    oracle.call(start, self.records[name])
                    self._check_finite(name, start)
                except oracle.Fault as fault:
                    return [name, str(fault)]
        return []

    def _check_finite(self, name: str, method: t.Function) -> None:
        """What the method may assign is finite, where "nan" is "fail". Raises Fault."""
        if self.config["instances"][name].get("nan", self.config.get("nan")) != "fail":
            return
        assigned = oracle.assigned(method.block)
        for record, word in (("outputs", "output"), ("state", "state")):
            for port in self._types(name, record):
                if port in assigned and not oracle.is_finite(self.records[name][record][port]):
                    raise oracle.Fault(f"{word} `{port}` is NaN or infinite")

    def _is_frozen(self, instance: str, parameter: str) -> bool:
        frozen = self.config["instances"][instance].get("frozen", [])
        return frozen is True or parameter in frozen

    # ---- the host --------------------------------------------------------------------------------------------------

    def act(self, action: Action) -> None:
        if action.kind == "set":
            self._set(action.target, action.value)
        elif action.kind == "overrun":
            self.overrun.add(action.target)
        elif action.kind == "fault":
            self.injected[action.target] = "fault"
        elif action.kind == "health":
            # A fault is worse than any health.
            self.injected[action.target] = max(
                self.injected.get(action.target, "nominal"), action.value, key=(*HEALTH_NAMES[:3], "fault").index
            )
        elif action.kind == "force":
            self._enter(action.target)
            self.next_state, self.ticks_in_state = action.target, 0
        elif action.kind == "attach":
            self.channels[action.target]["attached"] = True
        else:
            age, stamp = action.value
            self.channels[action.target] |= {"fresh": True, "sample": age, "stamp": stamp}

    def _set(self, path: str, value: Any) -> None:
        """Sets a leaf: instance.record.port, then members and indices."""
        instance, record, port, *rest = path.replace("[", ".").replace("]", "").split(".")
        type_ = self._types(instance, record)[port]
        holder, key = self.records[instance][record], port
        for part in rest:
            holder = holder[key]
            key = int(part) if isinstance(holder, list) else part  # type: ignore[assignment]
        template = next(
            scalar
            for leaf, scalar, _ in leaves(type_, oracle.zero(type_), f"{instance}.{record}.{port}")
            if leaf == path
        )
        holder[key] = _scalars(template, value)

    # ---- the tick --------------------------------------------------------------------------------------------------

    def step(self) -> None:
        if self.next_state != self.state:
            self._enter(self.next_state)
            self.ticks_in_state = 0
        for channel in self.channels.values():
            self._age(channel)
        schedule = self._schedule(self.state)
        due = [n for n in self._order(list(schedule)) if self._is_due(schedule[n])]
        if self.tick > 0:
            yesterday = [(c, oracle.copy(self._source(c))) for c in self.connections if c.get("delayed")]
            for connection, value in yesterday:
                if connection["to"].split(".")[0] in due:
                    self._deliver(connection, value)
        self.events = []
        for name in due:
            self._execute(name)
        self._act_by_requirements(due)
        self._arbitrate(due)
        self.tick += 1
        self.ticks_in_state += 1

    def _act_by_requirements(self, due: list[str]) -> None:
        """All are evaluated before any of them acts."""
        completed = [name for name in due if self.last_run.get(name) == self.tick]
        for requirement in self.acting.values():
            requirement.step(self, completed)
        for requirement in self.acting.values():
            if requirement.one.target and requirement.is_violated:
                outputs = self.records[requirement.one.target]["outputs"]
                outputs["health"] = _worse(outputs["health"], requirement.one.health)

    def _schedule(self, state: str) -> dict[str, Any]:
        return {**self.config.get("always", {}), **self.config["states"][state].get("schedule", {})}

    def _is_due(self, rate: Any) -> bool:
        hz = self.config["tick_hz"]
        if isinstance(rate, int):
            return self.tick % (hz // rate) == 0
        divisor = rate["every"] if "every" in rate else hz // rate["hz"]
        return bool(self.tick % divisor == rate.get("phase", 0))

    def _order(self, scheduled: list[str]) -> list[str]:
        """Dataflow order. Ties are resolved in JSON order."""
        before: dict[str, set[str]] = {n: set() for n in scheduled}
        for c in self.connections:
            source, target = c["from"].split(".")[0], c["to"].split(".")[0]
            if not c.get("delayed") and source in before and target in before:
                before[target].add(source)
        order: list[str] = []
        while len(order) < len(before):
            order.append(next(n for n in self.names if n in before and n not in order and before[n] <= set(order)))
        return order

    def _source(self, connection: dict[str, Any]) -> Any:
        instance, *path = connection["from"].split(".")
        receiver = connection["to"].split(".")[0]
        if instance == "machine":
            return self._of_machine(path[0], receiver)
        if instance == "channels":
            return self._of_channel(self.channels[".".join(path[:-1])], path[-1], receiver)
        value: Any = self.records[instance]["outputs"]
        for part in path:
            value = value[part]
        return value

    def _of_machine(self, name: str, receiver: str) -> Any:
        hz, rate = self.config["tick_hz"], self._schedule(self.state)[receiver]
        if name == "period":
            every = rate.get("every") or hz // rate["hz"] if isinstance(rate, dict) else hz // rate
            return np.float64(every / hz)
        if name == "resumed":
            return receiver in self.resumes
        if name == "elapsed":
            if receiver in self.resumes:
                return self._of_machine("period", receiver)
            return np.float64(self.tick - self.last_run[receiver]) / np.float64(hz)
        if name == "ticks_in_state":
            return self.ticks_in_state
        return {"dt": np.float64(1.0 / hz), "time_ns": self.tick * 10**9 // hz, "tick": self.tick}[name]

    def _of_channel(self, channel: dict[str, Any], name: str, receiver: str) -> Any:
        if name != "fresh":
            return channel[name.removesuffix("_ticks")]
        return "came" in channel and channel["came"] > self.last_run.get(receiver, -1)

    def _deliver(self, connection: dict[str, Any], value: Any) -> None:
        instance, port = connection["to"].split(".")
        self.records[instance]["inputs"][port] = oracle.typed(self._types(instance, "inputs")[port], value)

    def _execute(self, name: str) -> None:
        for connection in self.connections:
            if connection["to"].split(".")[0] == name and not connection.get("delayed"):
                self._deliver(connection, self._source(connection))
        records = self.records[name]
        outputs = records["outputs"]
        outputs["transition_request"], outputs["health"] = "", "nominal"
        before = oracle.copy(outputs), oracle.copy(records["state"])
        injected = self.injected.pop(name, "nominal")
        try:
            if injected == "fault":
                raise oracle.Fault("injected")
            events = oracle.call(self.algorithm(name).execute, records, self.board)
            self._check_finite(name, self.algorithm(name).execute)
            self.last_run[name] = self.tick
            self.resumes.discard(name)
            self.events += [[f"{name} {text}", *values] for text, values in events]
        except oracle.Fault as fault:
            self.counters[name]["fault_place"] = str(fault)  # the oracle knows only the cause of a fault, not its place
            records["outputs"], records["state"] = before
            records["outputs"]["health"] = "failed"
            self.counters[name]["faults"] += 1
        outputs = records["outputs"]
        if outputs["health"] == "stale":  # a running instance is not stale
            outputs["health"] = "failed"
        if injected != "fault":
            outputs["health"] = _worse(outputs["health"], injected)
        if name in self.overrun:
            self.overrun.remove(name)
            self.counters[name]["overruns"] += 1
            outputs["health"] = _worse(outputs["health"], "degraded")
        fields = (c for c in self.channels.values() if c["field"].split(".")[0] == name)
        for channel in (c for c in fields if not c["valid"]):
            outputs["health"] = _worse(outputs["health"], "degraded" if self._may_wait(channel) else "failed")

    def _may_wait(self, channel: dict[str, Any]) -> bool:
        """Whether its first sample may still come."""
        grace = channel.get("start_grace_s", self.config.get("start_grace_s"))
        most = channel.get("max_age_ticks", 1 << 32)
        if grace is not None:
            most = Fraction(str(grace)) * self.config["tick_hz"]
        return "came" not in channel and channel["age"] <= most

    def _age(self, channel: dict[str, Any]) -> None:
        if channel["fresh"]:
            channel |= {"fresh": False, "age": channel["sample"], "came": self.tick}
        elif channel["attached"]:
            channel["age"] = min(channel["age"] + 1, 2**32 - 1)
        else:
            return
        channel["valid"] = "came" in channel and channel["age"] <= channel.get("max_age_ticks", 1 << 32)

    def _arbitrate(self, ran: list[str]) -> None:
        true = [
            e
            for e in self._edges(self.state)
            if self._has_lasted(e) and self._asked(e, ran) and self._holds(e, ran) and self._is_violated(e)
        ]
        if true:
            self.next_state = true[0]["to"]
        for other in true[1:]:
            self.lost[self.state, other["priority"]] += _loses(other, true[0])

    def _edges(self, state: str) -> list[dict[str, Any]]:
        """The transitions from a state, the one that is preferred first."""
        edges = sorted(self.config.get("transitions", []), key=lambda e: -e["priority"])
        sources = [[e["from"]] if isinstance(e["from"], str) else e["from"] for e in edges]
        return [e for e, s in zip(edges, sources, strict=True) if (state in s or s == ["*"]) and e["to"] != state]

    def _has_lasted(self, edge: dict[str, Any]) -> bool:
        """Whether the state has lasted long enough, this tick included."""
        return (self.ticks_in_state + 1) / Fraction(self.config["tick_hz"]) >= Fraction(str(edge.get("after_s", 0)))

    def _asked(self, edge: dict[str, Any], ran: list[str]) -> bool:
        if "request" not in edge:
            return True
        return any(self.records[n]["outputs"]["transition_request"] == edge["request"] for n in ran)

    def _holds(self, edge: dict[str, Any], ran: list[str]) -> bool:
        if "health" not in edge:
            return True
        name = edge["health"]["instance"]
        health = self.records[name]["outputs"]["health"]
        return health in edge["health"]["in"] and (name in ran or health == "stale")

    def _is_violated(self, edge: dict[str, Any]) -> bool:
        return "requirement" not in edge or self.acting[edge["requirement"]].is_violated

    def _enter(self, state: str) -> None:
        """Only instances scheduled in both the old and the new state continue. Entering the active state again has no
        effect on them."""
        if state == self.state:
            return
        before, after = self._schedule(self.state), self._schedule(state)
        for name, records in self.records.items():
            if name not in before or name not in after:
                records["outputs"]["health"] = "stale"
                self.resumes.add(name)
        self.state = state

    # ---- what a host sees ------------------------------------------------------------------------------------------

    def fields(self) -> Fields:
        found: Fields = {
            "machine.state": [self.state],
            "machine.next_state": [self.next_state],
            "machine.tick": [self.tick],
            "hardware": list(self.board.calls),
            "externs": self.board.externs.text(),
            "events": [max(0, len(self.events) - EVENTS_PER_TICK), *chain(*self.events[:EVENTS_PER_TICK])],
        }
        timed = any("after_s" in e for e in self.config.get("transitions", []))
        if timed or any(c["from"] == "machine.ticks_in_state" for c in self.connections):
            found["machine.ticks_in_state"] = [self.ticks_in_state]
        pairs = [pair for s in self.config["states"] for pair in combinations(self._edges(s), 2)]
        if any(_loses(other, edge) for edge, other in pairs):
            found["machine.lost_requests"] = list(self.lost.values())
        for connection in self.connections:
            owner, *path = connection["from"].split(".")
            receiver = connection["to"].split(".")[0]
            if connection["from"] in ("machine.elapsed", "machine.resumed"):
                found[f"{receiver}.counters.completed"] = [receiver not in self.resumes]
            if connection["from"] == "machine.elapsed" or (owner == "channels" and path[-1] == "fresh"):
                found[f"{receiver}.counters.last_run"] = [self.last_run.get(receiver, -1) + 1]
            if owner == "channels" and path[-1] == "fresh":
                sensor = ".".join(path[:-1])
                found[f"channels.{sensor}.last_sample"] = [self.channels[sensor].get("came", -1) + 1]
        for name in self.names:
            for record, ports in self.algorithm(name).ports.items():
                for port, type_ in ports:
                    value = self.records[name][record][port]
                    for path, _, leaf in leaves(type_, value, f"{name}.{record}.{port}"):
                        found[path] = _flat(leaf)
            for word in ("transition_request", "health"):
                found[f"{name}.outputs.{word}"] = [self.records[name]["outputs"][word]]
            for counter, count in self.counters[name].items():
                found[f"{name}.counters.{counter}"] = [count]
        for requirement in self.acting.values():
            found[f"{requirement.one.instance}.outputs.health"] = [requirement.health]
        for name, channel in self.channels.items():
            found[f"channels.{name}.valid"] = [channel["valid"]]
            found[f"channels.{name}.waiting"] = ["came" not in channel]
            found[f"channels.{name}.age_ticks"] = [channel["age"]]
            found[f"channels.{name}.stamp_ns"] = [channel["stamp"]]
        return found


def _loses(other: dict[str, Any], taken: dict[str, Any]) -> bool:
    """Whether the request of a transition that also holds is lost: what is taken answers another and leads elsewhere."""
    return "request" in other and other["request"] != taken.get("request") and other["to"] != taken["to"]


def _scalars(scalar: str, value: Any) -> Any:
    return [_scalars(scalar, v) for v in value] if isinstance(value, list) else oracle.typed(scalar, value)


def _worse(one: str, other: str) -> str:
    return max(one, other, key=HEALTH_NAMES.index)


def _flat(value: Any) -> list[Any]:
    return [x for v in value for x in _flat(v)] if isinstance(value, list) else [value]
