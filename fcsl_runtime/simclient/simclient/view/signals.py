# SPDX-License-Identifier: Apache-2.0
"""What topics say, by name, size and unit, and how viewers recognise a vehicle in it: its altitude, attitude, thrust.

Pictures of bags and live views know a run by this, so both show the same of it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeVar

from ..ros.cdr import Layout

#: A declaration of a generated message, whose comment may begin with a unit: `float64 pos_z # [m] …`.
_DECLARATION = re.compile(r"^([\w/]+)(?:\[(\d+)\])? (\w+)(?: +# \[([^\]]+)\])?", re.MULTILINE)
#: What stands in front of the definition of a message that the one above it holds.
_SECTION = re.compile(r"^={80}\nMSG: \w+/(\w+)\n", re.MULTILINE)
#: Fields of a message that are not a value to plot.
FRAME_FIELDS = ("header.stamp.sec", "header.stamp.nanosec", "tick")
#: Outputs that say how the instance is, not what the vehicle does.
STATUS_FIELDS = ("transition_request", "health")
#: fcsl_msgs/InstanceHealth
HEALTH = ("nominal", "degraded", "failed", "stale")
STALE = HEALTH.index("stale")
#: In place of the number of a health or of a state.
UNKNOWN = -1


class Quantity(NamedTuple):
    """How an output is recognised: by name, the earlier the better, and by unit ("": any)."""

    names: tuple[str, ...]
    unit: str


# What these say is also in cli.VEHICLE_RULE, for users.
ALTITUDE = Quantity(("pos_z", "altitude", "z"), "m")
VELOCITY = Quantity(("vel_z", "velocity", "climb_rate"), "m/s")
THROTTLE = Quantity(("throttle", "thrust"), "")
QUATERNION = ("q", "quat", "quaternion", "attitude", "orientation")
POSITION = Quantity(("pos", "position"), "m")
FORCE = Quantity(("thrust", "force"), "N")


class Described(Protocol):
    """Fields of one topic: `sizes` maps name to number of elements (0: a scalar), `units` to unit where one is said."""

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
    """What one topic says, without the values."""

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

    Names that a field of the right unit bears go before names that only fields without a unit bear.
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
    """Whether the field is in `unit`, or does not say in what; every unit will do when `unit` is empty."""
    return not unit or source.units.get(field_name, unit) == unit


def quaternions(sources: Sequence[S]) -> list[tuple[S, str]]:
    """Every output that is an attitude by name and size, scalar first."""
    return [(s, n) for s in sources for n, size in s.sizes.items() if n.rpartition(".")[2] in QUATERNION and size == 4]


def raw_instance(sources: Sequence[S]) -> str:
    """The instance that carries the vehicle's raw sensors: where there is truth, the first that has an altitude."""
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
                # A struct never holds itself; a damaged schema may say so.
                inner = {n: t for n, t in held.items() if n != type_}
                for place in [f"[{i}]" for i in range(int(extent))] if extent else [""]:
                    found |= collect(held[type_], f"{prefix}{name}{place}.", inner)
        return found

    return collect(own, "", structs)
