# SPDX-License-Identifier: Apache-2.0
"""A whole machine run by CPython on its flat memory: the scheduler as docs/architecture.md states it ("The tick").

    reference = ReferenceMachine(machine, layout, places)   # a checked, scheduled fcsl_compiler.model.machine.Machine
    memory = bytearray(size)                                # as large as the layout needs
    assert reference.init(memory) == 0
    reference.step(memory)

`layout` maps paths of the field table to offsets (memory.Layout); with that of a compiled machine the memory is the same, byte
for byte, as the compiled machine's, except for padding and the payloads of NaNs. `places` is the compiled machine's table of
fault places, of which only the numbers are taken. Of the machine only the wiring is used
(instances, connections, schedules, edges, channels); types and values are read from the sources and the JSON anew.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..model.machine import Channel, Connection, Edge, Instance, Machine, PortRef, State
from .algorithm import HARDWARE, Algorithm, Extern, SourceModule, declare_structs
from .arrays import Array
from .fault_places import FaultPlaces, Place
from .functions import wrap
from .memory import HEALTH, Layout, Memory, RecordCodec, codec, from_json
from .structs import Struct
from .types import SCALARS, Type
from .values import I64, Fault

_I32, _U32, _U64 = struct.Struct("=i"), struct.Struct("=I"), struct.Struct("=Q")
_NONE = -1
_STALE = HEALTH.index("stale")


@dataclass
class Host:
    """What `step` may use of its host (fcsl_host_t): a monotonic clock (ns); callables for the hardware builtins, by
    name; and `substitute`, called before an impure instance executes. It returns True if it has stored the results of
    this execute itself."""

    clock_ns: Callable[[], int] | None = None
    hardware: Mapping[str, Callable[..., Any]] | None = None
    substitute: Callable[[int], bool] | None = None


class _Cell:
    """One number of the machine struct."""

    def __init__(self, one: struct.Struct, offset: int):
        self.one, self.offset = one, offset

    def get(self, memory: Memory) -> int:
        return int(self.one.unpack_from(memory, self.offset)[0])

    def set(self, memory: Memory, value: int) -> None:
        self.one.pack_into(memory, self.offset, value)

    def increment(self, memory: Memory) -> None:
        self.set(memory, (self.get(memory) + 1) % 2**64)


def _optional(path: str, layout: Layout) -> _Cell | None:
    """A counter that only machines have that need it."""
    return _Cell(_U64, layout[path]) if path in layout else None


class _Instance:
    """One instance: its algorithm and the locations of its records."""

    def __init__(self, instance: Instance, algorithm: Algorithm, given: Mapping[str, Any], reference: ReferenceMachine):
        self.name, self.algorithm, layout = instance.name, algorithm, reference.layout
        self.limit_ns = instance.max_wcet_us * 1000
        self.codecs = {
            record: RecordCodec(type_, f"{self.name}.{record}", layout, reference.machine.requests)
            for record, type_ in algorithm.records.items()
        }
        self.initial = {
            record: {n: from_json(algorithm.records[record].members[n], v) for n, v in given.get(record, {}).items()}
            for record in ("parameters", "inputs")
        }
        self.frozen = {name: _constant(self.initial["parameters"][name]) for name in instance.frozen}
        self.health = _Cell(_I32, layout[f"{self.name}.outputs.health"])
        self.request = _Cell(_I32, layout[f"{self.name}.outputs.transition_request"])
        self.faults = _Cell(_U64, layout[f"{self.name}.counters.faults"])
        self.fault_place = _Cell(_U32, layout[f"{self.name}.counters.fault_place"])
        self.places = reference.places
        self.overruns = _Cell(_U64, layout[f"{self.name}.counters.overruns"])
        self.inject_overrun = layout.get(f"{self.name}.inject_overrun", -1)
        self.inject_fault = layout[f"{self.name}.inject_fault"]
        self.last_run = _optional(f"{self.name}.counters.last_run", layout)

    def init(self, memory: Memory) -> None:
        for record, values in self.initial.items():
            whole = self.algorithm.records[record].zero()
            for name, value in values.items():
                setattr(whole, name, value)
            self.codecs[record].write(memory, whole)
        self.health.set(memory, _STALE)

    def _self(self, memory: Memory) -> Struct:
        """`self` of a method: the ports of all four records as fields."""
        values: dict[str, Any] = {}
        for codec_ in self.codecs.values():
            values |= codec_.values(memory)
        return self.algorithm.type.of(values | self.frozen)

    def start(self, memory: Memory) -> bool:
        """Runs start. Returns False if it faulted."""
        if not self.algorithm.has_start:
            return True
        self_ = self._self(memory)
        try:
            self.algorithm.run("start", self_)
        except Fault as fault:
            self.fault_place.set(memory, self.places.number(fault))
            return False
        self._write(memory, self_)
        self.health.set(memory, _STALE)  # health and request set in `start` have no effect
        self.request.set(memory, 0)
        return True

    def execute(self, memory: Memory) -> None:
        """Runs execute once. A fault, also an injected one, leaves outputs and state unchanged."""
        self.request.set(memory, 0)
        self.health.set(memory, HEALTH.index("nominal"))
        inject, memory[self.inject_fault] = memory[self.inject_fault], 0
        if inject == 1:
            self._failed(memory, self.places.injected)
            return
        self._run(memory)
        if inject > 1:
            least = HEALTH.index("failed" if inject > 2 else "degraded")
            self.health.set(memory, max(self.health.get(memory), least))

    def _run(self, memory: Memory) -> None:
        self_ = self._self(memory)
        try:
            self.algorithm.run("execute", self_)
        except Fault as fault:
            self._failed(memory, self.places.number(fault))
            return
        self._write(memory, self_)
        if self.health.get(memory) == _STALE:  # a running instance is not stale
            self.health.set(memory, HEALTH.index("failed"))

    def _failed(self, memory: Memory, place: int) -> None:
        self.health.set(memory, HEALTH.index("failed"))
        self.faults.increment(memory)
        self.fault_place.set(memory, place)

    def _write(self, memory: Memory, self_: Struct) -> None:
        for record in ("outputs", "state"):
            self.codecs[record].write(memory, self_)


def _constant(value: Any) -> Any:
    """A frozen parameter as an array constant."""
    return value.as_constant() if type(value) is Array else value


class _Sensor:
    """Age and validity of a sensor channel."""

    def __init__(self, channel: Channel, layout: Layout):
        path = f"channels.{channel.name}"
        self.instance, self.limit = channel.port.instance, channel.max_age_ticks
        self.attached, self.fresh = layout[f"{path}.attached"], layout[f"{path}.fresh"]
        self.valid, self.age = layout[f"{path}.valid"], _Cell(_U32, layout[f"{path}.age_ticks"])
        self.sample_age = _Cell(_U32, layout[f"{path}.sample_age"])
        self.last_sample = _optional(f"{path}.last_sample", layout)

    def advance(self, memory: Memory, tick: int) -> None:
        age = self.age.get(memory)
        if memory[self.fresh]:
            memory[self.fresh] = 0
            age = self.sample_age.get(memory)
            memory[self.valid] = 1
            if self.last_sample is not None:
                self.last_sample.set(memory, tick + 1)
        elif memory[self.attached] and age < 2**32 - 1:
            age += 1
        else:
            return
        self.age.set(memory, age)
        if self.limit is not None:
            memory[self.valid] = age <= self.limit


class ReferenceMachine:
    """`init`, `step` and `force_state` have the meaning of those in fcsl_machine.h. Not thread-safe.

    `externs` makes the callable for a declared extern. Exceptions of user code other than faults propagate from `step`.
    """

    def __init__(
        self,
        machine: Machine,
        layout: Layout,
        places: Sequence[Place],
        externs: Callable[[Extern], Callable[..., Any]] | None = None,
    ):
        self.machine, self.layout, self.host = machine, layout, Host()
        self.places = FaultPlaces(places, machine.sources)
        config = json.loads(machine.config.text)
        algorithms = self._load(config, externs)
        self._instances = [
            _Instance(i, algorithms[i.algorithm.name], config["instances"][i.name], self) for i in machine.instances
        ]
        initial = {tuple(c["to"].split(".")): c["initial"] for c in config.get("connections", []) if c.get("delayed")}
        self._sensors = {c.name: _Sensor(c, layout) for c in machine.channels if c.direction == "sensor"}
        self._delayed = [self._copier(c) for c in machine.connections if c.delayed]
        self._direct = [self._copier(c) for c in machine.connections if not c.delayed]
        own = {i.name for i in machine.instances}  # a subset machine lacks some instances of the JSON text
        inputs = {to: f"{to[0]}.inputs.{to[1]}" for to in initial if to[0] in own}
        self._initial = [(path, self._input(path), initial[to]) for to, path in inputs.items()]
        self._tick = _Cell(_U64, layout["machine.tick"])
        self._state, self._next = _Cell(_I32, layout["machine.state"]), _Cell(_I32, layout["machine.next_state"])
        self._current = _Cell(_I32, layout["machine.current"])
        self._ticks_in_state = _optional("machine.ticks_in_state", layout)
        self._spans = {state.name: self._timed_spans(state) for state in machine.states}
        self._read_span: int | None = None  # span of this tick whose clock reading is current
        self._now_ns = 0

    def _load(
        self, config: Mapping[str, Any], externs: Callable[[Extern], Callable[..., Any]] | None
    ) -> dict[str, Algorithm]:
        structs = declare_structs(config.get("structs", {}))
        sources = {
            Path(source.path): source for source in self.machine.sources
        }  # the JSON may spell a path in several ways
        paths = {source.name: path for path, source in sources.items()}
        modules: dict[Path, SourceModule] = {}

        def load(path: Path) -> SourceModule:
            if path not in modules:

                def beside(module: str) -> SourceModule:
                    return load(path.parent / f"{module.replace('.', '/')}.py")

                made = modules[path] = SourceModule(sources[path].text, str(path.resolve()), structs, beside)
                for builtin in HARDWARE:
                    made.bind(builtin, self._hardware(builtin))
                for extern in made.externs.values() if externs is not None else ():
                    assert externs is not None
                    made.bind(extern.name, externs(extern))
            return modules[path]

        found: dict[str, Algorithm] = {}
        for algorithm in self.machine.algorithms:
            class_name = config["algorithms"][algorithm.name].get("class", algorithm.name)
            found[algorithm.name] = Algorithm(load(paths[algorithm.source]), class_name)
        return found

    def _hardware(self, name: str) -> Callable[..., Any]:
        """A hardware builtin with typed arguments and result. Without hardware a read returns false or 0."""
        arguments, result = HARDWARE[name]

        def call(*args: Any) -> Any:
            values = [SCALARS[kind.base].store(arg) for kind, arg in zip(arguments, args, strict=True)]
            function = (self.host.hardware or {}).get(name)
            found = function(*values) if function is not None else None
            if result.base == "None":
                return None
            type_ = SCALARS[result.base]
            return type_.zero() if found is None else type_.store(found)

        return call

    # ---- connections -----------------------------------------------------------------------------------------------

    def _input(self, to: str) -> Type:
        instance, _, field = to.split(".", 2)
        index = [i.name for i in self._instances].index(instance)
        return self._instances[index].algorithm.records["inputs"].members[field]

    def _copier(self, connection: Connection) -> tuple[int, Callable[[Memory], None]]:
        """The target's instance, and the function that copies the value."""
        names = [i.name for i in self.machine.instances]
        target, source = connection.target, connection.source
        to = f"{names[target.instance]}.inputs.{target.path}"
        type_ = self._input(to)
        write = codec(type_, to, self.layout, self.machine.requests).write
        if source.instance >= 0:
            path = f"{names[source.instance]}.{source.record}.{source.path}"
            read = codec(type_, path, self.layout, self.machine.requests).read
        else:
            read = self._channel_source(source, target) if source.members else self._machine_source(source, target)
        return target.instance, lambda memory: write(memory, read(memory))

    def _machine_source(self, source: PortRef, target: PortRef) -> Callable[[Memory], Any]:
        hz, receiver = self.machine.tick_hz, target.instance
        divisors = [{e.instance: e.divisor for e in state.entries} for state in self.machine.states]

        def elapsed(memory: Memory) -> float:
            last_run = self._instances[receiver].last_run
            assert last_run is not None
            if sources["resumed"](memory):
                return float(sources["period"](memory))
            return (self._tick.get(memory) + 1 - last_run.get(memory)) / hz

        def ticks_in_state(memory: Memory) -> int:
            assert self._ticks_in_state is not None
            return self._ticks_in_state.get(memory)

        sources: dict[str, Callable[[Memory], Any]] = {
            "dt": lambda memory: 1.0 / hz,
            "time_ns": lambda memory: wrap(I64, self._tick.get(memory) * 1_000_000_000 // hz),
            "tick": lambda memory: self._tick.get(memory),
            "period": lambda memory: divisors[self._state.get(memory)][receiver] / hz,
            "elapsed": elapsed,
            "resumed": lambda memory: self._instances[receiver].health.get(memory) == _STALE,
            "ticks_in_state": ticks_in_state,
        }
        return sources[source.field]

    def _channel_source(self, source: PortRef, target: PortRef) -> Callable[[Memory], Any]:
        sensor, receiver = self._sensors[source.field], self._instances[target.instance]

        def fresh(memory: Memory) -> bool:
            assert sensor.last_sample is not None and receiver.last_run is not None
            return sensor.last_sample.get(memory) > receiver.last_run.get(memory)

        sources: dict[str, Callable[[Memory], Any]] = {
            "valid": lambda memory: memory[sensor.valid] != 0,
            "age_ticks": lambda memory: sensor.age.get(memory),
            "fresh": fresh,
        }
        return sources[source.members[0]]

    # ---- the three entries -----------------------------------------------------------------------------------------

    def init(self, memory: Memory) -> int:
        """Zeroes the memory, binds values, runs every start in JSON order. Returns 0, or 1 + the index of the instance
        that faulted."""
        memory[:] = bytes(len(memory))
        self._current.set(memory, _NONE)
        self._state.set(memory, self.machine.initial_state)
        self._next.set(memory, self.machine.initial_state)
        for instance in self._instances:
            instance.init(memory)
        for to, type_, value in self._initial:
            codec(type_, to, self.layout, self.machine.requests).write(memory, from_json(type_, value))
        for sensor in self._sensors.values():
            memory[sensor.valid] = 1
        for index, instance in enumerate(self._instances):
            if not instance.start(memory):
                return index + 1
        return 0

    def step(self, memory: Memory, host: Host | None = None) -> None:
        """Runs one tick."""
        self.host = host or Host()
        if self._state.get(memory) != self._next.get(memory):
            self._enter(memory, self._next.get(memory))
            self._restart(memory)
        for sensor in self._sensors.values():
            sensor.advance(memory, self._tick.get(memory))
        tick, state = self._tick.get(memory), self.machine.states[self._state.get(memory)]
        due = [e.instance for e in state.entries if tick % e.divisor == e.phase]
        if tick > 0:
            for target, carry in self._delayed:
                if target in due:
                    carry(memory)
        self._read_span = None
        for index in due:
            self._run(memory, index, self._spans[state.name].get(index))
        if state.entries:
            self._current.set(memory, _NONE)
        self._arbitrate(memory, state, due)
        if self._ticks_in_state is not None:
            self._ticks_in_state.increment(memory)
        self._tick.increment(memory)

    def force_state(self, memory: Memory, state: int) -> None:
        """Enters a state immediately and cancels a latched transition."""
        if self._state.get(memory) != state:
            self._enter(memory, state)
        self._next.set(memory, state)
        self._restart(memory)

    def _restart(self, memory: Memory) -> None:
        """The coming tick becomes the first of its state."""
        if self._ticks_in_state is not None:
            self._ticks_in_state.set(memory, 0)

    def _timed_spans(self, state: State) -> dict[int, int]:
        """Span number of each timed instance of a state. Consecutive timed instances share clock readings: the end of
        one is the beginning of the next."""
        spans: dict[int, int] = {}
        for before, entry in zip((None, *state.entries), state.entries, strict=False):
            if self._instances[entry.instance].limit_ns:
                spans[entry.instance] = spans.get(before.instance, entry.instance) if before else entry.instance
        return spans

    def _enter(self, memory: Memory, state: int) -> None:
        """Instances scheduled in both the old and the new state continue. All others are stale until they run."""
        before, after = ({e.instance for e in self.machine.states[n].entries} for n in (self._state.get(memory), state))
        for index, instance in enumerate(self._instances):
            if index not in before & after:
                instance.health.set(memory, _STALE)
        self._state.set(memory, state)

    def _run(self, memory: Memory, index: int, span: int | None) -> None:
        """Runs one due instance: inputs, execute, health."""
        instance = self._instances[index]
        clock = self.host.clock_ns or (lambda: 0)
        if span is not None and span != self._read_span:
            self._read_span, self._now_ns = span, clock()
        for target, carry in self._direct:
            if target == index:
                carry(memory)
        if instance.last_run is not None:
            instance.last_run.set(memory, self._tick.get(memory) + 1)
        self._current.set(memory, index)
        substitute = self.host.substitute if instance.algorithm.impure else None
        if substitute is None or not substitute(index):
            instance.execute(memory)
        else:
            memory[instance.inject_fault] = 0  # the substituted record contains its effect
        if instance.limit_ns:
            began, self._now_ns = self._now_ns, clock()
            spent = self._now_ns - began
            if memory[instance.inject_overrun] or spent > instance.limit_ns:
                memory[instance.inject_overrun] = 0
                instance.overruns.increment(memory)
                if instance.health.get(memory) == HEALTH.index("nominal"):
                    instance.health.set(memory, HEALTH.index("degraded"))
        if any(s.instance == index and not memory[s.valid] for s in self._sensors.values()):
            instance.health.set(memory, HEALTH.index("failed"))

    def _arbitrate(self, memory: Memory, state: State, due: list[int]) -> None:
        """Latches the target of the true edge with the highest priority."""
        here = self.machine.states.index(state)
        edges = [e for e in self.machine.edges if e.source == here and self._holds(memory, e, due)]
        if edges:
            self._next.set(memory, max(edges, key=lambda e: e.priority).target)

    def _holds(self, memory: Memory, edge: Edge, due: list[int]) -> bool:
        """Whether an edge is true. Requests and healths count on ticks when their instance ran; `stale` counts always.
        A timed edge requires that the state has lasted long enough, this tick included."""
        if edge.after_ticks:
            assert self._ticks_in_state is not None
            if self._ticks_in_state.get(memory) + 1 < edge.after_ticks:
                return False
        wanted = edge.request + 1
        if wanted and not any(self._instances[i].request.get(memory) == wanted for i in due):
            return False
        if edge.guard_instance < 0:
            return True
        health = self._instances[edge.guard_instance].health.get(memory)
        return bool(edge.guard_mask >> health & 1) and (health == _STALE or edge.guard_instance in due)
