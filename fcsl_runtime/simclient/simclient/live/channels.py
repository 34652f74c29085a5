# SPDX-License-Identifier: Apache-2.0
"""Channels of telemetry as the topics that a bag of the same run would have, so that both are shown alike."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from ..telemetry.configuration import Channel
from ..view.scene import Cast
from ..view.signals import Signals

STATE = "machine.state"
#: What the timeline and the lanes of states show anyway.
_MACHINE = (STATE, "machine.next_state", "machine.tick")
_OUTPUTS = "outputs"
#: Where bags have what belongs to no instance: `channels.imu.valid` is imu.valid of record/channels.
_RECORD = "record"
_PARTS = ("inputs", _OUTPUTS, "parameters", "state", "counters")
#: Larger arrays are left out: every element would be a line.
ELEMENTS_MAX = 1024
#: Characters of a machine's name, which anyone may have sent.
NAME_MAX = 100


@dataclass
class _Topic:
    """Fields by name: how many elements (0: a scalar), unit, and the path of the channel."""

    name: str
    inside: bool
    sizes: dict[str, int] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    paths: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Channels:
    """`paths` says where the fields of a topic come from: topic -> field -> path of the channel."""

    cast: Cast
    paths: dict[str, dict[str, str]]
    too_large: list[str]


def channels_of(machine: str, channels: Mapping[str, Channel]) -> Channels:
    """The topics below /<machine>, and those of the plant below /sim."""
    prefix, plant = f"/{machine[:NAME_MAX] or 'machine'}", _plant(channels)
    topics: dict[str, _Topic] = {}
    too_large = []
    for path, channel in channels.items():
        elements = math.prod(channel.shape)
        if elements > ELEMENTS_MAX:
            too_large.append(path)
        elif is_health(path) and (channel.type != "Health" or channel.shape):
            continue  # no machine has such a one
        elif path not in _MACHINE:
            owner, part, name = _parts(path)
            home = f"/sim/{owner}" if owner in plant else f"{prefix}/{owner or _RECORD}"
            topic = home if part == _OUTPUTS else f"{home}/{part}"
            whose = ".".join(filter(None, (owner, part))) if part != _OUTPUTS else owner
            its = topics.setdefault(topic, _Topic(whose, part != _OUTPUTS))
            its.sizes[name] = elements if channel.shape else 0
            its.paths[name] = path
            if channel.unit:
                its.units[name] = channel.unit
    signals = {t: Signals(its.name, t, t.startswith("/sim/"), its.sizes, its.units) for t, its in topics.items()}
    cast = Cast(
        prefix,
        [signals[t] for t, its in topics.items() if not its.inside],
        channels[STATE].labels if STATE in channels else (),
        [signals[t] for t, its in topics.items() if its.inside],
    )
    return Channels(cast, {t: its.paths for t, its in topics.items()}, too_large)


def is_health(path: str) -> bool:
    """Of an instance; what else is called so is a value like others."""
    return path.partition(".")[2] == f"{_OUTPUTS}.health"


def _plant(channels: Mapping[str, Channel]) -> set[str]:
    """Whose outputs come without a health, while others' have one, is a model of the plant: models have none."""
    owners = {owner for owner, part, _ in map(_parts, channels) if part == _OUTPUTS}
    healthy = {owner for owner in owners if f"{owner}.{_OUTPUTS}.health" in channels}
    return owners - healthy if healthy else set()


def _parts(path: str) -> tuple[str, str, str]:
    """Owner, part and field of `nav.outputs.angle`; what belongs to no instance has no owner."""
    owner, _, rest = path.partition(".")
    part, _, name = rest.partition(".")
    return (owner, part, name) if part in _PARTS and name else ("", owner, rest or owner)
