# SPDX-License-Identifier: Apache-2.0
"""The values of a run by topic and by path: names, sizes, units. Bags, live nodes and telemetry describe theirs so."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import product

from fcsl_compiler.api.ros_names import recorded_path

from ..paths import PARTS
from ..ros.cdr import Layout

#: A declaration of a generated message, whose comment may begin with a unit: `float64 pos_z # [m] …`.
_DECLARATION = re.compile(r"^([\w/]+)(?:\[(\d+)\])? (\w+)(?: +# \[([^\]]+)\])?", re.MULTILINE)
#: Line before the definition of a nested message.
_SECTION = re.compile(r"^={80}\nMSG: \w+/(\w+)\n", re.MULTILINE)
_LAST_INDEX = re.compile(r"(.+)\[(\d{1,9})\]")
#: Fields of a message that are not a value to plot.
FRAME_FIELDS = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id", "tick")
#: Outputs that describe the instance and not the vehicle.
STATUS_FIELDS = ("transition_request", "health")
#: Topic of what actuators got, and its field that says whether they got commands; docs/hardware/arming.md.
ACTUATORS, GATE = "actuators", "gate"
GATES = ("disarmed", "armed", "silent")
ARMED = GATES.index("armed")
#: fcsl_msgs/InstanceHealth
HEALTH = ("nominal", "degraded", "failed", "stale")
STALE = HEALTH.index("stale")
#: Parts of an instance that are old while it is stale; the host writes parameters at any time.
PARTS_OF_A_RUN = ("outputs", "inputs", "state")
#: Number of an unknown health or state.
UNKNOWN = -1
#: Parts of paths that belong to the machine and to no instance.
_WITHOUT_INSTANCE = ("channels", "machine")
_FLOATS = ("float32", "float64")


@dataclass(frozen=True)
class Signals:
    """Fields of one topic, without values.

    `name` is the instance, for its outputs; `<instance>.<part>` (`nav.inputs`) or `channels` for other values of a
    machine; the topic itself for topics that are none of a machine. `sizes` maps a field to its number of elements (0:
    a scalar), `shapes` to its extents where it has several, `units` to its unit where it has one. `steps` are fields
    that jump between values (bool, integer, health).
    """

    name: str
    topic: str
    truth: bool
    sizes: Mapping[str, int]
    units: Mapping[str, str] = field(default_factory=dict)
    steps: frozenset[str] = frozenset()
    shapes: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def owner(self) -> str:
        """The instance, or the model of the plant."""
        return self.name.removesuffix(f".{self.part}")

    @property
    def part(self) -> str:
        """`outputs`, `inputs`, `parameters`, `state`, `counters`; empty for values without an instance."""
        if self.name.startswith("/") or self.name in _WITHOUT_INSTANCE:
            return ""
        _, dot, last = self.name.rpartition(".")
        return last if dot and last in PARTS else "outputs"

    @property
    def is_gate(self) -> bool:
        """Whether these are the values that actuators got."""
        return self.truth and self.name == ACTUATORS and GATE in self.sizes

    def is_health(self, name: str) -> bool:
        """Whether a field is the health of the instance; other fields named health are ordinary values."""
        return name == "health" and self.part == "outputs" and not self.truth

    def path(self, name: str) -> str:
        """The path of a field, as users write it."""
        if self.name.startswith("/"):
            return f"{self.name}:{name}"
        return ".".join([part for part in (self.owner, self.part) if part] + [name])


def signals_of(name: str, topic: str, truth: bool, layout: Layout, schema: str) -> Signals:
    """The signals of a topic whose messages have this layout and definition."""
    leaves = {path: leaf for path, leaf in layout.leaves.items() if path not in FRAME_FIELDS}
    sizes = {path: leaf.count for path, leaf in leaves.items()}
    steps = frozenset(path for path, leaf in leaves.items() if leaf.ros_type not in _FLOATS)
    return Signals(name, topic, truth, sizes, units_of(schema), steps)


@dataclass(frozen=True)
class Value:
    """A field, or a part of an array: `shape` elements from the flat element `first` on; `path` selects it."""

    path: str
    signals: Signals
    field: str
    first: int
    shape: tuple[int, ...]

    @property
    def lines(self) -> int:
        """The number of curves that show it."""
        return math.prod(self.shape)

    @property
    def unit(self) -> str:
        return self.signals.units.get(self.field, "")

    @property
    def name(self) -> str:
        """The field, with the indices that select a part of it."""
        return self.path.removeprefix(self.signals.path(""))

    def elements(self) -> Iterator[tuple[str, int | None]]:
        """(path, flat element) of each curve; the element of a scalar field is None."""
        if not self.signals.sizes[self.field]:
            yield self.path, None
            return
        for number, place in enumerate(product(*map(range, self.shape))):
            yield self.path + "".join(f"[{i}]" for i in place), self.first + number


class Catalogue:
    """The values of a run by path."""

    def __init__(self, all_signals: Sequence[Signals]):
        self.signals = all_signals
        self.values = {s.path(name): whole(s, name) for s in all_signals for name in s.sizes}

    def find(self, path: str) -> Value | None:
        """The field of this path, or the part of it that its last indices select; None if there is none."""
        field_path, indices = path, list[int]()
        while field_path not in self.values:
            match = _LAST_INDEX.fullmatch(field_path)
            if match is None:
                return None
            field_path, indices = match[1], [int(match[2]), *indices]
        known = self.values[field_path]
        return _part(path, known, indices) if indices else known

    def matching(self, pattern: str) -> list[Value]:
        """What a user's path selects: a field, an element, the members of a struct, or all that match a shell pattern.

        A shell pattern selects health and request of instances only where it selects nothing else.
        """
        found = self.find(pattern) or self.find(recorded_path(pattern))
        if found is not None:
            return [found]
        below = [value for path, value in self.values.items() if path.startswith((f"{pattern}.", f"{pattern}["))]
        below = below or [value for path, value in self.values.items() if fnmatchcase(path, pattern)]
        return [value for value in below if value.field not in STATUS_FIELDS] or below


def whole(signals: Signals, name: str) -> Value:
    """A field of a topic."""
    size = signals.sizes[name]
    return Value(signals.path(name), signals, name, 0, signals.shapes.get(name, (size,) if size else ()))


def _part(path: str, known: Value, indices: Sequence[int]) -> Value | None:
    """An element or a row of an array; None where the indices do not fit its extents."""
    extents = known.shape[: len(indices)]
    if len(indices) > len(known.shape) or any(i >= extent for i, extent in zip(indices, extents, strict=True)):
        return None
    rest = known.shape[len(indices) :]
    first = 0
    for i, extent in zip(indices, extents, strict=True):
        first = first * extent + i
    return Value(path, known.signals, known.field, first * math.prod(rest), rest)


def units_of(schema: str) -> dict[str, str]:
    """Units of a generated message's fields by path, members of structs included."""
    own, *rest = _SECTION.split(schema)
    structs = dict(zip(rest[::2], rest[1::2], strict=True))

    def collect(text: str, prefix: str, held: Mapping[str, str]) -> dict[str, str]:
        found: dict[str, str] = {}
        for type_, extent, name, unit in _DECLARATION.findall(text):
            if unit:
                found[prefix + name] = unit
            if type_ in held:
                # A struct never contains itself, but a damaged schema may.
                inner = {n: t for n, t in held.items() if n != type_}
                for place in [f"[{i}]" for i in range(int(extent))] if extent else [""]:
                    found |= collect(held[type_], f"{prefix}{name}{place}.", inner)
        return found

    return collect(own, "", structs)
