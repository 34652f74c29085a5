# SPDX-License-Identifier: Apache-2.0
"""Maps telemetry channels to the topics that a bag of the same run would have, so that both are shown alike."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from ..paths import split_path
from ..telemetry.configuration import Channel
from ..view.scene import Cast
from ..view.signals import Signals
from ..view.views import Views

STATE = "machine.state"
#: Fields that the timeline and the state lanes show already.
_MACHINE = (STATE, "machine.next_state", "machine.tick")
_OUTPUTS = "outputs"
#: Topic suffix, as in bags, of fields without an instance: `channels.imu.valid` is imu.valid of record/channels.
_RECORD = "record"
_FLOATS = ("f32", "f64")
#: Larger arrays are left out, because every element is drawn as a line.
ELEMENTS_MAX = 1024
#: Most characters of a machine's name, which comes from an untrusted sender.
NAME_MAX = 100


@dataclass
class _Topic:
    """Fields by name: number of elements (0: a scalar), unit, extents of arrays of arrays, and the path of the channel."""

    name: str
    inside: bool
    sizes: dict[str, int] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    steps: set[str] = field(default_factory=set)
    paths: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Channels:
    """`paths` maps topic -> field -> path of the channel."""

    cast: Cast
    paths: dict[str, dict[str, str]]
    too_large: list[str]


def channels_of(
    machine: str, channels: Mapping[str, Channel], views: Views | None = None, remark: str = ""
) -> Channels:
    """The topics below /<machine>, and those of the plant below /sim; `views` and `remark` are those of Cast."""
    prefix, plant = f"/{machine[:NAME_MAX] or 'machine'}", _plant(channels)
    topics: dict[str, _Topic] = {}
    too_large = []
    for path, channel in channels.items():
        elements = math.prod(channel.shape)
        if elements > ELEMENTS_MAX:
            too_large.append(path)
        elif is_health(path) and (channel.type != "Health" or channel.shape):
            continue  # no machine has such a channel
        elif path not in _MACHINE:
            owner, part, name = _parts(path)
            home = f"/sim/{owner}" if owner in plant else f"{prefix}/{owner.replace('.', '/') or _RECORD}"
            topic = home if part == _OUTPUTS else f"{home}/{part}"
            whose = ".".join(filter(None, (owner, part))) if part != _OUTPUTS else owner
            its = topics.setdefault(topic, _Topic(whose, part != _OUTPUTS))
            its.sizes[name] = elements if channel.shape else 0
            its.paths[name] = path
            if len(channel.shape) > 1:
                its.shapes[name] = channel.shape
            if channel.type not in _FLOATS:
                its.steps.add(name)
            if channel.unit:
                its.units[name] = channel.unit
    signals = {
        t: Signals(its.name, t, t.startswith("/sim/"), its.sizes, its.units, frozenset(its.steps), its.shapes)
        for t, its in topics.items()
    }
    cast = Cast(
        prefix,
        [signals[t] for t, its in topics.items() if not its.inside],
        channels[STATE].labels if STATE in channels else (),
        [signals[t] for t, its in topics.items() if its.inside],
        views,
        remark,
    )
    return Channels(cast, {t: its.paths for t, its in topics.items()}, too_large)


def is_health(path: str) -> bool:
    """Whether the path is the health of an instance; other fields named health are ordinary values."""
    return split_path(path)[1:] == (_OUTPUTS, "health")


def _plant(channels: Mapping[str, Channel]) -> set[str]:
    """The plant models: owners of outputs without a health, if other owners have one. Models have no health."""
    owners = {owner for owner, part, _ in map(_parts, channels) if part == _OUTPUTS}
    healthy = {owner for owner in owners if f"{owner}.{_OUTPUTS}.health" in channels}
    return owners - healthy if healthy else set()


def _parts(path: str) -> tuple[str, str, str]:
    """Owner, part and field of `nav.outputs.angle`. A path without an instance has an empty owner."""
    owner, part, name = split_path(path)
    first, _, rest = path.partition(".")
    return (owner, part, name) if owner else ("", first, rest or first)
