# SPDX-License-Identifier: Apache-2.0
"""Which sensor channels get no sample."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.services.dropouts import Dropouts
from fcsl_bridge.topics import mapped_topics
from simclient.run import open_run


def test_what_is_missing_grows_old_and_the_rest_does_not() -> None:
    r = random.Random(5)
    run = open_run(*find_machine("lander/lander_control"))
    dropouts = Dropouts(run.machine)
    left = {c.name: 0 for c in run.machine.channels if c.direction == "sensor"}
    for _ in range(200):
        if r.random() < 0.1:
            name, ticks = r.choice(list(left)), r.randrange(5)
            dropouts.add(name, ticks)
            left[name] = ticks
        assert dropouts.missing() == {name for name, ticks in left.items() if ticks > 0}
        left = {name: max(ticks - 1, 0) for name, ticks in left.items()}
    run.close()


def test_what_is_taken_is_counted_elsewhere() -> None:
    run = open_run(*find_machine("lander/lander_control"))
    dropouts = Dropouts(run.machine)
    dropouts.add("altitude", 3)
    assert dropouts.take() == [(0, 3)] and not dropouts.take() and not dropouts.missing()
    with pytest.raises(BridgeError, match="no sensor channel `nothing`; there are "):
        dropouts.add("nothing", 1)
    run.close()


def test_what_is_missing_in_mode_free_is_a_channel_and_not_its_topic() -> None:
    """A dropout removes values of a message; a message without remaining values does not supersede an older one."""
    delivered: list[tuple[bytes, frozenset[str]]] = []

    def deliver(data: bytes, now_ns: int, missing: frozenset[str]) -> int:
        delivered.append((data, missing))
        return data == b"good"

    waiting = SimpleNamespace(take_all=lambda: [b"old", b"good", b"bad"])
    sample_input = SimpleNamespace(deliver=deliver, counts=dict)
    one: Any = mapped_topics._Input(cast(Any, None), cast(Any, None), cast(Any, sample_input), cast(Any, waiting))
    one.poll(0, frozenset({"imu.gyro"}))
    assert delivered == [(b"bad", frozenset({"imu.gyro"})), (b"good", frozenset({"imu.gyro"}))]
