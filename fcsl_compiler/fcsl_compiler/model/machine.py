# SPDX-License-Identifier: Apache-2.0
"""The machine as data: a checked machine JSON with all names resolved."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from typing import Any

from ..base.diagnostics import nearest
from ..base.source import SourceFile, Span
from . import ir
from .program import Program
from .target import Target
from .types import BOOL, F64, I64, REQUEST, U32, U64, Scalar, Struct, Type, element_of

#: Values of `machine` that can be connected: name, type, unit. Three of them depend on the receiver: `period` (of its
#: runs in this state), `elapsed` (time since its last run) and `resumed` (first run since it was stale).
MACHINE_SOURCES: dict[str, tuple[Scalar, str]] = {
    "dt": (F64, "s"),
    "time_ns": (I64, "ns"),
    "tick": (U64, ""),
    "period": (F64, "s"),
    "elapsed": (F64, "s"),
    "resumed": (BOOL, ""),
    "ticks_in_state": (U64, ""),
}
#: Values of a sensor channel that can be connected. `fresh` depends on the receiver: a sample has arrived since its
#: last run.
CHANNEL_SOURCES: dict[str, Scalar] = {"valid": BOOL, "age_ticks": U32, "fresh": BOOL}

#: Scalars in the order of the leaves. A request is its name, a health its number.
Values = tuple[bool | int | float | str, ...]


@dataclass(frozen=True)
class Instance:
    name: str
    algorithm: ir.Algorithm
    parameters: dict[str, Values]
    inputs: dict[str, Values]  # initial values of host inputs
    max_wcet_us: int  # 0: not timed
    frozen: tuple[str, ...]  # parameters folded into its functions
    execute: ir.Function
    start: ir.Function | None
    span: Span
    published: bool = True  # as a ROS 2 message and topic
    nan_fails: bool = False  # a NaN or infinity that it assigns is a fault: its functions check it

    @property
    def identifier(self) -> str:
        """Its name in C: that of an instance of a part, `att.rate`, is `att__rate`, which no other name is."""
        return self.name.replace(".", "__")


def split_instance(path: str, instances: Collection[str]) -> tuple[str, str]:
    """The instance at the start of a path, and what follows it. Names of instances of parts have dots. If there is no such
    instance, the shortest name that begins no other one."""
    at = -1
    while (at := path.find(".", at + 1)) >= 0:
        if path[:at] in instances:
            return path[:at], path[at + 1 :]
    if path in instances:
        return path, ""
    name, _, rest = path.partition(".")
    while rest and any(known.startswith(f"{name}.") for known in instances):
        more, _, rest = rest.partition(".")
        name = f"{name}.{more}"
    return name, rest


def unknown_instance(name: str, instances: Sequence[str]) -> tuple[str, str]:
    """Message and correction for a name that no instance has. That of a part is the beginning of several."""
    own = [known for known in instances if known.startswith(f"{name}.")]
    if own:
        return f"`{name}` is a part, not an instance", f"name one of its instances: {', '.join(own)}"
    hint = nearest(name, instances) or f"the instances are {', '.join(instances) or 'none'}"
    return f"no instance `{name}`", hint


@dataclass(frozen=True)
class PortRef:
    """`instance.record.field`, or a member of it.

    Instance -1 denotes `machine.<field>` or, for a channel, `channels.<field>.<member>`.
    """

    instance: int
    record: str
    field: str
    type: Type
    unit: str
    declared: Span
    span: Span
    members: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """The field, followed by its member if one is named."""
        return ".".join((self.field, *self.members))

    def is_of_machine(self, name: str) -> bool:
        return (self.record, self.field) == ("machine", name)

    def is_of_channel(self, name: str) -> bool:
        return (self.record, self.members) == ("channels", (name,))


@dataclass(frozen=True)
class Connection:
    source: PortRef
    target: PortRef
    delayed: bool
    initial: Values  # of a delayed connection
    span: Span


@dataclass(frozen=True)
class Entry:
    instance: int
    divisor: int
    phase: int
    span: Span


@dataclass(frozen=True)
class State:
    name: str
    entries: tuple[Entry, ...]  # in execution order once scheduled
    span: Span


@dataclass(frozen=True)
class Edge:
    source: int
    target: int
    request: int  # -1: none
    priority: int
    guard_instance: int  # -1: none
    guard_mask: int
    after_ticks: int  # minimum time of the state in ticks; 0: not timed
    span: Span
    requirement: str = ""  # id of the one that guards it: with_effects makes a guard of it; "": none

    @property
    def is_guarded(self) -> bool:
        return self.guard_instance >= 0 or bool(self.requirement)


@dataclass(frozen=True)
class Effect:
    """A requirement that acts on the machine: it has an effect, or guards a transition. `instance` evaluates it and is
    degraded while it is violated; the health of `target` (-1: none) is then at least `health`."""

    requirement: str  # its id
    instance: int
    target: int
    health: int


@dataclass(frozen=True)
class Watched:
    """A scalar that an instance of `effects` reads: it is copied to an input of this type before each run."""

    instance: int
    input: str
    type: str  # of the language
    path: str  # of its field in the field table
    element: int | None  # of that field; None: the field is a scalar
    member: str  # C member expression of the field, relative to the machine struct
    c_type: str  # of one scalar of it


def seconds(ticks: int, tick_hz: int) -> str:
    """Time of `ticks` in s, as an exact decimal if it is finite (else 60 digits)."""
    with localcontext(prec=60):
        return f"{Decimal(ticks) / tick_hz:f}"


def nearest_seconds(ticks: Fraction, tick_hz: int) -> list[str]:
    """The times in s nearest to `ticks` ticks, below and above, that are a whole number of them and a finite decimal."""
    step = tick_hz
    for prime in (2, 5):
        while step % prime == 0:
            step //= prime
    below = ticks // step * step
    return [seconds(n, tick_hz) for n in (below, below + step) if n > 0]


@dataclass(frozen=True)
class RosMapping:
    """Mapping of a value to a part of a ROS 2 message, as written in the JSON. "" if not given."""

    type: str  # sensor_msgs/Imu
    field: str  # angular_velocity
    topic: str
    frame: str
    child_frame: str
    axes: str  # axes of the machine's value: frd, ned/frd, …
    choices: tuple[str | int, ...] = ()  # what the indices that the machine has stand for
    interfaces: Any = dataclass_field(compare=False, default=None)  # ros/interfaces.py: the definition of the message
    spans: dict[str, Span] = dataclass_field(compare=False, default_factory=dict)  # spans of the given keys


#: Types of services whose calls can be samples of a channel.
SERVICE_TYPES = ("std_srvs/Trigger", "std_srvs/SetBool")


@dataclass(frozen=True)
class Service:
    """A ROS 2 service whose calls are samples of a channel, as written in the JSON. After each tick the conditions
    `accepted` and `refused` ("": nothing refuses) say how the call that waits ends."""

    type: str  # of SERVICE_TYPES
    name: str
    accepted: str
    refused: str
    within_ticks: int
    spans: dict[str, Span] = dataclass_field(compare=False, default_factory=dict)  # spans of the given keys


#: Mapping of a channel without ROS message.
NOT_MAPPED = RosMapping("", "", "", "", "", "")


@dataclass(frozen=True)
class Channel:
    name: str
    id: int
    port: PortRef
    direction: str  # sensor, actuator, report
    max_age_ticks: int | None
    grace_ticks: int | None  # for how long an attached sensor may wait for its first sample; None: for ever
    ros: RosMapping
    span: Span
    safe: Values = ()  # of an actuator; () if not declared
    safe_span: Span | None = None  # of that value
    kind: str = "field"  # field, quaternion, blob
    service: Service | None = None  # instead of a message


@dataclass(frozen=True)
class Machine:
    name: str
    config: SourceFile
    package: str  # ROS package of its messages
    tick_hz: int
    initial_state: int
    instances: tuple[Instance, ...]
    connections: tuple[Connection, ...]
    states: tuple[State, ...]
    requests: tuple[str, ...]
    edges: tuple[Edge, ...]  # those of a state in falling priority
    channels: tuple[Channel, ...]
    program: Program
    sources: tuple[SourceFile, ...] = dataclass_field(default=())  # algorithm files, in JSON order
    targets: dict[str, Target] = dataclass_field(default_factory=dict)
    hashed_text: str = ""  # of the machine JSON, as source_hash covers it
    views: str = ""  # canonical text (config/views.py); "" without `views`
    subset: tuple[str, ...] = ()  # names of the instances of a subset machine (config/subset_machine.py)
    left_out: dict[str, str] = dataclass_field(default_factory=dict)  # source by omitted input
    arm: PortRef | None = None  # the bool output that arms the actuators
    command_timeout_ns: int = 0  # 0: none
    payload: str = "raw"  # of values on the bus: raw, cdr
    effects: tuple[Effect, ...] = ()  # of requirements, in JSON order
    watched: tuple[Watched, ...] = ()
    tree: dict[str, Any] = dataclass_field(
        default_factory=dict, compare=False
    )  # of the JSON, what reference/ reads of it

    @cached_property
    def acting(self) -> dict[int, Effect]:
        """The instances that requirements become."""
        return {effect.instance: effect for effect in self.effects}

    @property
    def made_sources(self) -> tuple[SourceFile, ...]:
        """Those of `sources` that the compiler made."""
        names = {self.instances[n].algorithm.source for n in self.acting}
        return tuple(source for source in self.sources if source.name in names)

    @property
    def structs(self) -> tuple[Struct, ...]:
        """All structs, in dependency order."""
        return tuple(self.program.structs.values())

    @property
    def algorithms(self) -> tuple[ir.Algorithm, ...]:
        """All algorithms in order of first use, each once."""
        seen: dict[str, ir.Algorithm] = {}
        for instance in self.instances:
            seen.setdefault(instance.algorithm.name, instance.algorithm)
        return tuple(seen.values())

    @property
    def entries(self) -> list[tuple[ir.Function, ir.Algorithm]]:
        """All execute and start functions, each once. Instances with frozen parameters have separate ones."""
        found: dict[str, tuple[ir.Function, ir.Algorithm]] = {}
        for instance in self.instances:
            for entry in (instance.start, instance.execute):
                if entry is not None:
                    found.setdefault(entry.name, (entry, instance.algorithm))
        return list(found.values())

    @property
    def emitted(self) -> list[tuple[ir.Function, ir.Algorithm | None]]:
        """All functions that are emitted, callees first. An execute or start comes with its algorithm."""
        found: list[tuple[ir.Function, ir.Algorithm | None]] = []
        used: set[str] = set()

        def use(names: tuple[str, ...]) -> None:
            for name in names:
                if name not in used:
                    use(self.program.functions[name].calls)
                    used.add(name)
                    found.append((self.program.functions[name], None))

        for entry, algorithm in self.entries:
            use(entry.calls)
            found.append((entry, algorithm))
        return found

    @property
    def externs(self) -> tuple[ir.Extern, ...]:
        """All externs that algorithms declare, each once."""
        return tuple({e.name: e for a in self.algorithms for e in a.externs}.values())

    @property
    def named_requests(self) -> set[str]:
        """All requests that an algorithm or a value of the JSON names. Only hosts can make other ones."""
        values = [v for i in self.instances for given in (i.parameters, i.inputs) for v in given.values()]
        values += [c.initial for c in self.connections]
        made = {name for instance in self.instances for name, _ in instance.algorithm.requests}
        return made | {v for value in values for v in value if isinstance(v, str) and v}

    @property
    def counts_state_ticks(self) -> bool:
        """Whether the machine struct has `ticks_in_state`."""
        return any(e.after_ticks for e in self.edges) or any(
            c.source.is_of_machine("ticks_in_state") for c in self.connections
        )

    @cached_property
    def preferred(self) -> dict[int, tuple[int, ...]]:
        """For each edge that can lose its request: the edges that are taken instead. They are of the same state, with a
        larger priority, another target and another request."""
        found: dict[int, tuple[int, ...]] = {}
        for source in range(len(self.states)):
            before: list[tuple[int, Edge]] = []
            for n, edge in ((n, e) for n, e in enumerate(self.edges) if e.source == source):
                others = [i for i, e in before if e.target != edge.target and e.request != edge.request]
                if others and edge.request >= 0:
                    found[n] = tuple(others)
                before.append((n, edge))
        return found

    @cached_property
    def last_runs(self) -> frozenset[int]:
        """Instances for which the struct stores the tick of the last completed run."""
        readers = [c for c in self.connections if c.source.is_of_machine("elapsed") or c.source.is_of_channel("fresh")]
        return frozenset(c.target.instance for c in readers)

    @cached_property
    def completed(self) -> frozenset[int]:
        """Instances for which the struct stores whether a run has completed since they were stale."""
        readers = [
            c for c in self.connections if c.source.is_of_machine("resumed") or c.source.is_of_machine("elapsed")
        ]
        return frozenset(c.target.instance for c in readers)

    @cached_property
    def last_samples(self) -> frozenset[str]:
        """Sensors for which the struct stores the tick of the last sample."""
        return frozenset(c.source.field for c in self.connections if c.source.is_of_channel("fresh"))

    def channel(self, name: str) -> Channel:
        return next(c for c in self.channels if c.name == name)

    def requests_of(self, instance: Instance) -> tuple[str, ...]:
        """All requests that an instance may make: those in its code and its frozen parameters, and every request if one
        of its other fields can hold a request."""
        if not instance.algorithm.makes_requests:
            return ()
        if _is_given_requests(instance):
            return self.requests
        given = [v for values in instance.parameters.values() for v in values if isinstance(v, str) and v]
        return tuple(dict.fromkeys([*(name for name, _ in instance.algorithm.requests), *given]))


def _is_given_requests(instance: Instance) -> bool:
    """Whether a connection or a host can write a request into one of its fields."""
    fixed = {("outputs", "transition_request"), *(("parameters", name) for name in instance.frozen)}
    ports = [(record, port) for record, ports in instance.algorithm.ports.items() for port in ports]
    return any(_holds_request(port.type) for record, port in ports if (record, port.name) not in fixed)


def _holds_request(type_: Type) -> bool:
    element = element_of(type_)
    return element == REQUEST if isinstance(element, Scalar) else any(_holds_request(m.type) for m in element.members)
