# SPDX-License-Identifier: Apache-2.0
"""Values of topics by name, size and unit, and the rules that identify a vehicle's altitude, attitude and thrust.

Pictures of bags and live views both use these rules, so they show the same quantities.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeVar

from ..ros.cdr import Layout

#: A declaration of a generated message, whose comment may begin with a unit: `float64 pos_z # [m] …`.
_DECLARATION = re.compile(r"^([\w/]+)(?:\[(\d+)\])? (\w+)(?: +# \[([^\]]+)\])?", re.MULTILINE)
#: Line before the definition of a nested message.
_SECTION = re.compile(r"^={80}\nMSG: \w+/(\w+)\n", re.MULTILINE)
#: Fields of a message that are not a value to plot.
FRAME_FIELDS = ("header.stamp.sec", "header.stamp.nanosec", "tick")
#: Outputs that describe the instance and not the vehicle.
STATUS_FIELDS = ("transition_request", "health")
#: fcsl_msgs/InstanceHealth
HEALTH = ("nominal", "degraded", "failed", "stale")
STALE = HEALTH.index("stale")
#: Number of an unknown health or state.
UNKNOWN = -1


class Quantity(NamedTuple):
    """How an output is identified: by name, in order of preference, and by unit ("": any)."""

    names: tuple[str, ...]
    unit: str


# cli.VEHICLE_RULE documents these rules for users.
ALTITUDE = Quantity(("pos_z", "altitude", "z"), "m")
VELOCITY = Quantity(("vel_z", "velocity", "climb_rate"), "m/s")
THROTTLE = Quantity(("throttle", "thrust"), "")
QUATERNION = ("q", "quat", "quaternion", "attitude", "orientation")
POSITION = Quantity(("pos", "position"), "m")
FORCE = Quantity(("thrust", "force"), "N")


class Described(Protocol):
    """Fields of one topic: `sizes` maps name to number of elements (0: a scalar), `units` to unit, where there is one."""

    @property
    def name(self) -> str: ...
    @property
    def truth(self) -> bool: ...
    @property
    def units(self) -> Mapping[str, str]: ...
    @property
    def sizes(self) -> Mapping[str, int]: ...


@dataclass(frozen=True)
class Signals:
    """Fields of one topic, without values."""

    name: str
    topic: str
    truth: bool
    sizes: Mapping[str, int]
    units: Mapping[str, str] = field(default_factory=dict)


S = TypeVar("S", bound=Described)


def signals_of(name: str, topic: str, truth: bool, layout: Layout, schema: str) -> Signals:
    """The signals of a topic whose messages have this layout and definition."""
    sizes = {path: leaf.count for path, leaf in layout.leaves.items() if path not in FRAME_FIELDS}
    return Signals(name, topic, truth, sizes, units_of(schema))


def named(sources: Sequence[S], quantity: Quantity, size: int = 0) -> list[tuple[S, str]]:
    """The fields of `size` elements that are `quantity`, all of one name: truth first, then by instance.

    Names with a field of the right unit have precedence over names with only fields without a unit.
    """
    without_unit: list[tuple[S, str]] = []
    for name in quantity.names:
        fitting = [s for s in sources if s.sizes.get(name) == size and _may_be_in(s, quantity.unit, name)]
        found = [(s, name) for s in sorted(fitting, key=lambda source: not source.truth)]
        if any(not quantity.unit or name in s.units for s in fitting):
            return found
        without_unit = without_unit or found
    return without_unit


def _may_be_in(source: Described, unit: str, field_name: str) -> bool:
    """Whether the field is in `unit` or has no unit; an empty `unit` accepts every unit."""
    return not unit or source.units.get(field_name, unit) == unit


def quaternions(sources: Sequence[S]) -> list[tuple[S, str]]:
    """Every output that is an attitude by name and size, scalar first."""
    return [(s, n) for s in sources for n, size in s.sizes.items() if n.rpartition(".")[2] in QUATERNION and size == 4]


def raw_instance(sources: Sequence[S]) -> str:
    """The instance with the vehicle's raw sensors: if there is truth, the first with an altitude."""
    found = named(sources, ALTITUDE)
    has_truth = any(source.truth for source, _ in found)
    return next((source.name for source, _ in found if has_truth and not source.truth), "")


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
