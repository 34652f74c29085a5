# SPDX-License-Identifier: Apache-2.0
"""The machine as data: what a checked machine JSON says, with every name resolved."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field

from . import ir
from .functions import Program
from .source import SourceFile, Span
from .targets import Target
from .types import F64, I64, U64, Scalar, Struct, Type

#: What `machine` offers to connect from: name, type, unit.
MACHINE_SOURCES: dict[str, tuple[Scalar, str]] = {"dt": (F64, "s"), "time_ns": (I64, "ns"), "tick": (U64, "")}

Values = tuple[bool | int | float, ...]


@dataclass(frozen=True)
class Instance:
    name: str
    algorithm: ir.Algorithm
    parameters: dict[str, Values]
    inputs: dict[str, Values]  # initial values of host inputs
    max_wcet_us: int  # 0: not timed
    frozen: tuple[str, ...]  # parameters that are folded into its functions
    execute: ir.Function
    start: ir.Function | None
    span: Span
    published: bool = True  # as a ROS 2 message and topic


@dataclass(frozen=True)
class PortRef:
    """`instance.record.field`, or a member of it; the reserved instance `machine` is index -1."""

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
        """The field, and the member of it where one is named."""
        return ".".join((self.field, *self.members))


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
    span: Span


@dataclass(frozen=True)
class RosMapping:
    """The part of a ROS 2 message that a value is, as the JSON says it; "" for what it does not say."""

    type: str  # sensor_msgs/Imu
    field: str  # angular_velocity
    topic: str
    frame: str
    child_frame: str
    axes: str  # of the machine's value: frd, ned/frd, …
    spans: dict[str, Span] = dataclass_field(
        compare=False, default_factory=dict
    )  # of each of them that is there, by name


#: Of a channel that ROS does not see.
NOT_MAPPED = RosMapping("", "", "", "", "", "")


@dataclass(frozen=True)
class Channel:
    name: str
    id: int
    port: PortRef
    direction: str  # sensor, actuator
    max_age_ticks: int | None
    ros: RosMapping
    span: Span


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
    edges: tuple[Edge, ...]
    channels: tuple[Channel, ...]
    program: Program
    sources: tuple[SourceFile, ...] = dataclass_field(default=())  # algorithm files, in JSON order
    targets: dict[str, Target] = dataclass_field(default_factory=dict)
    subset: tuple[str, ...] = ()  # its instances, where they are a part of those of the machine JSON (subset.py)
    left_out: dict[str, str] = dataclass_field(default_factory=dict)  # inputs a subset opened, to what fed them

    @property
    def structs(self) -> tuple[Struct, ...]:
        """Members' structs first."""
        return tuple(self.program.structs.values())

    @property
    def algorithms(self) -> tuple[ir.Algorithm, ...]:
        """In order of first use, each once."""
        seen: dict[str, ir.Algorithm] = {}
        for instance in self.instances:
            seen.setdefault(instance.algorithm.name, instance.algorithm)
        return tuple(seen.values())

    @property
    def entries(self) -> list[tuple[ir.Function, ir.Algorithm]]:
        """Every execute and start that an instance has, each once: frozen instances have their own."""
        found: dict[str, tuple[ir.Function, ir.Algorithm]] = {}
        for instance in self.instances:
            for entry in (instance.start, instance.execute):
                if entry is not None:
                    found.setdefault(entry.name, (entry, instance.algorithm))
        return list(found.values())

    @property
    def externs(self) -> tuple[ir.Extern, ...]:
        """Every extern that an algorithm declares, each once."""
        return tuple({e.name: e for a in self.algorithms for e in a.externs}.values())

    def requests_of(self, instance: Instance) -> tuple[str, ...]:
        return tuple(name for name, _ in instance.algorithm.requests)
