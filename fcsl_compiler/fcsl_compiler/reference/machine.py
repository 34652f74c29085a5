# SPDX-License-Identifier: Apache-2.0
"""A whole machine run by CPython on its flat memory: the scheduler as docs/architecture.md states it ("The tick").

    reference = ReferenceMachine(machine, layout, places)   # a checked, scheduled fcsl_compiler.model.machine.Machine
    memory = bytearray(size)                                # as large as the layout needs
    reference.init(memory)
    assert reference.start(memory) == 0
    reference.step(memory)

`layout` maps paths of the field table to offsets (memory.Layout); with that of a compiled machine the memory is the same, byte
for byte, as the compiled machine's, except for padding and the payloads of NaNs. `places` is the compiled machine's table of
fault places, of which only the numbers are taken. Of the machine only the wiring is used
(instances, connections, schedules, edges, channels); types and values are read from the sources and the JSON anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from ..model.events import EVENT
from ..model.machine import Channel, Connection, Edge, Instance, Machine, PortRef, State
from .algorithm import HARDWARE, Algorithm, Extern, SourceModule, declare_structs
from .arrays import Array
from .constants import Literals
from .fault_places import FaultPlaces, FaultRow
from .functions import wrap
from .memory import HEALTH, Image, Layout, Leaf, Memory, Movers, from_json, leaves
from .part_requests import Requests
from .structs import Struct, slot
from .types import SCALARS, Scalar, Type
from .values import I64, Fault

#: instance, file, line, column: of a row of the table event_sites of fcsl_machine.h.
EventRow = tuple[int, str, int, int]

_NONE, _LONG = -1, 2**64 - 1
_NOMINAL, _DEGRADED, _FAILED, _STALE = range(len(HEALTH))


class Offered(Protocol):
    """What `step` may use of its host (fcsl_host_t): a monotonic clock (ns); callables for the hardware builtins, by
    name; `substitute`, called before an impure instance executes, which returns True if it has stored the results of
    this execute itself; `executed`, called after such an execute; and `event`, called with the site and the values of
    each event of an execute that completed."""

    @property
    def clock_ns(self) -> Callable[[], int] | None: ...
    @property
    def hardware(self) -> Mapping[str, Callable[..., Any]] | None: ...
    @property
    def substitute(self) -> Callable[[int], bool] | None: ...
    @property
    def executed(self) -> Callable[[int], None] | None: ...
    @property
    def event(self) -> Callable[[int, Sequence[Any]], None] | None: ...


@dataclass
class Host:
    """A host that offers these."""

    clock_ns: Callable[[], int] | None = None
    hardware: Mapping[str, Callable[..., Any]] | None = None
    substitute: Callable[[int], bool] | None = None
    executed: Callable[[int], None] | None = None
    event: Callable[[int, Sequence[Any]], None] | None = None


def _cell(path: str, layout: Layout, size: int) -> int:
    """Number of a cell of `size` bytes."""
    return layout[path] // size


def _optional(path: str, layout: Layout) -> int | None:
    """Number of a 64-bit cell that only machines have that need it."""
    return _cell(path, layout, 8) if path in layout else None


class _Instance:
    """One instance: its algorithm, and `self`, into which each execute loads what the memory holds."""

    def __init__(self, instance: Instance, algorithm: Algorithm, given: Mapping[str, Any], reference: ReferenceMachine):
        self.nan_fails = instance.nan_fails
        self.name, self.algorithm, layout = instance.name, algorithm, reference.layout
        self.limit_ns, self.places = instance.max_wcet_us * 1000, reference.places
        self.given, self.frozen, self._literals = given, frozenset(instance.frozen), reference.literals
        self._requests = reference.requests[algorithm.part]
        movers = Movers(layout, self._requests.seen) if algorithm.part else reference.movers
        self.self_ = self._initial()
        self.health, self.request = (
            _cell(f"{self.name}.outputs.{port}", layout, 4) for port in ("health", "transition_request")
        )
        self.faults, self.overruns = (_cell(f"{self.name}.counters.{n}", layout, 8) for n in ("faults", "overruns"))
        self.fault_place = _cell(f"{self.name}.counters.fault_place", layout, 4)
        self.inject_overrun = layout.get(f"{self.name}.inject_overrun", -1)
        self.inject_fault = layout[f"{self.name}.inject_fault"]
        self.last_run = _optional(f"{self.name}.counters.last_run", layout)
        self.completed = layout.get(f"{self.name}.counters.completed")
        own = {record: list(self._leaves(record, layout)) for record in algorithm.records}
        written = [*own["outputs"], *own["state"]]
        if "transition_request" not in algorithm.records["outputs"].members:
            written.append(Leaf(layout[f"{self.name}.outputs.transition_request"], SCALARS["i32"], "0"))
        self.store_inputs = movers.storer(own["inputs"])
        self.store_parameters = movers.storer(own["parameters"])
        self.store = movers.storer(written)
        self.load = self._loader(own, reference, movers)
        self._load_for_start = movers.loader([*own["parameters"], *own["outputs"], *own["state"]])

    def _initial(self) -> Struct:
        """`self` before init: values of the JSON and zeros. Frozen parameters are constants."""
        made = self.algorithm.type.zero()
        for name, value in self.given.items():
            stored = from_json(self.algorithm.type.members[name], value, self._literals, self._requests.name)
            setattr(made, slot(name), _constant(stored) if name in self.frozen else stored)
        return made

    def _leaves(self, record: str, layout: Layout) -> Iterator[Leaf]:
        for name, type_ in self.algorithm.records[record].members.items():
            yield from leaves(type_, f"s.{slot(name)}", f"{self.name}.{record}.{name}", layout)

    def _loader(
        self, own: Mapping[str, list[Leaf]], reference: ReferenceMachine, movers: Movers
    ) -> Callable[[Any, Memory], None]:
        """Loads the ports. A connected input comes from its source. Health and request are cleared."""
        skipped = {f"s.{slot(name)}" for name in (*self.frozen, "health", "transition_request")}
        connected, given = reference.connected(self.name)
        self.is_connected = bool(connected or given)
        skipped |= {leaf.place for leaf in connected} | given.keys()
        wanted = [leaf for record in own.values() for leaf in record if leaf.place not in skipped]
        pulses = {f"s.{slot('health')}": "nominal"}
        if "transition_request" in self.algorithm.records["outputs"].members:
            pulses[f"s.{slot('transition_request')}"] = ""
        return movers.loader([*wanted, *connected], given | pulses)

    def init(self, image: Image) -> None:
        self.self_ = self._initial()
        self.store_inputs(self.self_, image.bytes)
        self.store_parameters(self.self_, image.bytes)
        image.words[self.health] = _STALE

    def start(self, image: Image) -> bool:
        """Runs start. Returns False if it faulted."""
        if not self.algorithm.has_start:
            return True
        self._load_for_start(self.self_, image.bytes)
        try:
            self.algorithm.run("start", self.self_)
            if self.nan_fails:
                self.algorithm.check_finite("start", self.self_)
        except Fault as fault:
            image.naturals[self.fault_place] = self.places.number(fault)
            return False
        self.store(self.self_, image.bytes)
        image.words[self.health] = _STALE  # health and request set in `start` have no effect
        image.words[self.request] = 0
        return True

    def execute(self, image: Image) -> None:
        """Runs execute once, on what is loaded. A fault, also an injected one, leaves outputs and state unchanged."""
        self_, inject = self.self_, image.bytes[self.inject_fault]
        if inject:
            image.bytes[self.inject_fault] = 0
        if inject == 1:
            self._failed(image, self.places.injected)
            return
        try:
            self.algorithm.execute(self_)
            if self.nan_fails:
                self.algorithm.check_finite("execute", self_)
        except Fault as fault:
            self._failed(image, self.places.number(fault))
            return
        self.store(self_, image.bytes)
        if image.words[self.health] == _STALE:  # a running instance is not stale
            image.words[self.health] = _FAILED
        if inject > 1:
            image.words[self.health] = max(image.words[self.health], _FAILED if inject > 2 else _DEGRADED)

    def _failed(self, image: Image, place: int) -> None:
        image.words[self.request] = 0
        image.words[self.health] = _FAILED
        image.longs[self.faults] = image.longs[self.faults] + 1 & _LONG
        image.naturals[self.fault_place] = place


def _constant(value: Any) -> Any:
    """A frozen parameter as an array constant."""
    return value.as_constant() if isinstance(value, Array) else value


class _Sensor:
    """Age and validity of a sensor channel."""

    def __init__(self, channel: Channel, layout: Layout):
        path = f"channels.{channel.name}"
        self.instance, self.limit, self.grace = channel.port.instance, channel.max_age_ticks, channel.grace_ticks
        self.attached, self.fresh, self.valid, self.waiting = (
            layout[f"{path}.{name}"] for name in ("attached", "fresh", "valid", "waiting")
        )
        self.age, self.sample_age = (_cell(f"{path}.{name}", layout, 4) for name in ("age_ticks", "sample_age"))
        self.last_sample = _optional(f"{path}.last_sample", layout)

    def advance(self, image: Image, tick: int) -> None:
        age = image.naturals[self.age]
        if image.bytes[self.fresh]:
            image.bytes[self.fresh] = 0
            age = image.naturals[self.sample_age]
            image.bytes[self.waiting] = 0
            if self.last_sample is not None:
                image.longs[self.last_sample] = tick + 1
        elif image.bytes[self.attached] and age < 2**32 - 1:
            age += 1
        else:
            return
        image.naturals[self.age] = age
        image.bytes[self.valid] = not image.bytes[self.waiting] and (self.limit is None or age <= self.limit)

    def health(self, image: Image) -> int:
        """The best health of its instance."""
        if image.bytes[self.valid]:
            return _NOMINAL
        may_wait = image.bytes[self.waiting] and (self.grace is None or image.naturals[self.age] <= self.grace)
        return _DEGRADED if may_wait else _FAILED


class _State:
    """What a tick of a state does: entries in order, and numbered edges, the highest priority first."""

    def __init__(self, number: int, state: State, edges: Sequence[Edge], instances: Sequence[_Instance]):
        self.scheduled = frozenset(entry.instance for entry in state.entries)
        self.divisors = {entry.instance: entry.divisor for entry in state.entries}
        here = ((n, e) for n, e in enumerate(edges) if e.source == number)
        self.edges = sorted(here, key=lambda numbered: numbered[1].priority, reverse=True)
        self._entries = [(entry.instance, entry.divisor, entry.phase) for entry in state.entries]
        at_once = all(divisor == 1 for divisor in self.divisors.values())
        self._always = [entry.instance for entry in state.entries] if at_once else None
        #: Span number of each timed instance. Consecutive timed instances share clock readings: the end of one is the
        #: beginning of the next.
        self.spans: dict[int, int] = {}
        for before, entry in zip((None, *state.entries), state.entries, strict=False):
            if instances[entry.instance].limit_ns:
                self.spans[entry.instance] = (
                    self.spans.get(before.instance, entry.instance) if before else entry.instance
                )

    def due(self, tick: int) -> list[int]:
        """The instances that run in a tick, in order."""
        if self._always is not None:
            return self._always
        return [instance for instance, divisor, phase in self._entries if tick % divisor == phase]


class ReferenceMachine:
    """`init`, `start`, `step` and `force_state` have the meaning of those in fcsl_machine.h. Not thread-safe.

    `externs` makes the callable for a declared extern. Exceptions of user code other than faults propagate from `step`.
    """

    def __init__(
        self,
        machine: Machine,
        layout: Layout,
        places: Sequence[FaultRow],
        externs: Callable[[Extern], Callable[..., Any]] | None = None,
        events: Sequence[EventRow] = (),
    ):
        self.machine, self.layout = machine, layout
        self.host: Offered = Host()
        self.places, self.movers = FaultPlaces(places, machine.sources), Movers(layout, machine.requests)
        self._image = Image(bytearray())
        self._tick, self._ticks_in_state = _cell("machine.tick", layout, 8), _optional("machine.ticks_in_state", layout)
        self._lost_requests = _optional("machine.lost_requests", layout)
        self._state, self._next = (_cell(f"machine.{name}", layout, 4) for name in ("state", "next_state"))
        self._current = _cell("machine.current", layout, 4)
        config = machine.tree or json.loads(machine.config.text)
        parts = {name: part["requests"] for name, part in config.get("parts", {}).items()}
        self.requests = {name: Requests(machine.requests, name, {"": {}, **parts}) for name in ("", *parts)}
        self.literals = Literals(config, Path(machine.config.path).parent)
        self._events: list[tuple[tuple[int, int], tuple[Any, ...]]] = []  # of the execute that runs
        self._sites = self._numbered(events)
        self._algorithms = self._load(config, externs)
        self._sensors = {c.name: _Sensor(c, layout) for c in machine.channels if c.direction == "sensor"}
        self._instances: list[_Instance] = []
        delayed = [c for c in config.get("connections", []) if c.get("delayed")]
        for instance in machine.instances:
            written = config["instances"][instance.name]
            algorithm = self._algorithms[instance.algorithm.name]
            defaults = self.requests[algorithm.part].defaults(algorithm.defaults)
            given = {**defaults, **written.get("parameters", {}), **written.get("inputs", {})}
            given |= {
                c["to"].removeprefix(f"{instance.name}."): c["initial"]
                for c in delayed
                if c["to"].startswith(f"{instance.name}.")
            }
            self._instances.append(_Instance(instance, algorithm, given, self))
        self._sensors_of = [[s for s in self._sensors.values() if s.instance == i] for i in range(len(self._instances))]
        self._states = [_State(n, s, machine.edges, self._instances) for n, s in enumerate(machine.states)]
        self._delayed = [(c.target.instance, self._copies(c)) for c in machine.connections if c.delayed]
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
                made.bind(EVENT, self._event)
                for extern in made.externs.values() if externs is not None else ():
                    assert externs is not None
                    made.bind(extern.name, externs(extern))
            return modules[path]

        found: dict[str, Algorithm] = {}
        for algorithm in self.machine.algorithms:
            entry = config["algorithms"][algorithm.name]
            module, class_name = load(paths[algorithm.source]), str(entry.get("class", algorithm.name))
            sizes = {n: int(self.literals.number(size)) for n, size in entry.get("sizes", {}).items()}
            found[algorithm.name] = Algorithm(module, class_name, sizes, getattr(entry["source"], "part", ""))
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

    def _numbered(self, events: Sequence[EventRow]) -> list[dict[tuple[int, int], int]]:
        """For each instance the numbers of its sites, by line and by offset in bytes of that line."""
        sources = {source.name: source for source in self.machine.sources}
        found: list[dict[tuple[int, int], int]] = [{} for _ in self.machine.instances]
        for number, (instance, file, line, column) in enumerate(events):
            found[instance][line, len(sources[file].line(line)[: column - 1].encode())] = number
        return found

    def _event(self, line: int, offset: int, *values: Any) -> None:
        self._events.append(((line, offset), values))

    def _tell(self, index: int) -> None:
        """Gives the host the events of an execute that completed."""
        if self.host.event is not None:
            for place, values in self._events:
                self.host.event(self._sites[index][place], values)

    # ---- connections -----------------------------------------------------------------------------------------------

    def connected(self, target: str) -> tuple[list[Leaf], dict[str, Any]]:
        """Inputs of an instance that are copied before each execute: leaves of their sources with the places of the
        inputs; and, by place, values and functions for those that no field holds."""
        found, given = list[Leaf](), dict[str, Any]()
        names = [i.name for i in self.machine.instances]
        for connection in self.machine.connections:
            to, source = connection.target, connection.source
            if connection.delayed or names[to.instance] != target:
                continue
            place, type_ = f"s.{slot(to.path)}", self._input(to)
            if source.instance >= 0:
                path = f"{names[source.instance]}.{source.record}.{source.path}"
                found += leaves(type_, place, path, self.layout)
            else:
                assert isinstance(type_, Scalar)
                value = self._channel_source(source, to) if source.members else self._machine_source(source, to)
                given[place] = _typed(value, type_)
        for watched in self.machine.watched:
            if names[watched.instance] == target:
                place, type_ = f"s.{slot(watched.input)}", SCALARS[watched.type]
                if watched.path == "machine.tick":  # it counts this one, too
                    given[place] = _typed(lambda: self._image.longs[self._tick] + 1, type_)
                else:
                    leaf = Leaf(self.layout[watched.path], type_, place)
                    found.append(replace(leaf, offset=leaf.offset + (watched.element or 0) * (leaf.end - leaf.offset)))
        return found, given

    def _input(self, target: PortRef) -> Type:
        algorithm = self._algorithms[self.machine.instances[target.instance].algorithm.name]
        return algorithm.records["inputs"].members[target.path]

    def _copies(self, connection: Connection) -> list[tuple[slice, slice]]:
        """Bytes of the input of a delayed connection, and those of its source."""
        names, to, source = [i.name for i in self.machine.instances], connection.target, connection.source
        paths = f"{names[to.instance]}.inputs.{to.path}", f"{names[source.instance]}.{source.record}.{source.path}"
        found, wanted = (list(leaves(self._input(to), "", path, self.layout)) for path in paths)
        return [(slice(a.offset, a.end), slice(b.offset, b.end)) for a, b in zip(found, wanted, strict=True)]

    def _machine_source(self, source: PortRef, target: PortRef) -> Any:
        """The value of `machine.<field>`, or the function that returns it."""
        hz, receiver = self.machine.tick_hz, target.instance

        def period() -> float:
            return self._states[self._image.words[self._state]].divisors[receiver] / hz

        def resumed() -> bool:
            completed = self._instances[receiver].completed
            assert completed is not None
            return not self._image.bytes[completed]

        def elapsed() -> float:
            last_run = self._instances[receiver].last_run
            assert last_run is not None
            if resumed():
                return period()
            return (self._image.longs[self._tick] + 1 - self._image.longs[last_run]) / hz

        def ticks_in_state() -> int:
            assert self._ticks_in_state is not None
            return self._image.longs[self._ticks_in_state]

        sources: dict[str, Any] = {
            "dt": 1.0 / hz,
            "time_ns": lambda: wrap(I64, self._image.longs[self._tick] * 1_000_000_000 // hz),
            "tick": lambda: self._image.longs[self._tick],
            "period": period,
            "elapsed": elapsed,
            "resumed": resumed,
            "ticks_in_state": ticks_in_state,
        }
        return sources[source.field]

    def _channel_source(self, source: PortRef, target: PortRef) -> Callable[[], Any]:
        sensor, receiver = self._sensors[source.field], target.instance

        def fresh() -> bool:
            last_run = self._instances[receiver].last_run
            assert sensor.last_sample is not None and last_run is not None
            return self._image.longs[sensor.last_sample] > self._image.longs[last_run]

        sources: dict[str, Callable[[], Any]] = {
            "valid": lambda: self._image.bytes[sensor.valid] != 0,
            "age_ticks": lambda: self._image.naturals[sensor.age],
            "fresh": fresh,
        }
        return sources[source.members[0]]

    # ---- the four entries -----------------------------------------------------------------------------------------

    def _image_of(self, memory: Memory) -> Image:
        if memory is not self._image.memory:
            self._image = Image(memory)
        return self._image

    def init(self, memory: Memory) -> None:
        """Zeroes the memory, binds values."""
        image = self._image_of(memory)
        image.bytes[:] = bytes(len(image.bytes))
        image.words[self._current] = _NONE
        image.words[self._state] = image.words[self._next] = self.machine.initial_state
        for instance in self._instances:
            instance.init(image)
        for sensor in self._sensors.values():
            image.bytes[sensor.valid] = image.bytes[sensor.waiting] = 1

    def start(self, memory: Memory) -> int:
        """Runs every start in JSON order. Returns 0, or 1 + the index of the instance that faulted."""
        image = self._image_of(memory)
        for index, instance in enumerate(self._instances):
            if not instance.start(image):
                return index + 1
        return 0

    def step(self, memory: Memory, host: Offered | None = None) -> None:
        """Runs one tick."""
        self.host = host or Host()
        image = self._image_of(memory)
        words, tick = image.words, image.longs[self._tick]
        if words[self._state] != words[self._next]:
            self._enter(image, words[self._next])
            self._restart(image)
        for sensor in self._sensors.values():
            sensor.advance(image, tick)
        state = self._states[words[self._state]]
        due = state.due(tick)
        if tick > 0:
            for target, copies in self._delayed:
                if target in due:
                    for to, source in copies:
                        image.bytes[to] = image.bytes[source]
        self._read_span = None
        for index in due:
            self._run(image, index, state.spans.get(index), tick)
        if state.scheduled:
            words[self._current] = _NONE
        self._apply_effects(words)
        self._arbitrate(image, state, due)
        if self._ticks_in_state is not None:
            image.longs[self._ticks_in_state] = image.longs[self._ticks_in_state] + 1 & _LONG
        image.longs[self._tick] = tick + 1 & _LONG

    def force_state(self, memory: Memory, state: int) -> None:
        """Enters a state immediately and cancels a latched transition."""
        image = self._image_of(memory)
        if image.words[self._state] != state:
            self._enter(image, state)
        image.words[self._next] = state
        self._restart(image)

    def _restart(self, image: Image) -> None:
        """The coming tick becomes the first of its state."""
        if self._ticks_in_state is not None:
            image.longs[self._ticks_in_state] = 0

    def _enter(self, image: Image, state: int) -> None:
        """Instances scheduled in both the old and the new state continue. All others are stale until they run."""
        before, after = (self._states[n].scheduled for n in (image.words[self._state], state))
        for index, instance in enumerate(self._instances):
            if index not in before & after:
                image.words[instance.health] = _STALE
                if instance.completed is not None:
                    image.bytes[instance.completed] = 0
        image.words[self._state] = state

    def _run(self, image: Image, index: int, span: int | None, tick: int) -> None:
        """Runs one due instance: inputs, execute, health."""
        instance = self._instances[index]
        if span is not None and span != self._read_span:
            self._read_span, self._now_ns = span, self._clock_ns()
        instance.load(instance.self_, image.bytes)
        if instance.is_connected:
            instance.store_inputs(instance.self_, image.bytes)
        image.words[self._current], faults = index, image.longs[instance.faults]
        substitute = self.host.substitute if instance.algorithm.impure else None
        self._events.clear()
        if substitute is None or not substitute(index):
            instance.execute(image)
            executed = self.host.executed if instance.algorithm.impure else None
            if executed is not None:
                executed(index)
        else:
            image.bytes[instance.inject_fault] = 0  # the substituted record contains its effect
        if image.longs[instance.faults] == faults:
            self._note_completed(image, instance, tick)
            self._tell(index)
        if instance.limit_ns:
            self._judge_time(image, instance)
        for sensor in self._sensors_of[index]:
            image.words[instance.health] = max(image.words[instance.health], sensor.health(image))

    @staticmethod
    def _note_completed(image: Image, instance: _Instance, tick: int) -> None:
        if instance.last_run is not None:
            image.longs[instance.last_run] = tick + 1
        if instance.completed is not None:
            image.bytes[instance.completed] = 1

    def _clock_ns(self) -> int:
        return self.host.clock_ns() if self.host.clock_ns is not None else 0

    def _judge_time(self, image: Image, instance: _Instance) -> None:
        """An execute that took too long, or that is said to have done so, is at most degraded."""
        began, self._now_ns = self._now_ns, self._clock_ns()
        if image.bytes[instance.inject_overrun] or self._now_ns - began > instance.limit_ns:
            image.bytes[instance.inject_overrun] = 0
            image.longs[instance.overruns] = image.longs[instance.overruns] + 1 & _LONG
            if image.words[instance.health] == _NOMINAL:
                image.words[instance.health] = _DEGRADED

    def _apply_effects(self, words: memoryview) -> None:
        """Worsens the healths of the instances that violated requirements act on, unless they are stale."""
        for effect in self.machine.effects:
            if effect.target >= 0 and words[self._instances[effect.instance].health] == _DEGRADED:
                at = self._instances[effect.target].health
                words[at] = max(words[at], effect.health)

    def _arbitrate(self, image: Image, state: _State, due: list[int]) -> None:
        """Latches the target of the true edge with the highest priority. Requests of the others for another state are
        lost, and counted."""
        for rank, (_, edge) in enumerate(state.edges):
            if self._holds(image, edge, due):
                image.words[self._next] = edge.target
                for number, other in state.edges[rank + 1 :]:
                    requests_other = (
                        other.request >= 0 and other.request != edge.request and other.target != edge.target
                    )
                    if requests_other and self._holds(image, other, due):
                        assert self._lost_requests is not None
                        at = self._lost_requests + number
                        image.longs[at] = image.longs[at] + 1 & _LONG
                return

    def _holds(self, image: Image, edge: Edge, due: list[int]) -> bool:
        """Whether an edge is true. Requests and healths count on ticks when their instance ran; `stale` counts always.
        A timed edge requires that the state has lasted long enough, this tick included."""
        words = image.words
        if edge.guard_instance >= 0:
            health = words[self._instances[edge.guard_instance].health]
            if not edge.guard_mask >> health & 1 or health != _STALE and edge.guard_instance not in due:
                return False
        if edge.after_ticks:
            assert self._ticks_in_state is not None
            if image.longs[self._ticks_in_state] + 1 < edge.after_ticks:
                return False
        wanted = edge.request + 1
        if wanted == 0:
            return True
        for index in due:
            if words[self._instances[index].request] == wanted:
                return True
        return False


def _typed(value: Any, type_: Scalar) -> Any:
    """A value of `machine` or of a channel in the type of its input, or the function that returns it."""
    if not callable(value):
        return type_.of(value)
    return lambda: type_.of(value())
