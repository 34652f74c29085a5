# SPDX-License-Identifier: Apache-2.0
"""What a machine means: the tick, written from docs/language.md around the oracle's algorithms."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import oracle
from . import tree as t
from .machines import Action, Case
from .types import HEALTH_NAMES, Type, leaves

#: Path of a leaf and its plain values, flat: what a host can see of one field.
Fields = dict[str, list[Any]]


class OracleMachine:
    """A machine run by the oracle. `failed_start` is the instance whose start() faulted, or ""."""

    def __init__(self, case: Case):
        self.case, self.config = case, case.config
        self.names = list(self.config["instances"])
        self.records = {n: oracle.records_of(self.algorithm(n)) for n in self.names}
        self.counters = {n: {"faults": 0, "overruns": 0} for n in self.names}
        self.overrun: set[str] = set()
        self.injected: dict[str, str] = {}  # "fault", or the least health
        self.channels: dict[str, dict[str, Any]] = {
            c["name"]: {"attached": False, "fresh": False, "valid": True, "age": 0, "sample": 0, "stamp": 0, **c}
            for c in self.config.get("channels", [])
            if c["direction"] == "sensor"
        }
        self.connections = self.config.get("connections", [])
        self.state = self.next_state = self.config["initial_state"]
        self.tick = 0
        self.failed_start = self._init()

    def algorithm(self, instance: str) -> t.Algorithm:
        return self.case.algorithms[self.config["instances"][instance]["algorithm"]]

    def _types(self, instance: str, record: str) -> dict[str, Type]:
        return dict(self.algorithm(instance).ports[record])

    def _init(self) -> str:
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
                    oracle.call(self.algorithm(name), start, self.records[name])
                except oracle.Fault:
                    return name
        return ""

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
            self.injected[action.target] = action.value
        elif action.kind == "force":
            self.state = self.next_state = action.target
            self._all_stale()
        elif action.kind == "attach":
            self.channels[action.target]["attached"] = True
        else:
            age, stamp = action.value
            self.channels[action.target] |= {"fresh": True, "sample": age, "stamp": stamp}

    def _set(self, path: str, value: Any) -> None:
        """A leaf: instance.record.port, then members and indices."""
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
        if self.state != self.next_state:
            self.state = self.next_state
            self._all_stale()
        for channel in self.channels.values():
            self._age(channel)
        schedule = self.config["states"][self.state]["schedule"]
        due = [n for n in self._order(list(schedule)) if self._is_due(schedule[n])]
        if self.tick > 0:
            yesterday = [(c, oracle.copy(self._source(c))) for c in self.connections if c.get("delayed")]
            for connection, value in yesterday:
                if connection["to"].split(".")[0] in due:
                    self._deliver(connection, value)
        for name in due:
            self._execute(name)
        self._arbitrate(due)
        self.tick += 1

    def _is_due(self, rate: Any) -> bool:
        hz = self.config["tick_hz"]
        if isinstance(rate, int):
            return self.tick % (hz // rate) == 0
        divisor = rate["every"] if "every" in rate else hz // rate["hz"]
        return bool(self.tick % divisor == rate.get("phase", 0))

    def _order(self, scheduled: list[str]) -> list[str]:
        """By dataflow; of those that are ready the first in the JSON goes first."""
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
        if instance == "machine":
            hz = self.config["tick_hz"]
            return {"dt": np.float64(1.0 / hz), "time_ns": self.tick * 10**9 // hz, "tick": self.tick}[path[0]]
        value: Any = self.records[instance]
        for part in path:
            value = value[part]
        return value

    def _deliver(self, connection: dict[str, Any], value: Any) -> None:
        instance, record, port = connection["to"].split(".")
        self.records[instance][record][port] = oracle.typed(self._types(instance, record)[port], value)

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
                raise oracle.Fault
            oracle.call(self.algorithm(name), self.algorithm(name).execute, records)
        except oracle.Fault:
            records["outputs"], records["state"] = before
            records["outputs"]["health"] = "failed"
            self.counters[name]["faults"] += 1
        outputs = records["outputs"]
        if outputs["health"] == "stale":  # what runs is not
            outputs["health"] = "failed"
        if injected != "fault":
            outputs["health"] = _worse(outputs["health"], injected)
        if name in self.overrun:
            self.overrun.remove(name)
            self.counters[name]["overruns"] += 1
            outputs["health"] = _worse(outputs["health"], "degraded")
        fields = (c for c in self.channels.values() if c["field"].split(".")[0] == name)
        if any(not c["valid"] for c in fields):
            outputs["health"] = "failed"

    def _age(self, channel: dict[str, Any]) -> None:
        if channel["fresh"]:
            channel |= {"fresh": False, "age": channel["sample"]}
        elif channel["attached"]:
            channel["age"] = min(channel["age"] + 1, 2**32 - 1)
        else:
            return
        channel["valid"] = channel["age"] <= channel.get("max_age_ticks", 1 << 32)

    def _arbitrate(self, ran: list[str]) -> None:
        edges = sorted(self.config.get("transitions", []), key=lambda e: -e["priority"])
        for edge in edges:
            sources = [edge["from"]] if isinstance(edge["from"], str) else edge["from"]
            leaves_here = self.state in sources or sources == ["*"]
            if leaves_here and edge["to"] != self.state and self._asked(edge, ran) and self._holds(edge, ran):
                self.next_state = edge["to"]
                return

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

    def _all_stale(self) -> None:
        for records in self.records.values():
            records["outputs"]["health"] = "stale"

    # ---- what a host sees ------------------------------------------------------------------------------------------

    def fields(self) -> Fields:
        found: Fields = {
            "machine.state": [self.state],
            "machine.next_state": [self.next_state],
            "machine.tick": [self.tick],
        }
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
        for name, channel in self.channels.items():
            found[f"channels.{name}.valid"] = [channel["valid"]]
            found[f"channels.{name}.age_ticks"] = [channel["age"]]
            found[f"channels.{name}.stamp_ns"] = [channel["stamp"]]
        return found


def _scalars(scalar: str, value: Any) -> Any:
    return [_scalars(scalar, v) for v in value] if isinstance(value, list) else oracle.typed(scalar, value)


def _worse(one: str, other: str) -> str:
    return max(one, other, key=HEALTH_NAMES.index)


def _flat(value: Any) -> list[Any]:
    return [x for v in value for x in _flat(v)] if isinstance(value, list) else [value]
